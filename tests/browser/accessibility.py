#!/usr/bin/env python3
"""axe-core finds no violation on the pages, light and dark, wide and narrow. Usage: accessibility.py PROGRAM

axe-core (https://github.com/dequelabs/axe-core, MPL-2.0) is no Debian package: it comes from the npm registry by `npm pack`, pinned by the
digest of its file, once; it stays in the cache of this user. MVSTUDIO_AXE names a file to take in its place.
"""
import hashlib
import io
import os
import pathlib
import shutil
import subprocess
import sys
import tarfile
import tempfile

sys.dont_write_bytecode = True
from checks import SKIPPED, Claims, Studio, program_or_skip  # noqa: E402
from devtools import Browser  # noqa: E402
from made_run import make_run, make_session, make_study  # noqa: E402

AXE = "4.10.3"
SHA256 = "880970c081707360e64f34cea25ff91892f5bc95675b0776925b9709dd8a68bb"
FOUND = """axe.run(document, {iframes: false, resultTypes: ['violations']}).then((r) => r.violations.map((v) =>
  v.id + ': ' + v.help + ': ' + v.nodes.slice(0, 3).map((n) => n.html.slice(0, 160)).join(' ')))"""


def axe_or_skip():
    """Its script; ends with 77 where it cannot be had."""
    cache = pathlib.Path(os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache") / "mvstudio-tests"
    place = pathlib.Path(os.environ.get("MVSTUDIO_AXE") or cache / f"axe-{AXE}.js")
    script = place.read_bytes() if place.is_file() else fetched()
    if script is None:
        print(f"axe-core is not there: npm pack axe-core@{AXE} gave nothing (no npm, or no network)")
        sys.exit(SKIPPED)
    if hashlib.sha256(script).hexdigest() != SHA256:
        sys.exit(f"axe-core {AXE}: {place} has another digest than {SHA256}")
    if not place.is_file():
        place.parent.mkdir(parents=True, exist_ok=True)
        beside = place.with_suffix(f".{os.getpid()}")
        beside.write_bytes(script)
        os.replace(beside, place)
    return script.decode()


def fetched():
    """What the registry has, or None."""
    if not shutil.which("npm"):
        return None
    with tempfile.TemporaryDirectory() as folder:
        try:
            done = subprocess.run(["npm", "pack", "--silent", f"axe-core@{AXE}"], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                  timeout=40, check=False)
        except subprocess.TimeoutExpired:
            return None
        packed = pathlib.Path(folder) / f"axe-core-{AXE}.tgz"
        if done.returncode != 0 or not packed.is_file():
            return None
        with tarfile.open(fileobj=io.BytesIO(packed.read_bytes())) as archive:
            return archive.extractfile("package/axe.min.js").read()


def examine(browser, axe, name, url, ready, claims):
    for width, phone in ((1280, False), (390, True)):
        for dark in (False, True):
            page = browser.page(width, 900, dark=dark, phone=phone).open(url)
            page.wait(ready)
            page.run("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
            page.run(axe + "; 0")
            text = f"{name}, {width} px, {'dark' if dark else 'light'}"
            claims.equal(page.run(FOUND), [], text)
            page.close()


def check_axe(browser, axe, claims):
    """It finds what is wrong on a page that is."""
    page = browser.page().open("data:text/html,<img src=data:,><button></button>")
    page.run(axe + "; 0")
    found = " ".join(page.run(FOUND))
    claims.say("image-alt" in found and "button-name" in found, "axe-core finds an image without words and a button without a name", found)
    page.close()


def main():
    program, claims = program_or_skip(), Claims()
    axe = axe_or_skip()
    with Studio(program) as studio, Browser() as browser:
        session = make_session(studio.folder / "day1", ("front", "left", "back", "right"))
        other = make_run(studio.folder / "other", ssim=0.93)
        studio.mvstudio("report", session)
        studio.mvstudio("report", session, other)
        check_axe(browser, axe, claims)
        ready = "document.querySelector('.studio').dataset.state === 'ready'"
        examine(browser, axe, "report", (session / "report.html").as_uri(), ready, claims)
        examine(browser, axe, "comparison", (other / "comparison.html").as_uri(), "true", claims)
        studio.mvstudio("report", *make_study(studio.folder / "study"))
        examine(browser, axe, "study", (studio.folder / "study/study.html").as_uri(), "true", claims)
        examine(browser, axe, "view", studio.view(session)[1] + "#frame=5", "document.querySelector('#views').hasAttribute('data-step') && document.querySelectorAll('#views svg').length === 4", claims)
    return claims.end("accessibility")


if __name__ == "__main__":
    sys.exit(main())
