#!/usr/bin/env python3
"""Calls of the Python module beside the same in C++, timed in turns: processor seconds, which other programs disturb least, median and range.

Usage: /usr/bin/python3 bench/python_beside_cpp.py BENCH_PYTHON_CALLS [--points 10000000] [--rounds 7] [--threads 1,2]
BENCH_PYTHON_CALLS: the program bench_python_calls of the build. Four cameras without a stated covariance; both have the same points, and the
sums of their results must agree. The module is that of MVSTUDIO_PYTHON, else build/release/python.
"""
import argparse
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path[:0] = [os.environ.get("MVSTUDIO_PYTHON", str(ROOT / "build/release/python")), str(ROOT / "tests/python")]
import conftest  # noqa: E402
import mvstudio  # noqa: E402
import numpy as np  # noqa: E402


def part(i, stride):
    return (i * stride + 12345) % 1000003 / 1000003.0


def made_points(n):
    i = np.arange(n)
    return np.stack([part(i, stride) - 0.5 for stride in (7919, 104729, 1299709)], axis=1)


def made_views(rig, points):
    i = np.arange(len(points))
    return np.stack([rig.project(points, c) + np.stack([part(i + c, 15485863), part(i + c, 32452843)], axis=1) - 0.5 for c in range(len(rig))])


class Program:
    """The C++ program, asked line by line."""

    def __init__(self, path):
        self.process = subprocess.Popen([path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def ask(self, *words):
        """(processor seconds, seconds by the clock, sum of the result)"""
        self.process.stdin.write(" ".join(map(str, words)) + "\n")
        self.process.stdin.flush()
        _, clock_s, processor_s = map(float, self.process.stdout.readline().split())
        return processor_s, clock_s, float(self.process.stdout.readline())


def timed(call):
    processor_s, begin = time.process_time(), time.perf_counter()
    value = call()
    return time.process_time() - processor_s, time.perf_counter() - begin, value


def compare(name, ask, call, total, rounds):
    """Both in turns; the first round is not counted."""
    theirs, ours = [], []
    for _ in range(rounds + 1):
        *seconds, expected = ask()
        theirs.append(seconds)
        *seconds, value = timed(call)
        ours.append(seconds)
        found = total(value)
        assert abs(found - expected) <= 1e-9 * abs(expected) + 1e-6, (found, expected)
        del value
    theirs, ours = np.array(theirs[1:]), np.array(ours[1:])
    show = lambda values: f"{statistics.median(values):.3f} ({min(values):.3f} to {max(values):.3f})"  # noqa: E731
    print(f"{name:40s} C++ {show(theirs[:, 0])}, Python {show(ours[:, 0])}, ratio {show(ours[:, 0] / theirs[:, 0])}; by the clock "
          f"{np.median(theirs[:, 1]):.3f} and {np.median(ours[:, 1]):.3f}", flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("program")
    parser.add_argument("--points", type=int, default=10_000_000)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--threads", default="1,2")
    options = parser.parse_args()
    program, rig = Program(options.program), mvstudio.Rig.from_json(conftest.rig_text(covariance=False))
    few = max(options.points // 50, 1)
    points = made_points(options.points)
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/calibration.json"
        rig.write(path)
        for threads in map(int, options.threads.split(",")):
            compare(f"project, {options.points} points, {threads} threads", lambda: program.ask("project", path, options.points, threads),
                    lambda: rig.project(points, 0, threads=threads), np.sum, options.rounds)
        views = made_views(rig, made_points(few))
        for threads in map(int, options.threads.split(",")):
            compare(f"triangulate, {few} points, {threads} threads", lambda: program.ask("triangulate", path, few, threads),
                    lambda: mvstudio.triangulate(views, rig, threads=threads), lambda found: found.x[:, 0].sum(), options.rounds)


if __name__ == "__main__":
    main()
