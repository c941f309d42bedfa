#!/usr/bin/env python3
"""File size, opening time and rate of the report's studio against cameras x time steps x people (docs/notes/report-viewer.md).

Usage: rate.py PROGRAM CAMERAS FRAMES PEOPLE [SECONDS]
Makes a take of 25 joints with covariances, its report with images of all cameras, and prints one line of JSON: MB of tables and page;
seconds by the clock from the address to the drawn view; processor seconds of that by process; time steps drawn in a second of playing
(SECONDS, 8, at five times the speed), processor milliseconds of each. Load of the machine before and after stands beside it: the clock
says little beside other jobs. Chromium draws by SwiftShader, 1280 px wide.
"""
import collections
import json
import math
import os
import random
import sys
import time

sys.dont_write_bytecode = True
from checks import Studio, program_or_skip  # noqa: E402
from devtools import Browser  # noqa: E402
from made_run import make_run, png_of_rows, save  # noqa: E402

NUM_JOINTS, NOISE_M, VARIANCE_M2 = 25, 0.003, 1e-5
READY = "document.querySelector('.studio').dataset.state === 'ready' && Number(document.querySelector('.studio').dataset.draws) > 0"
DRAWS = "Number(document.querySelector('.studio').dataset.draws)"


def save_long_take(folder, cameras, frames, people):
    """People who walk in a circle, joints with the noise of a good take."""
    rand = random.Random(1)
    joints = [f"joint{j:02d}" for j in range(NUM_JOINTS)]
    rest = [(rand.uniform(-0.4, 0.4), rand.uniform(-0.2, 0.2), 1.8 * j / NUM_JOINTS) for j in range(NUM_JOINTS)]
    bones = [[joints[j], joints[j + 1]] for j in range(NUM_JOINTS - 1)]
    save(folder / "pose3d.json", {"schema": "mvstudio.pose3d/1", "skeleton": "made", "points": "points.csv", "covariance": "covariance.csv", "unit": "m",
                                  "frame_rate_hz": 25.0, "definition": {"name": "made", "human": True, "joints": joints, "bones": bones}})
    noise = lambda: rand.gauss(0, NOISE_M)
    with (folder / "points.csv").open("w") as points, (folder / "covariance.csv").open("w") as covariances:
        points.write("frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m\n")
        covariances.write("frame,person,joint,xx,xy,xz,yy,yz,zz\n")
        for frame in range(frames):
            for person in range(people):
                turn = 2 * math.pi * (frame / 600 + person / people)
                for joint, (x, y, z) in zip(joints, rest):
                    key, v = f"{frame},{person},{joint}", VARIANCE_M2 * (1 + rand.random())
                    points.write(f"{key},Ok,{x + math.cos(turn) + noise():.6f},{y + math.sin(turn) + noise():.6f},{z + noise():.6f},"
                                 f"{cameras},{abs(rand.gauss(1, 0.3)):.4f},0.004\n")
                    covariances.write(f"{key},{v:.3e},{0.1 * v:.2e},0,{v:.3e},0,{2 * v:.3e}\n")


def make_big_run(folder, cameras, frames, people):
    """Images of 480 px that compress as badly as a photograph's JPEG, two of each camera."""
    make_run(folder, [f"cam_{i + 1:02d}" for i in range(cameras)])
    rand = random.Random(2)
    for i in range(cameras):
        for place in ("calib/board-views", "pose3d/take1/joint-views"):
            rows = b"".join(b"\0" + bytes(v for x in range(160) for v in rand.choices(range(100, 140), k=1) * 3) for _ in range(120))
            save(folder / f"{place}/{i}.png", png_of_rows(160, 120, rows))
    save_long_take(folder / "pose3d/take1", cameras, frames, people)
    return folder


def processor_s(browser):
    used = collections.Counter()
    for process in browser.call("SystemInfo.getProcessInfo")["processInfo"]:
        used[process["type"]] += process["cpuTime"]
    return used


def measure(browser, url, seconds):
    page, before, begun = browser.page(), processor_s(browser), time.monotonic()
    page.open(url)
    page.wait(READY, 120)
    told = {"opens_s": time.monotonic() - begun}
    time.sleep(3)  # what it does afterwards counts, too
    opened = processor_s(browser)
    told["opens_processor_s"] = {kind: opened[kind] - before[kind] for kind in ("renderer", "GPU", "browser")}
    page.run("(() => { const s = document.querySelector('.studio select[aria-label=speed]'); s.value = '5'; s.dispatchEvent(new Event('change')); })()")
    before, begun, first = processor_s(browser), time.monotonic(), page.run(DRAWS)
    page.click_on(".studio .bar button")
    time.sleep(seconds)
    page.click_on(".studio .bar button")
    count, after = page.run(DRAWS) - first, processor_s(browser)
    told["steps_per_s"] = count / (time.monotonic() - begun)
    told["step_processor_ms"] = {kind: 1000 * (after[kind] - before[kind]) / max(count, 1) for kind in ("renderer", "GPU", "browser")}
    return told


def rounded(value):
    return {k: rounded(v) for k, v in value.items()} if isinstance(value, dict) else round(value, 2)


def main():
    numbers, sys.argv = [int(word) for word in sys.argv[2:]], sys.argv[:2]
    if not 3 <= len(numbers) <= 4:
        sys.exit(__doc__)
    cameras, frames, people, *seconds = numbers
    with Studio(program_or_skip()) as studio, Browser() as browser:
        run = make_big_run(studio.folder / "run", cameras, frames, people)
        begun, children = time.monotonic(), os.times()
        studio.mvstudio("report", run)
        now = os.times()
        told = {"cameras": cameras, "frames": frames, "people": people, "load_before": os.getloadavg()[0],
                "tables_mb": sum((run / f"pose3d/take1/{name}.csv").stat().st_size for name in ("points", "covariance")) / 1e6,
                "report_s": time.monotonic() - begun, "report_processor_s": now[2] + now[3] - children[2] - children[3],
                "page_mb": (run / "report.html").stat().st_size / 1e6}
        told.update(measure(browser, (run / "report.html").as_uri(), *seconds or [8]))
        print(json.dumps(rounded({**told, "load_after": os.getloadavg()[0]})))


if __name__ == "__main__":
    sys.exit(main())
