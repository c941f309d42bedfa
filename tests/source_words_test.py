#!/usr/bin/env python3
"""Words of a private vocabulary in the source: source_words_test.py ROOT [--write].

tests/source_words.txt has a row for each word: how often it may occur, the pattern, the word of the field. Identifiers, comments
and texts count; a count may fall and never rise. Ends with 1 where one rose, and names the files with most of it. --write lowers
the numbers to what is there.
"""
import collections
import pathlib
import re
import sys

from modules import sources


def rows(path):
    for line in path.read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            most, pattern, better = line.split(maxsplit=2)
            yield int(most), pattern, better


def main():
    root = pathlib.Path(sys.argv[1])
    baseline = root / "tests/source_words.txt"
    table = list(rows(baseline))
    counts = [collections.Counter() for _ in table]
    for path in sources(root):
        text = path.read_text(encoding="utf-8")
        for (_, pattern, _), count in zip(table, counts):
            count[str(path.relative_to(root))] += len(re.findall(pattern, text))
    risen = [(row, count) for row, count in zip(table, counts) if sum(count.values()) > row[0]]
    for (most, pattern, better), count in risen:
        places = ", ".join(f"{name} ({n})" for name, n in count.most_common(4))
        print(f"'{pattern}' occurs {sum(count.values())} times, {most} were there: write '{better}'; most in {places}")
    if "--write" in sys.argv[2:]:
        head = [line for line in baseline.read_text(encoding="utf-8").splitlines() if line.startswith("#")]
        body = [f"{min(most, sum(c.values()))} {pattern} {better}" for (most, pattern, better), c in zip(table, counts)]
        baseline.write_text("\n".join(head + body) + "\n", encoding="utf-8")
    sys.exit(1 if risen else 0)


main()
