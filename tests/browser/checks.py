"""What the tests of pages share: claims that are counted, mvstudio as a program, and pages opened at a size."""
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

HOSTILE = "</script><img src=x onerror=\"window.harm=1\">'\u00fc\u202e"
SKIPPED = 77


class Claims:
    """What was found; a claim that does not hold is printed and the rest goes on."""

    def __init__(self):
        self.num_good = self.num_bad = 0

    def say(self, holds, text, found=""):
        self.num_good += bool(holds)
        self.num_bad += not holds
        if not holds:
            print(f"FAILED: {text}" + (f": {found!r}" if found != "" else ""), flush=True)
        return holds

    def equal(self, found, expected, text):
        return self.say(found == expected, f"{text}: expected {expected!r}", found)

    def shows(self, page, expression, expected, text):
        """Waits for it: what a click or a key does need not be done when the browser has taken it."""
        page.wait(f"({expression}) === {json.dumps(expected)}")
        return self.equal(page.run(expression), expected, text)

    def quiet(self, page, text):
        """No error, no warning, no request that was refused since the last time."""
        self.say(not page.complaints, text + ": the console is quiet", page.complaints[:3])
        page.complaints.clear()

    def fits(self, page, text):
        """Nothing sticks out to the right, even when all is unfolded."""
        page.run("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
        self.say(page.run("document.documentElement.scrollWidth <= innerWidth"), text + ": no overflow to the right", page.run(
            "Array.from(document.querySelectorAll('body *')).filter((e) => e.getBoundingClientRect().right > innerWidth + 1 && "
            "!e.closest('.scroll')).slice(0, 3).map((e) => e.outerHTML.slice(0, 120))"))

    def end(self, name):
        print(f"{name}: {self.num_good} claims hold, {self.num_bad} do not")
        return 1 if self.num_bad else 0


class Studio:
    """The program under test and a folder that goes away."""

    def __init__(self, program):
        self.program = program
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="mvstudio-pages-"))
        self.views = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for view in self.views:
            view.terminate()
            view.wait(20)
        shutil.rmtree(self.folder, ignore_errors=True)

    def mvstudio(self, *arguments):
        done = subprocess.run([self.program, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False)
        if done.returncode != 0:
            sys.exit(f"mvstudio {' '.join(map(str, arguments))}: exit code {done.returncode}: {done.stderr[-800:]}")

    def view(self, path, *more):
        """The process and the address of `mvstudio view`."""
        log = self.folder / f"view{len(self.views)}.txt"
        with log.open("w") as out:
            view = subprocess.Popen([self.program, "view", str(path), *map(str, more), "--json"], stdout=subprocess.DEVNULL, stderr=out)
        self.views.append(view)
        end = time.monotonic() + 30
        while time.monotonic() < end and view.poll() is None:
            found = re.search(r"http://127\.0\.0\.1:\d+/[0-9a-f]+/", log.read_text())
            if found:
                return view, found.group(0)
            time.sleep(0.02)
        sys.exit(f"mvstudio view {path} says no address: {log.read_text()[-800:]}")


def program_or_skip():
    """The program of the command line; ends with 77 where there is no browser."""
    if len(sys.argv) != 2 or not os.access(sys.argv[1], os.X_OK):
        sys.exit(f"usage: {sys.argv[0]} PROGRAM")
    if not shutil.which("chromium"):
        print("needs chromium")
        sys.exit(SKIPPED)
    return sys.argv[1]
