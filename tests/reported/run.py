#!/usr/bin/env python3
"""run.py --bin MVSTUDIO [--slow] [--only PATTERN]: each case of cases.py, one line each; exit 77 without the recordings."""
import argparse
import gzip
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

import cases


def inputs():
    data = os.environ.get("MVSTUDIO_DATA") or pathlib.Path(__file__).resolve().parents[3] / "shared" / "data"
    return pathlib.Path(data) / "reports"


def failures_of(check, output, place):
    """What one check finds wrong, or nothing."""
    if isinstance(check, str):
        wanted, pattern = not check.startswith("not "), check.removeprefix("not ")
        found = re.search(pattern, output) or pattern in output
        return [] if bool(found) == wanted else [f"{'no' if wanted else 'unwanted'} `{pattern}`"]
    what, value, least, most = check
    got = value(place)
    return [] if least <= got <= most else [f"{what} is {got}, not {least} to {most}"]


def run_step(program, step, place):
    ran = subprocess.run([program, *map(place, step.args)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=600)
    wrong = [] if ran.returncode == step.exit_code else [f"exit {ran.returncode}, not {step.exit_code}"]
    if not wrong:
        wrong = [w for check in step.checks for w in failures_of(check, ran.stdout, place)]
    return [f"{w}\n    {' '.join(map(place, step.args))}\n    " + ran.stdout.strip().replace("\n", "\n    ") for w in wrong[:1]]


def run_case(program, case):
    with tempfile.TemporaryDirectory() as folder:
        place = lambda text: text.replace("{R}", str(inputs())).replace("{T}", folder)
        for packed in case.packed:
            path = pathlib.Path(place(packed))
            (pathlib.Path(folder) / path.stem).write_bytes(gzip.decompress(path.read_bytes()))
        for step in case.steps:
            wrong = run_step(program, step, place)
            if wrong:
                return wrong
    return []


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--bin", required=True)
    arguments.add_argument("--slow", action="store_true", help="the slow cases, not the others")
    arguments.add_argument("--only", default="", help="a pattern of names; then slow ones, too")
    options = arguments.parse_args()
    if not inputs().is_dir():
        print(f"{inputs()}: no such folder: skipped")
        return 77
    chosen = [c for c in cases.ALL if re.search(options.only, c.name) and (options.only or c.slow == options.slow)]
    num_wrong = 0
    for case in chosen:
        start = time.monotonic()
        wrong = run_case(options.bin, case)
        num_wrong += bool(wrong)
        print(f"{'FAILED' if wrong else 'ok'}  {case.name}  {time.monotonic() - start:.1f} s", *wrong, sep="\n  ", flush=True)
    print(f"{len(chosen) - num_wrong} of {len(chosen)} right")
    return 1 if num_wrong or not chosen else 0


if __name__ == "__main__":
    sys.exit(main())
