#!/usr/bin/env python3
"""Man pages and completions hold every command and flag of docs/cli.md, and bash completes them. Usage: manual_test.py ROOT."""

import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(sys.argv[1])
COMPLETE = """source {script}
COMP_WORDS=(mvstudio {words})
COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))
_mvstudio 2>/dev/null
echo "${{COMPREPLY[@]}}"
"""


def sections():
    """{words of a command: its part of docs/cli.md}"""
    _, *rest = (ROOT / "docs/cli.md").read_text(encoding="utf-8").split("\n### mvstudio ")
    return {part.split("\n", 1)[0]: part.split("\n", 1)[1] for part in rest}


def flags_of(section):
    return set(re.findall(r"^ {6}(?:-\w,)?(--[a-z0-9-]+)", section, re.M))


def completed(out, *words):
    script = COMPLETE.format(script=out / "bash/mvstudio", words=" ".join(f"'{word}'" for word in words))
    return set(subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True).stdout.split())


def main():
    faults, parts = [], sections()
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder)
        subprocess.run([ROOT / "scripts/manual", out], check=True)
        texts = {shell: (out / shell / name).read_text(encoding="utf-8")
                 for shell, name in (("bash", "mvstudio"), ("zsh", "_mvstudio"), ("fish", "mvstudio.fish"))}
        for words, section in parts.items():
            page = (out / f"man/man1/mvstudio-{words.replace(' ', '-')}.1").read_text(encoding="utf-8").replace("\\-", "-")
            flags = flags_of(section)
            faults += [f"man page of {words} lacks {flag}" for flag in flags if not re.search(rf"^\.B (-\w,)?{flag}\b", page, re.M)]
            line = {shell: next((row for row in text.replace("\n      printf", " printf").splitlines() if f"'{words}'" in row), "")
                    for shell, text in texts.items()}
            faults += [f"{shell} lacks {words} {flag}" for shell, row in line.items() for flag in flags
                       if not re.search(rf"[ ']{flag}[ '\\]", row)]
        if completed(out, "calib", "") != {words.split()[1] for words in parts if words.startswith("calib ")}:
            faults.append("bash: words after calib")
        if not {"--board", "--camera", "--seed"} <= completed(out, "calibrate", "--out", "x", "--"):
            faults.append("bash: flags of calibrate")
        if completed(out, "calibrate", "--out", ""):
            faults.append("bash: a file is completed as a word")
    if len(parts) < 60:
        faults.append(f"{len(parts)} commands in docs/cli.md")
    print("\n".join(faults))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
