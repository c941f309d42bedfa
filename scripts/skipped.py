#!/usr/bin/env python3
"""skipped.py TESTS.xml [--strict]: what ctest's JUnit file says was skipped, and why; tests with the same reason on one line.

--strict (.ci/run): ends with 1 where a reason is not a recording, a net's weights or a right that this machine lacks: such a
test needs a line in packages.txt. tests/skips_test.py holds every reason that the tests can give against these two rules.
"""
import collections
import re
import sys
import xml.etree.ElementTree as xml

SKIPPED = re.compile(r"^\S+:\d+: Skipped\n(.*)$", re.M)
OF_PYTEST = re.compile(r"^SKIPPED \[\d+\] \S+: (.*)$", re.M)  # -rs
ELSEWHERE = re.compile(r"is not there|is not in|is missing|no such folder|recording set|models fetch|needs the right|"
                       r"no instructions for|sanitizer|root may list|this build|built without|a build without|MVSTUDIO_READERS|"
                       r"no WebGL|a GPU is here")
INSTALLABLE = re.compile(r"needs (?:/usr/bin/|a )?(?:python3|chromium|blender|the program \w+|Debian's )|not built")


def reasons(path):
    """Reason -> names of the tests that gave it."""
    found = collections.defaultdict(list)
    for case in xml.parse(path).getroot().iter("testcase"):
        output = case.findtext("system-out") or ""
        own = SKIPPED.findall(output)
        if not own and case.get("status") in ("notrun", "disabled"):
            last = [line for line in output.strip().splitlines() if line.strip()]
            own = OF_PYTEST.findall(output) or [last[-1] if last else "skipped without a reason"]
        for reason in dict.fromkeys(own):
            found[reason.strip()].append(case.get("name"))
    return found


def main():
    found = reasons(sys.argv[1])
    unknown = [reason for reason in found if not ELSEWHERE.search(reason)]
    for reason, names in sorted(found.items()):
        print(f"skipped: {reason}: {', '.join(names)}")
    if unknown and "--strict" in sys.argv:
        print("error: tests were skipped for what packages.txt could install: " + "; ".join(unknown), file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
