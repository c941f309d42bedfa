#!/usr/bin/env python3
"""The long checks, see scripts/test. Not to be called by itself: the packages may be missing."""
import json
import os
import pathlib
import subprocess
import sys
import time
import xml.etree.ElementTree

ROOT = pathlib.Path(__file__).resolve().parent.parent
OUT = ROOT / "build/nightly"
RELEASE = ROOT / "build/release"
SKIPPED = 77


def ctest(preset, figures):
    """Builds and tests with a preset; the figures are the tests that ran, those that failed, and the seconds of each."""
    results = OUT / (preset + ".xml")
    results.unlink(missing_ok=True)
    jobs = str(os.cpu_count())
    yield [ROOT / "scripts/build", "ci" if preset == "nightly" else preset]
    yield ["ctest", "--preset", preset, "-j", jobs, "--output-junit", results]
    if results.exists():
        cases = xml.etree.ElementTree.parse(results).getroot().findall("testcase")
        figures["tests"] = {case.get("name"): {"status": case.get("status"), "seconds": float(case.get("time") or 0)} for case in cases}
        figures["ran"] = sum(case.get("status") == "run" for case in cases)
        figures["failed"] = sorted(case.get("name") for case in cases if case.get("status") == "fail")


def tests(figures):
    yield from ctest("nightly", figures)


def asan(figures):
    yield from ctest("asan-ubsan", figures)


def tsan(figures):
    yield from ctest("tsan", figures)


def faults(figures):
    yield [ROOT / "scripts/build", "ci", "mvstudio", "mvstudio_faults"]
    own = OUT / "faults-run.json"
    own.unlink(missing_ok=True)
    yield [sys.executable, ROOT / "tests/faults/run.py", "--all", "--bin", RELEASE / "bin/mvstudio", "--shim",
           RELEASE / "tests/libmvstudio_faults.so", "--json", own]
    if own.exists():
        figures["run"] = json.loads(own.read_text())


def fuzz(figures):
    yield [ROOT / "scripts/build", "ci"]
    yield [ROOT / "scripts/fuzz", "--minutes", os.environ.get("MVSTUDIO_FUZZ_MINUTES", "60")]
    own = ROOT / "build/fuzz/figures.json"
    if own.exists():
        figures["targets"] = json.loads(own.read_text())
        figures["executions"] = sum(target["executions"] for target in figures["targets"].values())


def packages(figures):
    yield [ROOT / "scripts/package", "ci"]
    yield [ROOT / "scripts/try-packages"]
    figures["bytes"] = {path.name: path.stat().st_size for path in sorted((RELEASE / "packages").glob("*.deb"))}


def clone(_figures):
    yield [ROOT / "scripts/try-clone"]


STEPS = {step.__name__: step for step in (tests, faults, fuzz, asan, tsan, packages, clone)}


def run(name):
    """One step to its end; a command that fails does not keep the figures from being read."""
    figures = {"step": name, "began": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())}
    begin, exit_code = time.monotonic(), 0
    with open(OUT / (name + ".log"), "w", encoding="utf-8") as log:
        for command in STEPS[name](figures):
            if exit_code == 0:
                exit_code = subprocess.run([str(word) for word in command], cwd=ROOT, stdout=log, stderr=subprocess.STDOUT).returncode
    status = "ok" if exit_code == 0 else "skipped" if exit_code == SKIPPED else "failed"
    figures.update(status=status, exit=exit_code, seconds=round(time.monotonic() - begin))
    (OUT / (name + ".json")).write_text(json.dumps(figures, indent=1) + "\n")
    return figures


def main():
    unknown = [word for word in sys.argv[1:] if word not in STEPS]
    if unknown:
        sys.exit(f"scripts/test nightly: no step is called {unknown[0]}; there are {', '.join(STEPS)}")
    OUT.mkdir(parents=True, exist_ok=True)
    done = []
    for name in sys.argv[1:] or STEPS:
        print(f"{name}: output goes to build/nightly/{name}.log", flush=True)
        done.append(run(name))
    for figures in done:
        more = f", {figures['ran']} tests, failed: {' '.join(figures['failed']) or 'none'}" if "ran" in figures else ""
        more += f", {figures['executions']} executions so far" if "executions" in figures else ""
        print(f"{figures['step']:8} {figures['status']:8} {figures['seconds']:6} s{more}")
    sys.exit(any(figures["status"] == "failed" for figures in done))


main()
