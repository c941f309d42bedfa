#!/usr/bin/env python3
"""Recordings with exactly one thing wrong, what `mvstudio calibrate` says of them, and whether that is right (docs/reliability.md).

run.py --bin mvstudio [--kinds NAMES] [--seeds 1-2] [--jobs 2] [--json FILE] [--sample] [--keep FOLDER] [--quiet]
run.py --list | --table FILE... | --write FOLDER --kinds NAME --seeds 1

NAMES are kinds or groups, with commas, `*` allowed. Ends with 1 when a result is silently wrong, a refusal needless or the program
crashed, unless known.txt lists it; --real thins the real recordings of $MVSTUDIO_DATA instead.
"""

import argparse
import concurrent.futures
import fnmatch
import json
import os
import pathlib
import sys
import tempfile
import time
import zlib

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")  # one job, one processor
sys.dont_write_bytecode = True
HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))
SKIPPED = 77
try:
    import numpy as np
except ImportError:
    print("needs python3-numpy")
    sys.exit(SKIPPED)

import alarms  # noqa: E402
import judge  # noqa: E402
import program  # noqa: E402
import registry  # noqa: E402
import tables  # noqa: E402


def random_of(kind, seed):
    return np.random.default_rng([zlib.crc32(kind.encode()), seed])


def run_one(binary, name, seed, work, keep):
    """One recording: made, calibrated, judged; a plain dictionary for the JSON file."""
    kind = registry.load()[name]
    recording = kind.make(random_of(name, seed))
    with tempfile.TemporaryDirectory(dir=work) as scratch:
        folder = pathlib.Path(keep).resolve() / f"{name}-{seed}" if keep else pathlib.Path(scratch)
        run = program.calibrate(binary, recording, folder)
        started = time.monotonic()
        with_model = lambda model: program.calibrate(binary, recording, folder, model)  # noqa: E731
        done = judge.judge(kind, recording, run, with_model)
        right_with = judge.right_with_true_lens(recording, done, with_model) if done.comparison else None
    row = {"kind": name, "group": kind.group, "seed": seed, "clean": kind.clean, "outcome": done.outcome, "warned": done.warned,
           "failed": done.failed, "exit": run.exit, "seconds": round(run.seconds, 2),
           "judge_seconds": round(time.monotonic() - started, 2), "why": done.why, "worst": finite(done.worst),
           "worst_px": finite(done.worst_px), "hinted": done.hinted, "outside_only": done.outside_only,
           "culprits": recording.culprits, "messages": [list(m) for m in run.messages()],
           "pixels_right": bool(done.comparison and done.comparison.pixels_right),
           "right_with": right_with,
           "models": [c.get("model") for c in run.result.get("metrics", {}).get("cameras", [])],
           "true_models": [c.lens.model for c in recording.scene.cameras]}
    if kind.clean:
        row["false_alarms"] = alarms.false_alarms(recording, run, done.comparison)
    if kind.statistics and done.comparison:
        row["coverage"] = judge.coverage(done.comparison)
    return row


def finite(value):
    return float(value) if np.isfinite(value) else None


def kinds_of(text):
    """Names of kinds by names, groups and patterns."""
    kinds, chosen = registry.load(), []
    for word in text.split(","):
        found = [n for n, k in kinds.items() if fnmatch.fnmatch(n, word) or k.group == word]
        if not found:
            sys.exit(f"run.py: no kind or group is called {word}; --list shows them")
        chosen += [n for n in found if n not in chosen]
    return chosen


def seeds_of(text):
    seeds = []
    for part in text.split(","):
        first, _, last = part.partition("-")
        seeds += range(int(first), int(last or first) + 1)
    return seeds


def sample():
    """The runs of sample.txt: lines `KIND SEED [named]`; and those whose cause is to be named, when they are not right."""
    lines = [line.split() for line in (HERE / "sample.txt").read_text().splitlines() if line.strip() and not line.startswith("#")]
    runs = [(words[0], int(words[1])) for words in lines]
    return runs, {run for run, words in zip(runs, lines) if words[2:] == ["named"]}


def known():
    """(kind, seed or *) -> (outcome, reason) of known.txt."""
    entries = {}
    for line in (HERE / "known.txt").read_text().splitlines():
        if line.strip() and not line.startswith("#"):
            head, reason = line.split(":", 1)
            kind, seed, *outcome = head.split()
            entries[(kind, seed)] = (" ".join(outcome), reason.strip())
    return entries


def is_known(row, entries):
    entry = entries.get((row["kind"], str(row["seed"]))) or entries.get((row["kind"], "*"))
    return entry is not None and entry[0] == row["outcome"]


def work_through(options, tasks):
    rows = []
    shared = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    with tempfile.TemporaryDirectory(prefix="mvstudio-mutations-", dir=shared) as work, \
            concurrent.futures.ProcessPoolExecutor(options.jobs) as pool:
        futures = [pool.submit(run_one, options.bin, name, seed, work, options.keep) for name, seed in tasks]
        for future in concurrent.futures.as_completed(futures):
            if future.exception():
                pool.shutdown(wait=True, cancel_futures=True)
            row = future.result()
            rows.append(row)
            if not options.quiet:
                print(f"{len(rows)}/{len(tasks)} {tables.line_of(row)}", flush=True)
            if options.json:
                options.json.write_text(json.dumps({"runs": sorted(rows, key=lambda r: (r["kind"], r["seed"]))}, indent=1))
    return sorted(rows, key=lambda r: (r["kind"], r["seed"]))


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    build = pathlib.Path(os.environ.get("MVSTUDIO_BUILD", HERE.parents[1] / "build/release"))
    parser.add_argument("--bin", type=pathlib.Path, default=pathlib.Path(os.environ.get("MVSTUDIO_BIN", build / "bin/mvstudio")))
    parser.add_argument("--kinds", default="*")
    parser.add_argument("--seeds", default="1-2")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", type=pathlib.Path)
    parser.add_argument("--sample", action="store_true", help="the runs of sample.txt")
    parser.add_argument("--keep", type=pathlib.Path, help="keep recordings and results there")
    parser.add_argument("--quiet", action="store_true")
    parser.add_argument("--list", action="store_true", help="the kinds, and what is wrong in each")
    parser.add_argument("--table", type=pathlib.Path, nargs="+", help="Markdown of these JSON files")
    parser.add_argument("--write", type=pathlib.Path, help="only write the recordings there")
    parser.add_argument("--real", action="store_true", help="thinned real recordings (real.py)")
    parser.add_argument("--takes", action="store_true", help="takes of 2D joints and `mvstudio triangulate` (takes.py)")
    parser.add_argument("--folds", type=int, default=3, help="--real: subsets of each size")
    options = parser.parse_args()
    options.bin = options.bin.resolve()
    return options


def write_recordings(options):
    for name in kinds_of(options.kinds):
        for seed in seeds_of(options.seeds):
            recording = registry.load()[name].make(random_of(name, seed))
            folder = (options.write / f"{name}-{seed}").resolve()
            corners = program.write(recording, folder)
            print("mvstudio calibrate", *program.arguments(recording, folder, corners), "--out", folder / "out")


def main():
    options = arguments()
    if options.list:
        print("\n".join(f"{k.group:16} {n:26} {k.note}" for n, k in registry.load().items()))
        return 0
    if options.write:
        return write_recordings(options)
    if options.table:
        print(tables.markdown([json.loads(path.read_text()) for path in options.table]))
        return 0
    if not options.bin.is_file():
        print(f"{options.bin}: not built")
        return SKIPPED
    if options.takes:
        import takes
        return takes.main(options)
    if options.real:
        import real
        return real.main(options)
    tasks, to_name = [(n, s) for n in kinds_of(options.kinds) for s in seeds_of(options.seeds)], set()
    if options.sample:
        tasks, to_name = sample()
    started = time.monotonic()
    rows = work_through(options, tasks)
    entries = known()
    print("\n" + tables.markdown([{"runs": rows}]) + "\n")
    unnamed = (judge.UNNAMED, judge.REFUSED_UNNAMED)
    bad = [row for row in rows
           if row["outcome"] in judge.BAD or (row["outcome"] in unnamed and (row["kind"], row["seed"]) in to_name)]
    for row in bad:
        print(f"{'known' if is_known(row, entries) else 'BAD'} {tables.line_of(row)}")
    new = [row for row in bad if not is_known(row, entries)]
    print(f"{len(rows)} recordings in {time.monotonic() - started:.0f} s, {len(bad)} bad, {len(new)} of them not known")
    return 1 if new else 0


if __name__ == "__main__":
    sys.exit(main())
