#!/usr/bin/env python3
"""The page of `mvstudio view` in headless Chromium, and what strangers see of its server. Usage: view_page.py PROGRAM"""
import http.client
import http.server
import sys
import threading
import urllib.parse

sys.dont_write_bytecode = True
from checks import Claims, Studio, program_or_skip  # noqa: E402
from devtools import Browser  # noqa: E402
from made_run import FRAMES, MASK_BOX, MISSING_FRAME, WORST_FRAME, make_session  # noqa: E402

HOSTILE_NAME = "<u>left & 'old'"  # sessions refuse names with = or /
NAMES = ("front", HOSTILE_NAME, "back", "right")
WHERE = "document.querySelector('#where').textContent"
SHOWN = "Array.from(document.querySelectorAll('#views figcaption'), (f) => f.textContent)"
IMAGES = "Array.from(document.querySelectorAll('#views img'), (i) => i.naturalWidth)"


SETTLED = "document.querySelector('#views').hasAttribute('data-step')"


def is_at(step):
    """Whether the images and marks of a time step are all shown."""
    return (f"document.querySelector('#views').getAttribute('data-step') === '{step}' && {WHERE}.startsWith('time step {step},') && "
            f"{SHOWN}.some((text) => /frame {step}(,|$)/.test(text))")


def check_frames(page, url, claims):
    page.open(f"{url}#frame=5")
    claims.say(page.wait(is_at(5)), "the address's frame", page.run(WHERE))
    claims.say(page.wait(f"{IMAGES}.length === 4 && {IMAGES}.every((w) => w === 640)"), "all cameras side by side", page.run(IMAGES))
    claims.equal(page.run("document.querySelectorAll('#views svg .bone').length"), 4, "with the 3D joints over them")
    for key, shift, expected in (("ArrowRight", False, 6), ("ArrowRight", True, 16), ("ArrowLeft", False, 15), ("End", False, FRAMES - 1), ("Home", False, 0)):
        page.key(key, shift)
        claims.say(page.wait(is_at(expected)), f"{key} goes to time step {expected}", page.run(WHERE))
    box = page.run("(() => { const b = document.querySelector('#time').getBoundingClientRect(); return [b.left, b.width, b.top + b.height / 2]; })()")
    page.click(box[0] + (WORST_FRAME + 0.5) / FRAMES * box[1], box[2])
    claims.say(page.wait(is_at(WORST_FRAME)), "a click into the error over time goes there", page.run(WHERE))
    claims.say("6.5 px" in page.run(WHERE), "which says its error", page.run(WHERE))
    page.click_on("#strip button:not([aria-current])")
    claims.say(page.wait(f"{SETTLED} && !{WHERE}.startsWith('time step {WORST_FRAME},')"), "a thumbnail leads to its frame", page.run(WHERE))
    page.click_on("#play")
    here = page.run(WHERE)
    claims.say(page.wait(f"{WHERE} !== {here!r}"), "it plays")
    page.click_on("#play")


def check_cameras_and_filters(page, claims):
    page.click_on("#views figure:nth-child(3) div")
    claims.say(page.wait(f"{SETTLED} && {SHOWN}.length === 1") and page.run("location.hash.includes('camera=back')"), "a click shows that camera alone", page.run(SHOWN))
    page.key("Escape")
    claims.say(page.wait(f"{SETTLED} && {SHOWN}.length === 4"), "Escape all of them")
    choose = "(() => { const s = document.querySelector('#filter'); s.value = '%s'; s.dispatchEvent(new Event('change')); })()"
    for how, step in (("worst", WORST_FRAME), ("missing", MISSING_FRAME)):
        page.run(choose % how)
        claims.say(page.wait(is_at(step)) and page.run(f"location.hash.includes('show={how}')"), f"{how} first: time step {step}", page.run(WHERE))
    claims.equal(page.run("document.querySelectorAll('u').length"), 0, "a hostile name makes no element")
    claims.say(any(text.startswith(HOSTILE_NAME) for text in page.run(SHOWN)), "a hostile name is text", page.run(SHOWN))


def check_marks(page, claims):
    """Outlines of masks and of the fitted body over the images, and images that were held out."""
    page.run("location.hash = '#frame=5'")
    count = lambda mark: f"document.querySelectorAll('#views svg .{mark}').length"
    claims.say(page.wait(f"{is_at(5)} && {count('mask')} === 1 && {count('body')} === 4"), "a mask of the first camera, the body in all",
               [page.run(count(mark)) for mark in ("mask", "body")])
    box = page.run("(() => { const b = document.querySelector('#views svg .mask').getBBox(); return [b.x, b.y, b.x + b.width, b.y + b.height]; })()")
    claims.equal(box, list(MASK_BOX), "the outline goes around the mask's pixels")
    for box_id, mark in (("masks", "mask"), ("body", "body")):
        page.click_on(f"#{box_id}")
        claims.say(page.wait(f"{SETTLED} && {count(mark)} === 0"), f"a click hides the {mark}", page.run(count(mark)))
        page.click_on(f"#{box_id}")
        claims.say(page.wait(f"{SETTLED} && {count(mark)} > 0"), f"another shows the {mark}", page.run(count(mark)))
    check_avatar(page, claims)
    page.run("(() => { const s = document.querySelector('#filter'); s.value = 'heldout'; s.dispatchEvent(new Event('change')); })()")
    claims.say(page.wait(is_at(42)) and page.run("location.hash.includes('show=heldout')"), "held out, the worst first", page.run(WHERE))
    claims.say(page.run(f"{SHOWN}.filter((text) => text.includes('held out, SSIM 0.880')).length") == 1, "its camera says so", page.run(SHOWN))
    claims.equal(page.run("Array.from(document.querySelectorAll('#views figure > img'), (i) => i.naturalWidth)"), [4 * 48 + 6], "with truth, render and error")
    page.key("End")
    claims.say(page.wait(is_at(40)), "the best last", page.run(WHERE))


def check_avatar(page, claims):
    """The fitted body in its colours, magenta all over, over the images and beside them."""
    choose = "(() => { const s = document.querySelector('#avatar'); s.value = '%s'; s.dispatchEvent(new Event('change')); })()"
    shown = "Array.from(document.querySelectorAll('#views img.avatar'))"
    magenta = f"""{shown}.map((img) => {{ const c = document.createElement('canvas'), g = c.getContext('2d'); c.width = img.naturalWidth;
      c.height = img.naturalHeight; g.drawImage(img, 0, 0); const d = g.getImageData(0, 0, c.width, c.height).data; let n = 0;
      for (let i = 0; i < d.length; i += 4) n += d[i] > 200 && d[i + 1] < 60 && d[i + 2] > 200 && d[i + 3] === 255; return n; }})"""
    for how, place in (("over", "figure:not(.two) > div > img.avatar"), ("beside", "figure.two > div + div > img.avatar")):
        page.run(choose % how)
        claims.say(page.wait(f"{SETTLED} && document.querySelectorAll('#views {place}').length === 4"), f"the avatar {how}", page.run(f"{shown}.length"))
        claims.say(min(page.run(magenta), default=0) > 300, f"in its colours, {how}", page.run(magenta))
    page.run(choose % "over")
    page.run("(() => { const o = document.querySelector('#opacity'); o.value = 50; o.dispatchEvent(new Event('input')); })()")
    claims.say(page.wait(f"{SETTLED} && {shown}.length === 4 && {shown}.every((i) => i.style.opacity === '0.5')"), "half of it")
    page.run(choose % "")
    claims.say(page.wait(f"{SETTLED} && {shown}.length === 0"), "no avatar again")


def check_report(page, claims):
    page.click_on("#tab-report")
    claims.say(page.wait("!document.querySelector('#report').hidden"), "the report is a side of it")
    page.click_on("#tab-frames")
    claims.say(page.wait("!document.querySelector('#frames').hidden"), "the frames are the other")


def ask(url, path, host=None, **headers):
    """Status and body of a request to the server of `url` as a program makes it."""
    place = urllib.parse.urlsplit(url)
    connection = http.client.HTTPConnection(place.hostname, place.port, timeout=10)
    connection.putrequest("GET", path, skip_host=True)
    connection.putheader("Host", host or place.netloc)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, body


def check_strangers(url, secret, claims):
    base = urllib.parse.urlsplit(url).path
    claims.equal(ask(url, base)[0], 200, "with token, host and no origin it answers")
    refused = {"no token": ("/", {}), "another token": ("/" + "0" * 32 + "/", {}), "another host": (base, {"host": "evil.example"}),
               "localhost by name": (base, {"host": f"localhost:{urllib.parse.urlsplit(url).port}"}), "another origin": (base, {"Origin": "http://evil.example"}),
               "no origin": (base, {"Origin": "null"}), "..": (base + "../" + secret, {}), "..%2f": (base + "image/..%2f..%2f" + secret, {}),
               "%2e%2e": (base + "%2e%2e/" + secret, {}), "a file": (base + secret, {}), "a path": (base + "/etc/hostname", {})}
    for text, (path, more) in refused.items():
        status, body = ask(url, path, **more)
        claims.say(status in (403, 404) and b"secret" not in body and len(body) < 100, f"refused: {text}", (status, body[:80]))


class OtherSite(http.server.BaseHTTPRequestHandler):
    """A page of another origin on this machine."""

    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html><title>other</title><link rel=icon href=data:,>")

    def log_message(self, *_):
        pass


def check_other_origin(browser, url, claims):
    """A page that even knows the token can read nothing of it, nor show it."""
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), OtherSite)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    page = browser.page().open(f"http://127.0.0.1:{server.server_port}/")
    tried = page.run(f"""(async () => {{
      const url = {url!r}, said = {{}};
      const fetched = async (name, options) => {{ try {{ const r = await fetch(url + name, options); said['fetch ' + name + (options ? options.mode : '')] = r.type === 'opaque' ? 'opaque' : await r.text(); }} catch (e) {{ said['fetch ' + name + (options ? options.mode : '')] = 'refused'; }} }};
      await fetched(''); await fetched('scene.json'); await fetched('scene.json', {{mode: 'no-cors'}}); await fetched('bye', {{method: 'POST', mode: 'no-cors'}});
      for (const [tag, name] of [['img', 'image/0/0.jpg'], ['script', 'view.js']]) {{
        said[tag] = await new Promise((done) => {{ const e = document.createElement(tag); e.onload = () => done('loaded'); e.onerror = () => done('refused'); e.src = url + name; document.body.append(e); }});
      }}
      const frame = document.createElement('iframe');
      frame.src = url;
      document.body.append(frame);
      await new Promise((done) => {{ frame.onload = done; setTimeout(done, 3000); }});
      try {{ said.iframe = frame.contentWindow.document ? 'read' : 'refused'; }} catch (e) {{ said.iframe = 'refused'; }}
      return said;
    }})()""")
    claims.equal(set(tried.values()), {"refused"}, f"another origin reads nothing: {tried}")
    page.close()
    server.shutdown()


def main():
    claims = Claims()
    with Studio(program_or_skip()) as studio:
        session = make_session(studio.folder / "day1", NAMES)
        (session / "secret.txt").write_text("secret")
        process, url = studio.view(session)
        check_strangers(url, "secret.txt", claims)
        with Browser() as browser:
            check_other_origin(browser, url, claims)
            page = browser.page()
            check_frames(page, url, claims)
            check_cameras_and_filters(page, claims)
            check_marks(page, claims)
            check_report(page, claims)
            claims.quiet(page, "view")
            phone = browser.page(390, 844, phone=True).open(f"{url}#frame=5")
            claims.say(phone.wait(is_at(5)), "the page on a phone", phone.run(WHERE))
            claims.fits(phone, "view at 390 px")
            claims.quiet(phone, "view at 390 px")
            page.close()
            phone.close()
        claims.equal(process.wait(30), 0, "it ends with its page")
    return claims.end("view's page")


if __name__ == "__main__":
    sys.exit(main())
