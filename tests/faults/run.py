#!/usr/bin/env python3
"""Disturbs every command that writes, at every place where the disk or the memory can fail, and looks at what is left.

run.py --bin mvstudio --shim libmvstudio_faults.so [--all | --short] [--only WORDS] [--classes LIST] [--per-class N] [--jobs N]
       [--seconds S] [--json FILE] [--work FOLDER] [--list]

For every command and every class of calls (open, write, fsync, rename, ...) the n-th call fails, n = 1, 2, … until the command
passes undisturbed; then the command is killed before every call that changes the disk; then the disk is full, then read-only, then
two run at once. docs/reliability.md says what is promised; verdict.py checks it. Ends with 1 when a promise was broken.
"""

import argparse
import collections
import json
import multiprocessing
import os
import pathlib
import queue
import shutil
import subprocess
import sys
import tempfile
import time

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).parent))
import commands  # noqa: E402
import snapshot  # noqa: E402
from program import Program, Symbols  # noqa: E402
from trial import COLUMNS, GROUPS, NOTES, Trial  # noqa: E402

# ---- many of them ------------------------------------------------------------------------------------------------------------

def environment_of(box):
    """Everything that the program may write to by itself lies in the box."""
    keep = {k: os.environ[k] for k in ("PATH", "LANG", "MVSTUDIO_DATA") if k in os.environ}
    return dict(keep, HOME=f"{box}/home", XDG_CACHE_HOME=f"{box}/home/.cache", MVSTUDIO_CACHE="off", TMPDIR=f"{box}/tmp",
                MVSTUDIO_MODELS=os.environ.get("MVSTUDIO_MODELS", "/nonexistent"), GOMP_SPINCOUNT="1000", OMP_NUM_THREADS="1",
                OPENBLAS_NUM_THREADS="1", COLUMNS="80")


def is_third_party(finding):
    """A library that calls abort() where an allocation fails; its process ends as if it had been killed."""
    by = finding["trace"][0] if finding["trace"] else ""
    aborted = isinstance(finding["exit"], str) and finding["exit"].startswith("SIG")
    return finding["class"] == "alloc" and finding["problem"] in ("crash", "leftover") and aborted and \
        by.startswith("[") and not by.startswith("[libstdc++")


def work_on(options, inputs_template, tasks, results, number):
    watch = options.work / f"job{number}"
    shutil.rmtree(watch, ignore_errors=True)
    watch.mkdir(parents=True)
    inputs = watch / "in"
    shutil.copytree(inputs_template, inputs, symlinks=True)
    before = snapshot.digest(inputs)
    programs, symbols = {}, {}
    while True:
        try:
            name, columns = tasks.get_nowait()
        except queue.Empty:
            break
        binary = options.bin.with_name("mvstudio-avatar") if commands.CASES[name].needs_torch else options.bin
        if binary not in programs:
            programs[binary] = Program(binary, options.shim, watch, options.work / f"logs{number}-{binary.name}", environment_of(watch / "box"))
            symbols[binary] = Symbols(binary)
        trial = Trial(commands.CASES[name], programs[binary], watch, inputs, options.work / f"spare{number}", options)
        started = time.monotonic()
        failure = ""
        try:
            trial.prepare()
            trial.all(columns, options.per_class, time.monotonic() + options.unit_seconds if options.unit_seconds else None)
        except (RuntimeError, OSError, subprocess.SubprocessError) as error:
            failure = f"{type(error).__name__}: {error}"
            trial.box.clear()
        if snapshot.digest(inputs) != before:
            trial.findings.append({"case": name, "class": "?", "how": "", "n": 0, "problem": "input", "detail": "the inputs have changed",
                                   "what": "", "trace": [], "exit": None})
            shutil.rmtree(inputs)
            shutil.copytree(inputs_template, inputs, symlinks=True)
        for finding in trial.findings:
            finding["trace"] = symbols[binary].names(finding["trace"])
            if is_third_party(finding):
                finding["problem"] = "third-party"
        results.put({"case": name, "columns": columns, "tried": dict(trial.tried), "places": trial.places, "findings": trial.findings,
                     "failure": failure, "seconds": time.monotonic() - started})
    for program in programs.values():
        program.close()


def keep(options, done, names, started):
    if options.json:
        text, total = table(done, names)
        options.json.write_text(json.dumps({"table": text, "total": total, "seconds": time.monotonic() - started, "units": done,
                                            "summary": summary(done)}, indent=1))


def collect(options, inputs, names):
    started = time.monotonic()
    tasks, results = multiprocessing.Queue(), multiprocessing.Queue()
    groups = [sum(GROUPS, [])] if options.seconds else GROUPS  # preparing a command takes longer than a few faults
    units = [(name, [c for c in group if c in options.columns]) for group in groups for name in names]
    units = [(name, columns) for name, columns in units if columns]
    units.sort(key=lambda unit: -commands.CASES[unit[0]].weight)
    options.unit_seconds = options.seconds * options.jobs / max(1, len(units)) if options.seconds else 0
    for unit in units:
        tasks.put(unit)
    time.sleep(0.1)  # the queue's thread must have written them before the others look
    jobs = [multiprocessing.Process(target=work_on, args=(options, inputs, tasks, results, i)) for i in range(options.jobs)]
    for job in jobs:
        job.start()
    done = []
    while len(done) < len(units):
        try:
            done.append(results.get(timeout=5))
        except queue.Empty:
            if not any(job.is_alive() for job in jobs):
                break
            continue
        last = done[-1]
        keep(options, done, names, started)
        print(f"{len(done)}/{len(units)} {last['case']}: {sum(last['tried'].values())} faults, "
              f"{len(last['findings'])} findings, {last['seconds']:.0f} s {last['failure']}", flush=True)
    for job in jobs:
        job.join()
    return done, len(units) - len(done)


def table(done, names):
    """Markdown: a row a command, a column a kind of fault; tried of those there are."""
    tried, places, bad = collections.defaultdict(collections.Counter), collections.defaultdict(dict), collections.Counter()
    for unit in done:
        tried[unit["case"]].update(unit["tried"])
        places[unit["case"]].update(unit["places"])
        bad[unit["case"]] += len({(f["class"], f["how"], f["n"]) for f in unit["findings"] if f["problem"] not in NOTES})
    lines = ["| command | " + " | ".join(COLUMNS) + " | faults | broken promises |", "|---|" + "---|" * (len(COLUMNS) + 2)]
    for name in names:
        cells = []
        for column in COLUMNS:
            n, of = tried[name][column], places[name].get(column, 0)
            cells.append(("" if not n else str(n) + (f"/{of}" if of > n else "")))
        lines.append(f"| {name} | " + " | ".join(cells) + f" | {sum(tried[name].values())} | {bad[name]} |")
    total = sum(sum(t.values()) for t in tried.values())
    lines.append(f"| all | " + " | ".join(str(sum(t[c] for t in tried.values())) for c in COLUMNS) + f" | {total} | {sum(bad.values())} |")
    return "\n".join(lines), total


def summary(done):
    """Findings that come from the same place of the program, as one line each, with the commands that they concern."""
    groups = collections.defaultdict(list)
    for unit in done:
        for f in unit["findings"]:
            groups[(f["problem"], f["class"], " < ".join(f["trace"][:4]), "" if f["trace"] else f["case"])].append(f)
    lines = []
    for (problem, column, trace, _), found in sorted(groups.items()):
        first, cases = found[0], sorted({f["case"] for f in found})
        lines.append(f"{'note' if problem in NOTES else 'BROKEN'} {problem} ({column} {first['how']} n={first['n']}, {len(found)} times): "
                     f"{', '.join(cases[:5])}{f' and {len(cases) - 5} more' if len(cases) > 5 else ''}: {first['detail'][:220]} | "
                     f"{first['what'][:160]} | {trace[:240]}")
    return lines


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    build = pathlib.Path(os.environ.get("MVSTUDIO_BUILD", pathlib.Path(__file__).parents[2] / "build/release"))
    parser.add_argument("--bin", type=pathlib.Path, default=os.environ.get("MVSTUDIO_BIN", build / "bin/mvstudio"))
    parser.add_argument("--shim", type=pathlib.Path, default=build / "tests/libmvstudio_faults.so")
    parser.add_argument("--all", action="store_true", help="every command; the default is the short sample")
    parser.add_argument("--short", action="store_true")
    parser.add_argument("--only", default="", help="commands whose name holds one of these words, with commas")
    parser.add_argument("--classes", default=",".join(COLUMNS))
    parser.add_argument("--per-class", type=int, default=0, help="places at most of each class; 0: 24 with --all, 4 without")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--seconds", type=float, default=0, help="stop after about so long (the preparation comes on top)")
    parser.add_argument("--json", type=pathlib.Path)
    parser.add_argument("--work", type=pathlib.Path, help="folder for everything; a new one in /dev/shm unless given")
    parser.add_argument("--list", action="store_true")
    options = parser.parse_args()
    options.bin, options.shim = pathlib.Path(options.bin).resolve(), pathlib.Path(options.shim).resolve()
    options.columns = options.classes.split(",")
    options.per_class = options.per_class or (24 if options.all else 4)
    return options


def names_of(options):
    words = [w for w in options.only.split(",") if w]
    names = [n for n in commands.CASES if not words or any(w in n for w in words)]
    return [n for n in names if options.all or words or not commands.CASES[n].nightly]


def main():
    options = arguments()
    names = names_of(options)
    if options.list:
        print("\n".join(names))
        return 0
    for needed in (options.bin, options.shim):
        if not needed.is_file():
            print(f"{needed}: not built")
            return 77
    shared = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    made = None if options.work else tempfile.mkdtemp(prefix="mvstudio-faults-", dir=shared)
    options.work = (options.work or pathlib.Path(made)).resolve()
    started = time.monotonic()
    try:
        inputs, missing = commands.make_inputs(options.bin, options.work / "inputs", environment_of(options.work / "make"), names)
        names = [n for n in names if n not in missing]
        before = snapshot.digest(inputs)
        for name, why in missing.items():
            print(f"left out: {name}: {why}")
        done, lost = collect(options, inputs, names)
        if snapshot.digest(inputs) != before:
            print("the inputs that all runs share have changed")
            lost += 1
    finally:
        if made:
            shutil.rmtree(made, ignore_errors=True)
    text, total = table(done, names)
    lines = summary(done)
    failures = [f"{unit['case']}: {unit['failure']}" for unit in done if unit["failure"]]
    broken = sum(line.startswith("BROKEN") for line in lines)
    print("\n".join(["", text, "", *lines, *(f"NOT RUN {f}" for f in failures)]))
    print(f"{total} faults in {time.monotonic() - started:.0f} s, {broken} kinds of broken promises, {len(failures) + lost} units not run")
    keep(options, done, names, started)
    return 1 if broken or failures or lost else 0


if __name__ == "__main__":
    sys.exit(main())
