#!/usr/bin/env python3
"""`mvstudio view` of an MCAP file in Rerun's viewer, without a network. Usage: rerun_page.py PROGRAM

The viewer (https://www.npmjs.com/package/@rerun-io/web-viewer, MIT or Apache-2.0) comes from the npm registry by `npm pack`, pinned by the
digest of its file, once; it stays in the cache of this user. MVSTUDIO_RERUN names its folder instead.
"""
import base64
import hashlib
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tarfile
import tempfile
import time
import zlib

sys.dont_write_bytecode = True
from checks import SKIPPED, Claims, Studio, program_or_skip  # noqa: E402
from devtools import Browser  # noqa: E402
from made_run import DATASET_COLOURS, make_dataset  # noqa: E402

RERUN = "0.33.0"
SHA256 = "d569b0a59bc973c88211d81b9fee405748913e2b610d35011900ff0741bbcad3"
FILES = ("index.js", "re_viewer.js", "re_viewer_bg.wasm")


def package_or_skip(folder):
    """The package's folder; ends with 77 where it cannot be had."""
    if os.environ.get("MVSTUDIO_RERUN"):
        return pathlib.Path(os.environ["MVSTUDIO_RERUN"])
    cache = pathlib.Path(os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache") / "mvstudio-tests"
    packed = cache / f"rerun-{RERUN}.tgz"
    if not packed.is_file() and not fetch(packed):
        print(f"Rerun's viewer is not there: npm pack @rerun-io/web-viewer@{RERUN} gave nothing (no npm, or no network)")
        sys.exit(SKIPPED)
    if hashlib.sha256(packed.read_bytes()).hexdigest() != SHA256:
        sys.exit(f"@rerun-io/web-viewer {RERUN}: {packed} has another digest than {SHA256}")
    with tarfile.open(packed) as archive:
        for name in FILES:
            (folder / name).write_bytes(archive.extractfile("package/" + name).read())
    return folder


def fetch(packed):
    """Whether the registry gave the file."""
    if not shutil.which("npm"):
        return False
    with tempfile.TemporaryDirectory() as folder:
        try:
            subprocess.run(["npm", "pack", "--silent", f"@rerun-io/web-viewer@{RERUN}"], cwd=folder, stdout=subprocess.DEVNULL,
                           stderr=subprocess.DEVNULL, timeout=90, check=False)
        except subprocess.TimeoutExpired:
            return False
        found = pathlib.Path(folder) / f"rerun-io-web-viewer-{RERUN}.tgz"
        if not found.is_file():
            return False
        packed.parent.mkdir(parents=True, exist_ok=True)
        beside = packed.with_suffix(f".{os.getpid()}")
        shutil.copyfile(found, beside)
        os.replace(beside, packed)
    return True


def pixels(png):
    """Rows of an RGB or RGBA image of 8 bits without interlacing (PNG, 9.2: filters)."""
    at, data, width, size = 8, b"", 0, 3
    while at < len(png):
        length, kind = struct.unpack_from(">I4s", png, at)
        if kind == b"IHDR":
            width, _, _, colour = struct.unpack_from(">IIBB", png, at + 8)
            size = 4 if colour == 6 else 3
        elif kind == b"IDAT":
            data += png[at + 8:at + 8 + length]
        at += 12 + length
    raw, above = zlib.decompress(data), bytearray(width * size)
    for begin in range(0, len(raw), width * size + 1):
        kind, row = raw[begin], bytearray(raw[begin + 1:begin + 1 + width * size])
        for i, value in enumerate(row):
            left, up = row[i - size] if i >= size else 0, above[i]
            corner = above[i - size] if i >= size else 0
            guess = left + up - corner
            paeth = min((left, up, corner), key=lambda v: abs(guess - v))
            row[i] = (value + (0, left, up, (left + up) // 2, paeth)[kind]) & 255
        above = row
        yield [tuple(row[i:i + 3]) for i in range(0, len(row), size)]


def missing_colours(page):
    """Of the dataset's images; a hundred pixels count."""
    shot = page.call("Page.captureScreenshot", format="png", clip={"x": 0, "y": 0, "width": 1280, "height": 900, "scale": 0.25})
    counts = {colour: 0 for colour in DATASET_COLOURS}
    for row in pixels(base64.b64decode(shot["data"])):
        for pixel in row:
            for colour in counts:
                counts[colour] += max(abs(a - b) for a, b in zip(pixel, colour)) < 4
    return [colour for colour, count in counts.items() if count < 100]


def main():
    program, claims = program_or_skip(), Claims()
    with Studio(program) as studio:
        package = studio.folder / "web-viewer"
        package.mkdir()
        package = package_or_skip(package)
        studio.mvstudio("dataset", "export", make_dataset(studio.folder / "data"), "--to", "mcap", "--out", studio.folder / "take.mcap")
        process, url = studio.view(studio.folder / "take.mcap", "--rerun", package)
        with Browser() as browser:
            page = browser.page().open(url)
            claims.say(page.wait("document.body.dataset.state === 'ready'", 180), "the viewer starts", page.complaints[:3])
            end = time.monotonic() + 180
            while (missing := missing_colours(page)) and time.monotonic() < end:
                time.sleep(1)
            claims.equal(missing, [], "it draws the images of all cameras")
            told = " ".join(page.complaints)
            claims.say("Failed to import" not in told and "Failed to fetch" not in told, "it reads the file", told[:400])
            asked = page.run("performance.getEntriesByType('resource').map((e) => e.name)")
            claims.say(all(name.startswith((url, "blob:", "data:")) for name in asked), "it asks nobody else", asked)
            page.close()
        claims.equal(process.wait(30), 0, "it ends with its page")
    return claims.end("Rerun's page")


if __name__ == "__main__":
    sys.exit(main())
