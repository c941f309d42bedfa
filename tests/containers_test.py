#!/usr/bin/env python3
"""The Dockerfile and the recipe of Apptainer: instructions that exist, packages that CPack makes, the same commands in both, which a shell
can read. Usage: containers_test.py ROOT."""

import fnmatch
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(sys.argv[1])
FOLDER = ROOT / "cmake/package"
INSTRUCTIONS = {"FROM", "COPY", "RUN", "ENV", "WORKDIR", "ENTRYPOINT"}
SECTIONS = {"files", "post", "test", "runscript", "help"}


def packages():
    """File names that `cpack -G DEB` gives: DEB-DEFAULT is NAME_VERSION_ARCHITECTURE.deb."""
    text = (ROOT / "cmake/MvstudioPackage.cmake").read_text(encoding="utf-8")
    assert "CPACK_DEBIAN_FILE_NAME DEB-DEFAULT" in text
    return [f"{name}_0.1.0_amd64.deb" for name in re.findall(r"^ *mvstudio_package_set\(\w+ ([\w-]+)", text, re.M)]


def chosen(patterns, faults, where):
    """The packages that patterns choose: one each, and all of them."""
    found = []
    for pattern in patterns:
        fits = [name for name in packages() if fnmatch.fnmatch(name, pattern)]
        faults += [] if len(fits) == 1 else [f"{where}: {pattern} stands for {fits}"]
        found += fits
    return sorted(found)


def commands(text):
    """Shell commands, one each, without what joins them."""
    return [re.sub(r"\s+", " ", part).strip() for part in re.split(r"&&|\n", text.replace("\\\n", " ")) if part.strip()]


def dockerfile(faults):
    rows = [line.split(maxsplit=1) for line in (FOLDER / "Dockerfile").read_text(encoding="utf-8").splitlines()
            if line and not line.startswith("#")]
    faults += [f"Dockerfile: no instruction {word}" for word, _ in rows if word not in INSTRUCTIONS]
    kept = {word: rest for word, rest in rows}
    *patterns, _ = kept["COPY"].split()
    return kept["FROM"], chosen(patterns, faults, "Dockerfile"), commands(kept["RUN"])


def recipe(faults):
    head, *parts = re.split(r"^%(\w+)\n", (FOLDER / "mvstudio.def").read_text(encoding="utf-8"), flags=re.M)
    sections = dict(zip(parts[::2], parts[1::2]))
    faults += [f"mvstudio.def: no section %{name}" for name in sections.keys() - SECTIONS]
    base = re.search(r"^From: (\S+)$", head, re.M).group(1)
    patterns = [pathlib.PurePath(line.split()[0]).name for line in sections["files"].splitlines() if line.strip()]
    return base, chosen(patterns, faults, "mvstudio.def"), commands(sections["post"])


def main():
    faults = []
    docker, apptainer = dockerfile(faults), recipe(faults)
    for what, ours, theirs in zip(("base", "packages", "commands"), docker, apptainer):
        faults += [] if ours == theirs else [f"{what}: the Dockerfile has {ours}, mvstudio.def has {theirs}"]
    if not {"mvstudio_0.1.0_amd64.deb", "mvstudio-avatar_0.1.0_amd64.deb", "python3-mvstudio_0.1.0_amd64.deb"} <= set(docker[1]):
        faults.append(f"packages: {docker[1]}")
    for command in docker[2]:
        read = subprocess.run(["sh", "-n", "-c", command], capture_output=True, text=True, check=False)
        faults += [f"{command}: {read.stderr.strip()}"] if read.returncode else []
    print("\n".join(faults))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
