#!/usr/bin/env python3
"""No two headers of the product define a type of one name in one namespace. Usage: type_names_test.py ROOT.

The linker takes either definition for both, and says nothing: a program then reads one struct as the other.
"""

import collections
import pathlib
import re
import sys

sys.dont_write_bytecode = True
from modules import sources  # noqa: E402

NAMESPACE = re.compile(r"namespace ([\w:]*)\s*\{")
TYPE = re.compile(r"(?:struct|class|enum class|enum|union) (?:alignas\([^)]*\) )?(\w+)(?: final)?(?: : [^{;]*)? \{")


def types_of(path):
    """(namespace, name) of what is defined at file scope. An unnamed namespace counts as the file's own."""
    spaces = []
    for line in path.read_text(encoding="utf-8").splitlines():
        opened = NAMESPACE.match(line)
        if opened:
            spaces.append(opened.group(1) or str(path))
        elif line.startswith("}") and "// namespace" in line and spaces:
            spaces.pop()
        elif TYPE.match(line):
            yield "::".join(spaces), TYPE.match(line).group(1)


def main():
    where = collections.defaultdict(set)
    for path in sources(sys.argv[1], ".h"):
        for key in types_of(path):
            where[key].add(path)
    faults = [f"{space}::{name} is defined in {', '.join(sorted(map(str, paths)))}" for (space, name), paths in where.items() if len(paths) > 1]
    print("\n".join(faults) if faults else f"{len(where)} types")
    return 1 if faults or len(where) < 500 else 0


if __name__ == "__main__":
    sys.exit(main())
