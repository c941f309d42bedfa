#!/usr/bin/env python3
"""Files that version 0.1.0 wrote are read as they were: each command's figures are those that it said then (docs/stability.md).

Usage: samples_test.py ROOT BIN [--write]    --write: takes today's figures as right, for a new sample
"""

import json
import math
import pathlib
import shutil
import subprocess
import sys
import tempfile

SAMPLES = pathlib.Path(sys.argv[1]) / "tests/samples"
EXPECTED = SAMPLES / "expected.json"
COMMANDS = [  # words, and the exit code
    ("calib show calibration.json", 0),
    ("calib convert calibration.json --to mrcal --out OUT/mrcal", 0),
    ("dataset verify dataset", 0),
    ("dataset info dataset", 0),
    ("dataset pack dataset --split split.json --crop 32 --out OUT/pack", 0),
    ("dataset verify pack", 0),
    ("dataset info pack", 0),
    ("session show session", 3),  # without its footage
    ("markers convert pose3d --frame-rate 25 --out OUT/take.trc", 0),
]
UNSTEADY = ("times", "wall_over_decode", "bytes")


def same(now, then):
    """Keys may be added, none may change."""
    if isinstance(then, dict):
        return isinstance(now, dict) and all(key in now and same(now[key], value) for key, value in then.items())
    if isinstance(then, list):
        return isinstance(now, list) and len(now) == len(then) and all(map(same, now, then))
    if isinstance(then, float) or isinstance(now, float):
        return now is not None and then is not None and math.isclose(now, then, rel_tol=1e-7, abs_tol=1e-12)
    return now == then


def main():
    expected = json.loads(EXPECTED.read_text()) if EXPECTED.exists() else {}
    found, faults = {}, []
    with tempfile.TemporaryDirectory() as folder:
        work = pathlib.Path(folder) / "samples"
        shutil.copytree(SAMPLES, work)
        for words, code in COMMANDS:
            run = subprocess.run([sys.argv[2], *words.replace("OUT", folder).split(), "--json"], cwd=work, capture_output=True, text=True)
            result = json.loads(run.stdout)
            metrics = {key: value for key, value in result["metrics"].items() if key not in UNSTEADY}
            found[words] = json.loads(json.dumps(metrics).replace(folder, "OUT"))
            if result["exit"] != code:
                faults.append(f"{words}: exit {result['exit']}: {run.stderr.strip()}")
            elif not same(found[words], expected.get(words)) and "--write" not in sys.argv:
                faults.append(f"{words}: {json.dumps(found[words])}\n  was {json.dumps(expected.get(words))}")
    if "--write" in sys.argv:
        EXPECTED.write_text(json.dumps(found) + "\n")
    print("\n".join(faults))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
