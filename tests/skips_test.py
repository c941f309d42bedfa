#!/usr/bin/env python3
"""Each reason for which a test skips itself is one that scripts/skipped.py knows: lacking here, or a package's to install.

Usage: skips_test.py ROOT. Reads what stands behind GTEST_SKIP() or in importorskip(), and what Python tests print before they end
with 77: a reason that neither rule knows would fail on the first machine where the test skips, and on no other.
"""
import pathlib
import re
import sys

REASON = re.compile(r"GTEST_SKIP\(\)\s*<<((?:[^;\"]|\"(?:[^\"\\]|\\.)*\")*);", re.S)
PYTHON = re.compile(r"print\(f?\"([^\"]*)\"(?:, file=sys.stderr)?\)\n\s*(?:sys\.exit\(|return )(?:77|SKIPPED)\b")
OF_PYTEST = re.compile(r"importorskip\(\"[^\"]*\"(?:, reason=\"([^\"]*)\")?\)")
LITERAL = re.compile(r"\"((?:[^\"\\]|\\.)*)\"")


def main():
    root = pathlib.Path(sys.argv[1])
    sys.dont_write_bytecode = True
    sys.path.insert(0, str(root / "scripts"))
    import skipped

    found = []
    for file in sorted((root / "tests").rglob("*")):
        if file.suffix in (".cc", ".h"):
            for text in REASON.findall(file.read_text()):
                literals = LITERAL.findall(text.replace("\\\n", ""))
                if literals or "error.what()" not in text:
                    found.append((file, "".join(literals)))
        elif file.suffix == ".py":
            found += [(file, text) for text in PYTHON.findall(file.read_text()) + OF_PYTEST.findall(file.read_text())]
    unknown = [(file, text) for file, text in found if not (skipped.ELSEWHERE.search(text) or skipped.INSTALLABLE.search(text))]
    for file, text in unknown:
        print(f"{file.relative_to(root)}: skips for '{text}': say what is not there (a recording, a right), or 'needs PACKAGE'")
    assert len(found) > 40, f"only {len(found)} reasons were found: the patterns of this test are stale"
    return 1 if unknown else 0


if __name__ == "__main__":
    sys.exit(main())
