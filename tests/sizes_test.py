#!/usr/bin/env python3
"""Checks how long files and functions are. Usage: sizes_test.py [PROJECT_ROOT]; prints FILE:LINE: REASON, exits 1 when there is one.

Functions are found by their layout (clang-format): a line without indentation that ends in "{", to the next line "}".
"""

import pathlib
import re
import sys

from modules import sources

MOST_LINES = 400     # of a file
MOST_IN_FUNCTION = 60
NO_FUNCTION = re.compile(r"^(namespace|struct|class|union|enum|extern|using|typedef|#|//|template <[^>]*>\s*(struct|class))")


def functions(lines):
    """Yields (first line, number of lines, head) of what stands at file scope between braces and has parameters."""
    begin = None
    for number, line in enumerate(lines, 1):
        if begin is None and line and not line[0].isspace() and line[0] not in "})" and not NO_FUNCTION.match(line):
            begin = number
        if begin is not None and line.startswith("}"):
            head = " ".join(lines[begin - 1:begin + 6]).split("{")[0]
            if "(" in head and "=" not in head.split("(")[0]:
                yield begin, number - begin + 1, head
            begin = None
        elif begin is not None and line.rstrip().endswith((";", "}")) and not any(x.rstrip().endswith("{") for x in lines[begin - 1:number]):
            begin = None


RAW_STRING = re.compile(r'R"(?P<end>[^()\\\s]*)\(.*?\)(?P=end)"', re.S)


def check(path, text):
    lines = RAW_STRING.sub(lambda raw: "R" + "\n" * raw.group(0).count("\n"), text).splitlines()
    if len(lines) > MOST_LINES:
        yield 1, f"{len(lines)} lines; at most {MOST_LINES}"
    for number, length, head in functions(lines):
        name = re.search(r"([\w:~]+)\(", head)
        if length > MOST_IN_FUNCTION:
            yield number, f"{name.group(1) if name else head} has {length} lines; at most {MOST_IN_FUNCTION}"


def self_test():
    body = "\n".join(["int F(int a) {"] + ["  a += 1;"] * 70 + ["  return a;", "}"])
    assert [r for _, r in check("core/a.cc", body)] == ["F has 73 lines; at most 60"]
    assert not list(check("core/a.cc", "int a = 1;\nstruct S {\n" + "  int b;\n" * 80 + "};\n"))
    assert list(check("core/a.cc", "\n" * 401))


def main():
    self_test()
    root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else pathlib.Path(__file__).parent.parent).resolve()
    files = sources(root)
    found = []
    for path in files:
        name = str(path.relative_to(root))
        found += [f"{name}:{line}: {reason}" for line, reason in check(name, path.read_text(encoding="utf-8"))]
    print("\n".join(found + [f"{len(files)} files, {len(found)} too long"]))
    return 1 if found or not files else 0


if __name__ == "__main__":
    sys.exit(main())
