#!/usr/bin/env python3
"""Command lines that texts of the program name must be ones that it knows.

Usage: hints_test.py ROOT. Reads the string literals of all sources below ROOT. After `mvstudio` there must be a command of
docs/cli.md (scripts/cli-docs makes it from the program) where it is quoted or asked for, and the flags that follow it in the same clause, `--frames` or
option 'frames', must be flags of that command.
"""
import pathlib
import re
import sys

from modules import sources

LITERAL = re.compile(r'"((?:[^"\\\n]|\\.)*)"')
ADJACENT = re.compile(r'"\s*(?:\n\s*)?"')
COMMAND = re.compile(r"\bmvstudio ((?:[a-z][a-z0-9-]*)(?: [a-z][a-z0-9-]*)*)([^;:,()`\n]*)")
FLAG = re.compile(r"(?:(?<![\w-])--([a-z][a-z0-9-]*)|\boption '([a-z0-9][a-z0-9-]*)')")


def commands(page):
    """Name -> flags, from the sections of docs/cli.md."""
    flags, name = {}, None
    for line in page.splitlines():
        heading = re.match(r"#+ (?:`?mvstudio )?`?([a-z0-9 -]+?)`?$", line)
        if heading:
            name = heading.group(1).replace("mvstudio ", "")
            flags.setdefault(name, set())
        elif name is not None:
            flags[name].update(re.findall(r"(?<![\w-])--(?:no-)?([a-z][a-z0-9-]*)", line[:60]))
            flags[name].update(re.findall(r"(?<![\w-])--([a-z][a-z0-9-]*)", line[:60]))
    return flags


def texts(source):
    """Literals, those that the compiler joins as one, with their lines."""
    joined = ADJACENT.sub(lambda gap: "\x00" * gap.group(0).count("\n"), source)
    line = 1
    position = 0
    for literal in LITERAL.finditer(joined):
        between = joined[position : literal.start()]
        line += between.count("\n") + between.count("\x00")
        position = literal.start()
        yield line, literal.group(1).replace("\x00", "")


def faults(text, known):
    groups = {" ".join(name.split()[:k]) for name in known for k in range(1, 3)}
    for found in COMMAND.finditer(text):
        words = found.group(1).split()
        name = next((" ".join(words[:k]) for k in (3, 2, 1) if " ".join(words[:k]) in groups | set(known)), "")
        asked = bool(name) or found.start() > 0 and text[: found.start()].endswith(("`", "run ", "use ", "see "))
        if name not in known and asked and len(words) > len(name.split()):
            yield f"`mvstudio {' '.join(words[: len(name.split()) + 1])}` is no command"
        if name not in known:
            continue
        for long, option in FLAG.findall(found.group(2)):
            if (long or option) not in known[name] | GLOBAL:
                yield f"`mvstudio {name}` has no --{long or option}"


GLOBAL = {"json", "threads", "seed", "log-level", "progress", "redact", "help"}


def main():
    root = pathlib.Path(sys.argv[1])
    known = commands((root / "docs/cli.md").read_text(encoding="utf-8"))
    assert len(known) > 40, "docs/cli.md lists the commands"
    assert list(faults("run mvstudio calib resise", known)) and list(faults("mvstudio calib resize x --nosuch 3", known))
    count = 0
    for path in sources(root, ".cc"):
        for line, text in texts(path.read_text(encoding="utf-8")):
            for fault in faults(text, known):
                print(f"{path.relative_to(root)}:{line}: {fault}")
                count += 1
    sys.exit(1 if count else 0)


main()
