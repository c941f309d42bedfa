#!/usr/bin/env python3
"""Checks cmake/unity_groups.py on small files: which of them may be compiled as one.

Usage: unity_groups_test.py [PROJECT_ROOT].
"""

import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
PLAIN = "namespace mvstudio::calib {\nnamespace {\n\n%s\n\n}  // namespace\n}  // namespace mvstudio::calib\n"


def groups(*bodies):
    """Groups of files with these bodies in their anonymous namespaces, as a list of sets of indices."""
    with tempfile.TemporaryDirectory() as folder:
        paths = []
        for index, body in enumerate(bodies):
            paths.append(f"{folder}/{index}.cc")
            pathlib.Path(paths[-1]).write_text(PLAIN % body, encoding="utf-8")
        lines = subprocess.run([sys.executable, ROOT / "cmake/unity_groups.py", "8", *paths], check=True, capture_output=True,
                               text=True).stdout.splitlines()
    found = {}
    for line in lines:
        group, path = line.split()
        found.setdefault(group, set()).add(int(pathlib.Path(path).stem))
    return list(found.values())


class UnityGroups(unittest.TestCase):
    def together(self, *bodies):
        self.assertEqual(groups(*bodies), [set(range(len(bodies)))])

    def apart(self, *bodies):
        self.assertEqual(groups(*bodies), [{index} for index in range(len(bodies))])

    def test_definitions(self):
        self.together("int One() {", "int Two() {")
        self.apart("int One() {", "double One(int x) {")
        self.apart("struct Work {", "enum class Work { kA };")
        self.apart("constexpr int kMost = 3;", "const double kMost = 3;")
        self.apart("template <class T>\nusing Rows = T;", "using Rows = int;")

    def test_using_declarations(self):
        self.together("using geometry::Rig;", "using mvstudio::geometry::Rig;", "using ::mvstudio::geometry::Rig;")
        self.apart("using geometry::Camera;", "using synth::Camera;")
        self.apart("using ::testing::Not;", "using mvstudio::testing::Not;")
        self.apart("using geometry::Rig;", "struct Rig {")
        self.apart("struct Rig {", "using geometry::Rig;")

    def test_a_group_is_full(self):
        self.assertEqual([len(group) for group in groups(*[f"int F{k}() {{" for k in range(11)])], [8, 3])


if __name__ == "__main__":
    if len(sys.argv) > 1:
        ROOT = pathlib.Path(sys.argv.pop(1)).resolve()
    unittest.main()
