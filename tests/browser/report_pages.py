#!/usr/bin/env python3
"""The pages of `mvstudio report` in headless Chromium, with its own mouse, keys and touch. Usage: report_pages.py PROGRAM"""
import sys

sys.dont_write_bytecode = True
from checks import HOSTILE, Claims, Studio, program_or_skip  # noqa: E402
from devtools import NO_GL, Browser  # noqa: E402
from made_run import MISSING_FRAME, WORST_FRAME, make_run, make_study  # noqa: E402

READY = "document.querySelector('.studio').dataset.state === 'ready'"
CANVAS = ".stage canvas"
FRAME = "document.querySelector('.studio output').textContent"
PANEL = "document.querySelector('.studio aside').hidden ? '' : document.querySelector('.studio aside').textContent"
PICTURE = """(() => { document.querySelector('.studio').dispatchEvent(new Event('paint'));
  const c = document.querySelector('.stage canvas'), gl = c.getContext('webgl2') || c.getContext('webgl'), b = new Uint8Array(4 * c.width * c.height);
  gl.readPixels(0, 0, c.width, c.height, gl.RGBA, gl.UNSIGNED_BYTE, b);
  let sum = 0; for (let i = 0; i < b.length; ++i) sum = (31 * sum + b[i]) | 0;
  return [new Set(new Uint32Array(b.buffer)).size, sum]; })()"""

MAGENTA = """(() => { document.querySelector('.studio').dispatchEvent(new Event('paint'));
  const c = document.querySelector('.stage canvas'), gl = c.getContext('webgl2') || c.getContext('webgl'), b = new Uint8Array(4 * c.width * c.height);
  gl.readPixels(0, 0, c.width, c.height, gl.RGBA, gl.UNSIGNED_BYTE, b);
  let n = 0; for (let i = 0; i < b.length; i += 4) n += b[i] > 200 && b[i + 1] < 60 && b[i + 2] > 200;
  return n; })()"""
SWITCH = "Array.from(document.querySelectorAll('.studio label')).find((l) => l.textContent.trim() === '%s')"


def state(key):
    """Of the view's state in the address; null: not there."""
    return f"new URLSearchParams(location.hash.slice(1)).get('{key}')"


def open_studio(page, url, claims):
    page.open(url)
    return claims.say(page.wait(READY), "the studio in 3D is there")


def check_view(page, claims):
    """Turns, comes closer, is scrubbed and played."""
    x, y = page.middle(CANVAS)
    colours, before = page.run(PICTURE)
    claims.say(colours > 20, "the studio is drawn", colours)
    page.drag(x, y, 140, 30)
    claims.say(page.wait(f"{state('eye')} !== null && {PICTURE}[1] !== {before}"), "a drag turns the view", page.run(state("eye")))
    eye = page.run(state("eye"))
    page.mouse("mouseWheel", x, y, deltaX=0, deltaY=-240)
    claims.say(page.wait(f"{state('eye')} !== '{eye}'"), "the wheel comes closer once the view was clicked")
    slider = page.run("(() => { const b = document.querySelector('.studio .bar input[type=range]').getBoundingClientRect(); return [b.left, b.width, b.top + b.height / 2]; })()")
    page.click(slider[0] + 0.5 * slider[1], slider[2])
    page.wait(f"/frame 2[34]/.test({FRAME})")
    frame = page.run(FRAME)
    claims.say(frame in ("frame 23", "frame 24"), "a click in the middle of the slider goes to the middle of the take", frame)
    page.key("ArrowRight")
    claims.shows(page, FRAME, "frame " + str(int(frame.split()[1]) + 1), "an arrow key on the slider goes one time step")
    page.click_on(".studio .bar button")
    claims.say(page.wait(FRAME + " !== '" + page.run(FRAME) + "'"), "it plays")
    page.click_on(".studio .bar button")
    claims.shows(page, "document.querySelector('.studio .bar button').textContent", "Play", "it stops")
    box = page.run("(() => { const e = document.querySelector('.timeline'); e.scrollIntoView({block: 'center'}); const b = e.getBoundingClientRect(); return [b.left, b.width, b.top + b.height / 2]; })()")
    page.click(box[0] + (WORST_FRAME + 0.5) / 48 * box[1], box[2])
    claims.shows(page, FRAME, f"frame {WORST_FRAME}", "a click into the strip goes to the worst time step there")


def check_orders(page, claims):
    """Bars of the strip: the worst, the most missing, the held-out frames first."""
    choose = "(() => { const s = document.querySelector('.studio figure select'); s.value = '%s'; s.dispatchEvent(new Event('change')); })()"
    words = "document.querySelector('.timeline').getAttribute('aria-valuetext')"
    count = "Number(document.querySelector('.timeline').getAttribute('aria-valuemax')) + 1"
    for how, frame, num_bars, told in (("worst", WORST_FRAME, 48, "residual 6.5 px"), ("missing", MISSING_FRAME, 1, "14 % missing"),
                                       ("heldout", 42, 3, "held out, SSIM 0.880"), ("all", 0, 48, "frame 0")):
        page.run(choose % how)
        claims.say(page.wait(f"{FRAME} === 'frame {frame}'"), f"{how}: frame {frame} first", page.run(FRAME))
        claims.equal(page.run(count), num_bars, f"{how}: bars")
        claims.say(told in page.run(words), f"{how}: the strip says so", page.run(words))
        claims.shows(page, state("show"), None if how == "all" else how, f"{how} is in the address")
    page.run(choose % "heldout")
    page.run("document.querySelector('.timeline').focus()")
    page.key("ArrowRight")
    claims.say(page.wait(f"{FRAME} === 'frame 41'"), "an arrow key goes to the next bar", page.run(FRAME))
    page.run(choose % "all")


def check_body(page, claims):
    """The fitted body in its colours, without them, behind its Gaussians, and not at all."""
    click = lambda name: page.run(f"({SWITCH % name}).querySelector('input').click()")
    claims.say(page.wait(f"!({SWITCH % 'its colours'}).hidden"), "the body's colours are there")
    page.run("document.querySelector('.stage canvas').focus()")
    page.key("Home")
    drawn = page.run(MAGENTA)
    claims.say(drawn > 300, "the body is drawn in its colours", drawn)
    for name in ("its colours", "fitted body", "Gaussians"):
        click(name)
        claims.shows(page, MAGENTA, 0, f"no colours after a click on '{name}'")
        click(name)
        claims.shows(page, MAGENTA, drawn, f"the colours are back after another on '{name}'")


def check_picks(page, claims):
    """A click on a camera or a joint tells about it."""
    page.click_on(CANVAS)
    page.key("Home")
    for name in ("left", "right"):
        spot = page.run(f"""(() => {{ document.querySelector('.studio').dispatchEvent(new Event('paint'));
          const span = Array.from(document.querySelectorAll('.names span')).find((s) => s.textContent === '{name}'), style = getComputedStyle(span), b = span.getBoundingClientRect();
          return [b.left - parseFloat(style.left), b.top - parseFloat(style.top)]; }})()""")
        page.click(*spot)
        claims.shows(page, state("camera"), name, f"a click on camera {name} is in the address")
        claims.say(page.run(PANEL).startswith(name), f"its panel tells of camera {name}", page.run(PANEL)[:60])
    page.click_on(CANVAS)
    page.key("Escape")
    page.key("ArrowDown")
    claims.shows(page, state("joint"), "0.Head", "the down key chooses a joint")
    claims.say("Head" in page.run(PANEL) and "4" in page.run(PANEL), "its panel tells its cameras and sigma", page.run(PANEL)[:80])


def check_keys(page, claims):
    """All of it without a mouse: Tab gets to every control and out of the view again."""
    page.click_on("h1")
    reached = []
    for _ in range(80):
        page.key("Tab")
        reached.append(page.run("(() => { const e = document.activeElement; return e.closest('.stage') ? 'view' : e.closest('.timeline') ? 'strip' : "
                                "e.closest('.compared + input') ? 'slider' : e.closest('.studio') ? e.tagName + (e.type || '') : e.tagName; })()"))
        if "strip" in reached:
            break
    for what in ("A", "slider", "view", "BUTTONbutton", "INPUTrange", "SELECTselect-one", "INPUTcheckbox", "strip"):
        claims.say(what in reached, f"Tab reaches {what}", reached[-6:])
    page.run("document.querySelector('.stage canvas').focus()")
    page.key("]")
    claims.shows(page, state("camera"), "front", "] chooses the first camera")
    page.key("[")
    claims.shows(page, state("camera"), "right", "[ chooses the one before")
    before = int(page.run(FRAME).split()[1])
    page.key("ArrowRight")
    page.key("ArrowLeft", shift=True)
    claims.shows(page, FRAME, f"frame {max(0, before + 1 - 10)}", "an arrow goes one time step, with Shift ten")


def check_slider(page, claims):
    """The border between truth and render."""
    edge = "document.querySelector('.compared').lastElementChild.style.clipPath"
    x, y = page.middle(".compared + input")
    width = page.run("document.querySelector('.compared + input').clientWidth")
    page.drag(x, y, -0.3 * width, 0)
    claims.say(page.wait(f"!['', 'inset(0px 0px 0px 50%)'].includes({edge})"), "the slider is dragged", page.run(edge))
    dragged = page.run(edge)
    page.key("ArrowRight")
    claims.say(page.wait(f"{edge} !== '{dragged}'"), "and moved by an arrow key", page.run(edge))


def check_links(browser, url, claims):
    """An address opens the page at its place; so do the links of the page."""
    page = browser.page()
    open_studio(page, f"{url}#frame={WORST_FRAME}&camera=back", claims)
    claims.shows(page, FRAME, f"frame {WORST_FRAME}", "the address's frame")
    claims.say("0.8" in page.run(PANEL) and "few places" in page.run(PANEL), "its camera, with what the report says of it", page.run(PANEL)[:160])
    page.click_on(f"header a[href^=\"#frame={MISSING_FRAME}\"]")
    claims.say(page.wait(f"{FRAME} === 'frame {MISSING_FRAME}'"), "a link of the page leads to its frame", page.run(FRAME))
    claims.quiet(page, "links")
    page.close()


def check_length(browser, url, claims):
    """Eight cameras: at most six screens before anything is unfolded, and what is folded is on paper."""
    page = browser.page()
    if open_studio(page, url, claims):
        claims.equal(page.run("document.querySelector('details.drawn').open"), False, "the view in 3D folds the drawn rig")
        height = page.run("document.documentElement.scrollHeight")
        claims.say(height <= 6 * 800, "eight cameras: six screens of 800 px", height)
        page.print()
        claims.shows(page, "document.querySelector('details.drawn').open", True, "the drawn rig is printed")
    page.close()


def check_phone(browser, urls, claims):
    for name, url in urls.items():
        page = browser.page(390, 844, phone=True).open(url)
        if name == "report" and claims.say(page.wait(READY), "the studio on a phone"):
            x, y = page.middle(CANVAS)
            before = page.run(PICTURE)[1]
            page.swipe(x, y, 70, 0)
            claims.say(page.wait(f"{PICTURE}[1] !== {before}"), "a finger turns the view")
        claims.fits(page, f"{name} at 390 px")
        claims.quiet(page, f"{name} at 390 px")
        page.close()


def check_looks(browser, urls, claims):
    """Dark and on paper."""
    ground = "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)"
    ink = "getComputedStyle(document.body).color.match(/\\d+/g).map(Number)"
    for name, url in urls.items():
        page = browser.page(dark=True).open(url)
        claims.say(max(page.run(ground)) < 60 < 180 < min(page.run(ink)), f"{name}: light on dark", page.run(ground))
        claims.fits(page, name + " at 1280 px")
        page.media(dark=True, kind="print")
        claims.say(min(page.run(ground)) == 255 and max(page.run(ink)) < 60, f"{name}: dark on white paper", page.run(ground))
        claims.equal(page.run("getComputedStyle(document.querySelector('nav')).display"), "none", f"{name}: no menu on paper")
        paper = page.print()
        claims.say(paper[:5] == b"%PDF-" and len(paper) > 20_000, f"{name}: prints", len(paper))
        claims.quiet(page, name + ", dark and printed")
        page.close()


def check_hostile(browser, url, num_images, claims):
    page = browser.page()
    if open_studio(page, url, claims):
        page.click_on(CANVAS)
        page.key("]")
        claims.shows(page, "document.querySelector('.studio aside h3').textContent", HOSTILE, "a hostile name is text")
    page.run("document.querySelectorAll('details').forEach((d) => { d.open = true; })")
    claims.equal(page.run("typeof window.harm"), "undefined", "a hostile name runs nothing")
    claims.equal(page.run("document.querySelectorAll('img:not(.studio *)').length"), num_images, "a hostile name makes no element")
    claims.quiet(page, "hostile names")
    page.close()


def check_without_webgl(url, claims):
    with Browser(NO_GL) as browser:
        page = browser.page().open(url)
        claims.say("needs WebGL" in page.run("document.querySelector('.studio').textContent"), "one line says that there is no WebGL")
        claims.say(page.run("document.querySelectorAll('#calibration svg').length") > 3, "the drawn figures are there")
        claims.equal(page.run("document.querySelector('details.drawn').open"), True, "those of the rig are open")
        claims.equal(page.run("document.querySelectorAll('.compared').length"), 3, "the slider is there")
        claims.quiet(page, "without WebGL")


def main():
    claims = Claims()
    with Studio(program_or_skip()) as studio:
        for name, ssim in (("old", 0.9), ("new", 0.93)):
            studio.mvstudio("report", make_run(studio.folder / name, ssim=ssim))
        studio.mvstudio("report", studio.folder / "old", studio.folder / "new")
        studio.mvstudio("report", make_run(studio.folder / "hostile", (HOSTILE, "left", "back", "right")), "--title", HOSTILE)
        studio.mvstudio("report", make_run(studio.folder / "eight", [f"cam_{i + 1:02d}" for i in range(8)]))
        studio.mvstudio("report", *make_study(studio.folder / "study"))
        report, comparison, hostile, study, eight = ((studio.folder / name).as_uri() for name in ("old/report.html", "new/comparison.html", "hostile/report.html", "study/study.html", "eight/report.html"))
        with Browser() as browser:
            page = browser.page()
            if open_studio(page, report, claims):
                for check in (check_slider, check_body, check_view, check_orders, check_picks, check_keys):
                    check(page, claims)
                    claims.quiet(page, check.__name__)
            asked = page.run("performance.getEntriesByType('resource').map((e) => e.name).filter((n) => !/^(data|blob):/.test(n))")
            claims.equal(asked, [], "nothing is loaded")
            num_images = page.run("document.querySelectorAll('img:not(.studio *)').length")
            page.close()
            check_links(browser, report, claims)
            check_length(browser, eight, claims)
            check_phone(browser, {"report": report, "comparison": comparison, "study": study}, claims)
            check_looks(browser, {"report": report, "comparison": comparison}, claims)
            check_hostile(browser, hostile, num_images, claims)
        check_without_webgl(report, claims)
    return claims.end("report pages")


if __name__ == "__main__":
    sys.exit(main())
