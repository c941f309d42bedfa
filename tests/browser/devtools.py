"""A headless Chromium driven through its DevTools protocol over a pipe: with the standard library alone.

Protocol: https://chromedevtools.github.io/devtools-protocol. Mouse, keys and touch are those of the browser, not events that a script
makes, so that focus, default actions and hit tests are the real ones.
"""
import base64
import fcntl
import json
import os
import select
import shutil
import signal
import tempfile
import time

SOFTWARE_GL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
NO_GL = ("--disable-gpu", "--disable-3d-apis")
KEYS = {"ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40, "Home": 36, "End": 35, "Escape": 27, "Enter": 13, "Tab": 9,
        "Backspace": 8}
PATIENCE_S = 60  # with a browser that does not answer


class BrowserError(Exception):
    """The browser refused a call, or a script threw."""


class Browser:
    """One process; ends with close(), or with this program's block."""

    def __init__(self, flags=SOFTWARE_GL):
        self.profile = tempfile.mkdtemp(prefix="mvstudio-browser-")
        ours, theirs = self._pipes()
        self.to_browser, self.from_browser = ours
        words = ["chromium", "--headless", "--no-sandbox", "--remote-debugging-pipe", "--hide-scrollbars", "--no-first-run",
                 "--disable-extensions", "--disable-background-networking", "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
                 f"--user-data-dir={self.profile}", *flags, "about:blank"]
        quiet = [(os.POSIX_SPAWN_OPEN, fd, os.devnull, os.O_WRONLY, 0) for fd in (1, 2)]
        self.process = os.posix_spawn(shutil.which("chromium"), words, os.environ, setpgroup=0, file_actions=[
            (os.POSIX_SPAWN_OPEN, 0, os.devnull, os.O_RDONLY, 0), *quiet, (os.POSIX_SPAWN_DUP2, theirs[0], 3),
            (os.POSIX_SPAWN_DUP2, theirs[1], 4)])
        for fd in theirs:
            os.close(fd)
        self.number, self.rest, self.replies, self.pages = 0, b"", {}, {}

    @staticmethod
    def _pipes():
        """((to, from), (its input, its output)), none of them 3 or 4, which the browser's ends become."""
        read_by_it, to_it = os.pipe()
        from_it, written_by_it = os.pipe()
        high = []
        for fd in (to_it, from_it, read_by_it, written_by_it):
            high.append(fcntl.fcntl(fd, fcntl.F_DUPFD_CLOEXEC, 5))
            os.close(fd)
        return high[:2], high[2:]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        if self.process is None:
            return
        try:
            self.call("Browser.close")
        except (BrowserError, OSError):
            pass
        end = time.monotonic() + 10
        while os.waitpid(self.process, os.WNOHANG)[0] == 0:
            if time.monotonic() > end:
                os.killpg(self.process, signal.SIGKILL)
                os.waitpid(self.process, 0)
                break
            time.sleep(0.05)
        self.process = None
        os.close(self.to_browser)
        os.close(self.from_browser)
        shutil.rmtree(self.profile, ignore_errors=True)

    def call(self, method, session=None, **parameters):
        """The result of one call."""
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if session:
            message["sessionId"] = session
        rest = json.dumps(message).encode() + b"\0"
        while rest:
            rest = rest[os.write(self.to_browser, rest):]
        end = time.monotonic() + PATIENCE_S
        while self.number not in self.replies:
            if not self.listen(end - time.monotonic()):
                raise BrowserError(f"{method}: no answer within {PATIENCE_S} s")
        reply = self.replies.pop(self.number)
        if "error" in reply:
            raise BrowserError(f"{method}: {reply['error']['message']}")
        return reply["result"]

    def listen(self, seconds):
        """Takes in what the browser says; False when it said nothing."""
        if not select.select([self.from_browser], [], [], max(0, seconds))[0]:
            return False
        got = os.read(self.from_browser, 1 << 20)
        if not got:
            raise BrowserError("the browser has ended")
        *whole, self.rest = (self.rest + got).split(b"\0")
        for message in map(json.loads, whole):
            if "id" in message:
                self.replies[message["id"]] = message
            elif message.get("sessionId") in self.pages:
                self.pages[message["sessionId"]].hear(message["method"], message["params"])
        return True

    def page(self, width=1280, height=900, **more):
        return Page(self, width, height, **more)


class Page:
    """A tab of `width` x `height` CSS px. `complaints`: errors and warnings of its scripts, policy and requests."""

    def __init__(self, browser, width, height, dark=False, phone=False):
        self.browser, self.complaints, self.loads = browser, [], 0
        self.target = browser.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = browser.call("Target.attachToTarget", targetId=self.target, flatten=True)["sessionId"]
        browser.pages[self.session] = self
        for domain in ("Page", "Runtime", "Log"):
            self.call(domain + ".enable")
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=phone)
        if phone:
            self.call("Emulation.setTouchEmulationEnabled", enabled=True)
        self.media(dark)

    def call(self, method, **parameters):
        return self.browser.call(method, self.session, **parameters)

    def media(self, dark=False, kind=""):
        self.call("Emulation.setEmulatedMedia", media=kind,
                  features=[{"name": "prefers-color-scheme", "value": "dark" if dark else "light"}])

    def hear(self, method, told):
        if method == "Page.loadEventFired":
            self.loads += 1
        elif method == "Runtime.exceptionThrown":
            details = told["exceptionDetails"]
            self.complaints.append(details.get("exception", {}).get("description", details["text"]))
        elif method == "Runtime.consoleAPICalled" and told["type"] in ("error", "warning", "assert"):
            self.complaints.append(" ".join(str(a.get("value", a.get("description", ""))) for a in told["args"]))
        elif method == "Log.entryAdded" and told["entry"]["level"] in ("error", "warning"):
            self.complaints.append(told["entry"]["text"] + " " + told["entry"].get("url", ""))

    def open(self, url):
        """Waits until the page has loaded; an address that differs in its hash alone loads nothing."""
        before, end = self.loads, time.monotonic() + PATIENCE_S
        answer = self.call("Page.navigate", url=url)
        if answer.get("errorText"):
            raise BrowserError(f"{url}: {answer['errorText']}")
        while self.loads == before:
            if not self.browser.listen(end - time.monotonic()):
                raise BrowserError(f"{url}: not loaded within {PATIENCE_S} s")
        return self

    def run(self, expression):
        """The value of an expression of the page, promises awaited."""
        answer = self.call("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            details = answer["exceptionDetails"]
            raise BrowserError(details.get("exception", {}).get("description", details["text"]))
        return answer["result"].get("value")

    def wait(self, expression, seconds=PATIENCE_S):
        """Whether the expression becomes true in time."""
        end = time.monotonic() + seconds
        while not self.run(expression):
            if time.monotonic() > end:
                return False
            time.sleep(0.03)
        return True

    def middle(self, selector):
        """Of an element that is brought into view, CSS px of the window; `selector`: a JavaScript string's content."""
        found = self.run(f"(() => {{ const e = document.querySelector('{selector}'); if (!e) return null; "
                         "e.scrollIntoView({block: 'center', behavior: 'instant'}); const b = e.getBoundingClientRect(); "
                         "return [b.left + b.width / 2, b.top + b.height / 2]; })()")
        if found is None:
            raise BrowserError(f"no element {selector}")
        return found

    def mouse(self, kind, x, y, **more):
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **more)

    def click(self, x, y):
        self.mouse("mouseMoved", x, y)
        self.mouse("mousePressed", x, y, button="left", buttons=1, clickCount=1)
        self.mouse("mouseReleased", x, y, button="left", clickCount=1)

    def click_on(self, selector):
        self.click(*self.middle(selector))

    def drag(self, x, y, dx, dy, steps=5):
        self.mouse("mouseMoved", x, y)
        self.mouse("mousePressed", x, y, button="left", buttons=1, clickCount=1)
        for i in range(1, steps + 1):
            self.mouse("mouseMoved", x + dx * i / steps, y + dy * i / steps, button="left", buttons=1)
        self.mouse("mouseReleased", x + dx, y + dy, button="left", clickCount=1)

    def swipe(self, x, y, dx, dy, steps=5):
        """One finger."""
        at = lambda i: [{"x": x + dx * i / steps, "y": y + dy * i / steps}]
        self.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=at(0))
        for i in range(1, steps + 1):
            self.call("Input.dispatchTouchEvent", type="touchMove", touchPoints=at(i))
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def key(self, name, shift=False):
        told = {"key": name, "modifiers": 8 if shift else 0, "windowsVirtualKeyCode": KEYS.get(name, ord(name[0]))}
        if name not in KEYS:
            told["text"] = name
        elif name == "Enter":
            told["text"] = "\r"
        self.call("Input.dispatchKeyEvent", type="keyDown", **told)
        self.call("Input.dispatchKeyEvent", type="keyUp", **{k: v for k, v in told.items() if k != "text"})

    def photograph(self, whole=False):
        """PNG of the window, or of the whole page."""
        return base64.b64decode(self.call("Page.captureScreenshot", captureBeyondViewport=whole,
                                          **({"clip": self._all()} if whole else {}))["data"])

    def _all(self):
        size = self.call("Page.getLayoutMetrics")["cssContentSize"]
        return {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}

    def print(self):
        """PDF of the page."""
        return base64.b64decode(self.call("Page.printToPDF")["data"])

    def close(self):
        self.browser.call("Target.closeTarget", targetId=self.target)
        self.browser.pages.pop(self.session, None)
