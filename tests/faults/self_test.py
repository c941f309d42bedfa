#!/usr/bin/env python3
"""The harness must catch what it is for: a program with one good command and several bad ones. self_test.py TOY SHIM"""

import collections
import pathlib
import sys
import tempfile

sys.dont_write_bytecode = True
sys.path.insert(0, str(pathlib.Path(__file__).parent))
import commands  # noqa: E402
import run  # noqa: E402

# Kind of command -> what must be found, at least; None: nothing may be found.
EXPECTED = {"good": None, "in-place": {"mixed"}, "silent": {"silent"}, "leaves": {"leftover", "rerun"}, "internal": {"exit", "message"},
            "mute": {"message"}, "aborts": {"crash"}, "loses": {"foreign"}}


def main():
    toy, shim = (pathlib.Path(p).resolve() for p in sys.argv[1:3])
    commands.CASES.clear()
    for kind in EXPECTED:
        commands.CASES[kind] = commands.Case([kind, "out.txt", "new text, longer"], old=[["good", "out.txt", "old"]], name=kind,
                                             foreign={"notes.txt": "mine\n"})
    with tempfile.TemporaryDirectory() as folder:
        sys.argv[1:] = ["--all", "--bin", str(toy), "--shim", str(shim), "--work", folder]
        options = run.arguments()
        options.work = pathlib.Path(folder)
        inputs = options.work / "inputs"
        inputs.mkdir()
        done, lost = run.collect(options, inputs, list(EXPECTED))
    found, tried = collections.defaultdict(set), collections.Counter()
    for unit in done:
        found[unit["case"]] |= {f["problem"] for f in unit["findings"]}
        tried[unit["case"]] += sum(unit["tried"].values())
    wrong = [unit["failure"] for unit in done if unit["failure"]] + ["a process died"] * lost
    wrong += [f"{kind}: {tried[kind]} faults" for kind in EXPECTED if tried[kind] < 20]
    wrong += [f"{kind}: found {sorted(found[kind])}, expected {sorted(expected or [])}" for kind, expected in EXPECTED.items()
              if (expected is None and found[kind]) or not (expected or set()) <= found[kind]]
    print(run.table(done, list(EXPECTED))[0])
    print("\n".join(run.summary(done)) if wrong else "the harness finds what it should")
    print("\n".join(wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
