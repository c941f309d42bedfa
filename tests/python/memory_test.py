"""Calls by the thousand leave no memory behind."""
import gc
import pathlib

import conftest
import mvstudio
import numpy as np


def resident_kb():
    """Of this process, now."""
    return int(next(line for line in pathlib.Path("/proc/self/status").read_text().splitlines() if line.startswith("VmRSS")).split()[1])


LEAST_KB = 900  # 10,000 lost results of `project` would be 80 MB and more, 1000 of the others 1 MB


def growth_kb(call, times):
    """After a tenth of the calls, which fill caches, until the end. What is lost is lost every time: a round that grew by the allocator's
    blocks, or by what other threads of the process keep, is done again."""
    for _ in range(times // 10):
        call()
    grown = []
    while len(grown) < 3 and (not grown or min(grown) >= LEAST_KB):
        gc.collect()
        before = resident_kb()
        for _ in range(times):
            call()
        gc.collect()
        grown.append(resident_kb() - before)
    return min(grown)


def test_what_is_lost_is_seen():
    lost = []
    assert growth_kb(lambda: lost.append(bytes(2000)), 1000) >= LEAST_KB


def test_ten_thousand_calls_leave_nothing():
    rig = mvstudio.Rig.from_json(conftest.rig_text())
    points = np.random.default_rng(2).uniform(-0.5, 0.5, (200, 3))
    image, text = points.reshape(20, 30) + 0.5, rig.to_json()
    px = np.stack([rig.project(points[:20], name) for name in rig.names])

    def mistake():
        try:
            rig.project(points, "nobody")
        except mvstudio.Error:
            pass

    calls = {"project": (lambda: rig.project(points, 0, threads=1, jacobians=True), 10000), "unproject": (lambda: rig.unproject(px, 1, threads=1), 10000),
             "a mistake": (mistake, 10000), "a rig": (lambda: mvstudio.Rig.from_json(text), 1000),
             "triangulate": (lambda: mvstudio.triangulate(px, rig, threads=1), 1000), "ssim": (lambda: mvstudio.metrics.ssim(image, image), 1000)}
    grown = {name: growth_kb(call, times) for name, (call, times) in calls.items()}
    assert all(kb < LEAST_KB for kb in grown.values()), grown
    print("growth, kB:", grown)
