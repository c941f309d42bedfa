#!/usr/bin/env python3
"""Every format that the sources write is in docs/stability.md, and `version --formats` says the same. Usage: formats_test.py ROOT BIN."""

import json
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(sys.argv[1])
SCHEMA = re.compile(r"mvstudio\.[a-z0-9_-]+/[0-9]+")
FOLDERS = ("core", "geometry", "triangulate", "calib", "dataset", "avatar", "synth", "report", "stages", "cli")


def main():
    page = (ROOT / "docs/stability.md").read_text(encoding="utf-8")
    written = {}
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".cc", ".h") and path.name != "version.cc":
                written.update({name: path for name in re.findall(rf'"({SCHEMA.pattern})"', path.read_text(encoding="utf-8"))})
    faults = [f"{name} ({path.relative_to(ROOT)}) is not in docs/stability.md" for name, path in written.items() if name not in page]
    faults += [f"docs/stability.md: nothing writes {name}" for name in SCHEMA.findall(page) if name not in written]
    said = json.loads(subprocess.run([sys.argv[2], "version", "--formats", "--json"], capture_output=True, check=True).stdout)
    rows = {(row["schema"], row["file"]) for row in said["metrics"]["formats"]}
    listed = set(re.findall(rf"^\| `({SCHEMA.pattern})` \| `([^`]+)`", page, re.M))
    faults += [f"only in one of version --formats and docs/stability.md: {row}" for row in sorted(rows ^ listed)]
    print("\n".join(faults))
    return 1 if faults or len(written) < 20 else 0


if __name__ == "__main__":
    sys.exit(main())
