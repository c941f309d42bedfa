#!/usr/bin/env python3
"""Images that documents name: they exist, have an alt text, are small, and a script makes them (scripts/pictures, growth, notebooks).

Usage: images_test.py ROOT. Prints FILE:LINE: REASON for every finding, exits 1 when there is one.
"""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

IMAGE = re.compile(r"!\[([^\]]*)\]\(([^)\s]+)\)")
MAKERS = ("pictures", "growth")
MAX_BYTES, MAX_ALL_BYTES, MAX_NOTEBOOK_BYTES = 250_000, 1_500_000, 150_000


def findings(root):
    made = "".join(path.read_text(encoding="utf-8") for name in MAKERS if (path := root / "scripts" / name).is_file())
    named = set()
    for page in [*sorted(root.glob("*.md")), *sorted((root / "docs").rglob("*.md"))]:
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
            place = f"{page.relative_to(root)}:{number}"
            if "<img" in re.sub(r"`[^`]*`", "", line):
                yield f"{place}: write ![alt text](path) in place of <img>"
            for alt, target in IMAGE.findall(line):
                path = (page.parent / target).resolve()
                named.add(path)
                if len(alt.split()) < 3:
                    yield f"{place}: {target} has no alt text that says what it shows"
                if not path.is_file():
                    yield f"{place}: no image {target}"
                elif path.stat().st_size > MAX_BYTES:
                    yield f"{place}: {target} has {path.stat().st_size} bytes, more than {MAX_BYTES}"
                if path.parent == root / "docs/notebooks":
                    yield from (f"{place}: {reason}" for reason in of_notebook(root, path))
                elif f'"{path.name}"' not in made:
                    yield f"{place}: neither scripts/pictures nor scripts/growth makes {target}"
    kept = [path.resolve() for path in sorted((root / "docs/img").glob("*"))]
    pictures = [path.resolve() for path in sorted((root / "docs/notebooks").glob("*.png"))]
    yield from (f"{path.relative_to(root)}:1: no document shows it" for path in kept + pictures if path not in named)
    if sum(path.stat().st_size for path in kept) > MAX_ALL_BYTES:
        yield f"docs/img:1: more than {MAX_ALL_BYTES} bytes together"


def of_notebook(root, path):
    """What is wrong with a picture that scripts/notebooks should have made."""
    if not (root / "python/notebooks" / (path.stem.rsplit("-", 1)[0] + ".ipynb")).is_file():
        yield f"no notebook makes {path.name}"
    if path.is_file() and path.stat().st_size > MAX_NOTEBOOK_BYTES:
        yield f"{path.name} has {path.stat().st_size} bytes, more than {MAX_NOTEBOOK_BYTES}"


def check_self():
    """Each kind of trouble is found once, and a sound tree has none."""
    with tempfile.TemporaryDirectory() as name:
        root = pathlib.Path(name).resolve()
        (root / "docs/img").mkdir(parents=True)
        (root / "scripts").mkdir()
        (root / "scripts/pictures").write_text('"a.webp" "big.webp" "gone.webp"')
        (root / "docs/img/a.webp").write_bytes(b"a")
        (root / "README.md").write_text("![one two three](docs/img/a.webp)\n")
        assert not list(findings(root)), list(findings(root))
        for image, size in (("big.webp", MAX_BYTES + 1), ("foreign.webp", 1), ("unused.webp", MAX_ALL_BYTES)):
            (root / "docs/img" / image).write_bytes(b"x" * size)
        (root / "docs/page.md").write_text("![](img/a.webp) ![one two three](img/big.webp)\n![one two three](img/gone.webp)\n"
                                           '![one two three](img/foreign.webp) <img src="img/a.webp">\n')
        (root / "docs/notebooks").mkdir()
        (root / "docs/notebooks/gone.md").write_text("![one two three](gone-1.png)\n")
        (root / "docs/notebooks/gone-1.png").write_bytes(b"x" * (MAX_NOTEBOOK_BYTES + 1))
        (root / "docs/notebooks/gone-2.png").write_bytes(b"x")
        found = "\n".join(findings(root))
        expected = ("no alt text", "more than 250000", "no image img/gone", "makes img/foreign", "in place of <img>",
                    "unused.webp:1: no document", "bytes together", "no notebook makes gone-1.png", "more than 150000",
                    "notebooks/gone-2.png:1: no document")
        assert len(found.splitlines()) == len(expected) and all(text in found for text in expected), found


def check_refusals(root):
    """What is missing is said before any run."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        environment = {"PATH": name, "MVSTUDIO_BIN": "/bin/true", "MVSTUDIO_DATA": f"{name}/data"}
        for expected in ("no program chromium", f"no {name}/data/opencv_stereo/left08.jpg"):
            done = subprocess.run([sys.executable, root / "scripts/pictures", folder / "out"], env=environment, capture_output=True, text=True,
                                  check=False)
            assert done.returncode == 1 and expected in done.stderr and not (folder / "out").exists(), done
            shutil.copy("/bin/true", folder / "chromium")


check_self()
check_refusals(pathlib.Path(sys.argv[1]).resolve())
reasons = list(findings(pathlib.Path(sys.argv[1]).resolve()))
print("\n".join(reasons), end="\n" if reasons else "")
sys.exit(1 if reasons else 0)
