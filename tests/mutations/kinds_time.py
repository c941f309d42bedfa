"""Frames that do not belong together, and pictures that were not taken in an instant."""

import math

import numpy as np

import studio
from kinds_cameras import when_and_who
from recording import Recording, make, make_scene, observe
from registry import kind

FRAMES = [r"CAL-FRAMES", r"same time", r"frames with the same number", r"frame numbers", r"synchron"]
SWAPPED = [r"swap", r"exchanged", r"CAL-MOVED"]
VIDEO = dict(video=True, frames=49)


def someone(rng, scene):
    return int(rng.integers(len(scene.cameras)))


def of_camera(rec, c):
    return sorted(frame for k, frame in rec.corners if k == c)


def retimed(rng, time_of_frame, stride=1, **options):
    """A camera whose frame i shows time_of_frame(i)."""
    scene = make_scene(rng, **{**VIDEO, **options})
    scene.stride = stride
    c = someone(rng, scene)
    corners = observe(rng, scene, time_of=lambda k, i: time_of_frame(i) if k == c else float(i))
    return Recording(scene, corners, culprits=[scene.cameras[c].name])


@kind("frames", FRAMES)
def late_frames(rng):
    """A camera's video begins 1 to 12 frames late."""
    late = int(rng.integers(1, 13))
    return retimed(rng, lambda i: float(i - late))


@kind("frames", FRAMES)
def late_seconds(rng):
    """A camera's video begins 13 to 45 frames late."""
    late = int(rng.integers(13, 46))
    return retimed(rng, lambda i: float(i - late), count=4, frames=97)


@kind("frames", FRAMES)
def late_frames_stills(rng):
    """Photographs of a camera are numbered 1 to 3 too high."""
    late = int(rng.integers(1, 4))
    scene = make_scene(rng, frames=45)
    scene.stride = 1
    c = someone(rng, scene)
    corners = observe(rng, scene, time_of=lambda k, i: float(i - late) if k == c else float(i))
    corners = {key: px for key, px in corners.items() if key[0] != c or key[1] >= late}
    return Recording(scene, corners, culprits=[scene.cameras[c].name])


@kind("frames", FRAMES + [r"time offset", r"late"])
def late_fraction(rng):
    """A camera's frames are taken 0.1 to 0.9 frames late."""
    late = rng.uniform(0.1, 0.9)
    return retimed(rng, lambda i: i - late)


@kind("frames", FRAMES + [r"time offset", r"late"])
def late_frames_and_fraction(rng):
    """2.3 to 5.7 frames late."""
    late = rng.uniform(2.3, 5.7)
    return retimed(rng, lambda i: i - late)


@kind("frames", FRAMES + [r"drift", r"clock"])
def drifting_clock(rng):
    """A camera's clock runs 1 to 3 % fast: one to two frames by the end."""
    rate = rng.uniform(0.01, 0.03) * rng.choice([-1, 1])
    return retimed(rng, lambda i: i * (1 + rate))


CLOCK = FRAMES + [r"drift", r"clock"]


@kind("frames", CLOCK)
def slow_clock(rng):
    """A camera's clock is slower or faster by 0.1 to 0.8 %: less than half a frame by the end of a short video."""
    rate = rng.uniform(0.001, 0.008) * rng.choice([-1, 1])
    return retimed(rng, lambda i: i * (1 + rate))


@kind("frames", CLOCK)
def slow_clock_and_late(rng):
    """The same, and the camera is late by 0.1 to 0.4 frames from the start."""
    rate, late = rng.uniform(0.002, 0.008) * rng.choice([-1, 1]), rng.uniform(0.1, 0.4)
    return retimed(rng, lambda i: i * (1 + rate) - late)


@kind("frames", CLOCK)
def slow_clock_sparse(rng):
    """Every eighth frame of a video was looked at; a camera's clock is off by 0.05 to 0.3 %: up to one frame by the end."""
    rate = rng.uniform(0.004, 0.024) * rng.choice([-1, 1])  # of the 49 pictures; an eighth in frames
    return retimed(rng, lambda i: i * (1 + rate), stride=8)


@kind("frames", CLOCK + [r"frames a second", r"twice", r"half", r"\bratio\b"])
def half_rate(rng):
    """A camera films at half the rate of the others, and its frames are numbered one by one."""
    scene = make_scene(rng, **VIDEO)
    c = someone(rng, scene)
    corners = observe(rng, scene)
    slow = {(c, frame // 2): px for (k, frame), px in corners.items() if k == c and frame % 2 == 0}
    corners = {key: px for key, px in corners.items() if key[0] != c}
    return Recording(scene, {**corners, **slow}, culprits=[scene.cameras[c].name])


@kind("frames", FRAMES + [r"time offset", r"late"])
def late_all(rng):
    """Every camera takes its frames at another fraction of a frame."""
    scene = make_scene(rng, **VIDEO)
    late = rng.uniform(-0.5, 0.5, len(scene.cameras))
    return Recording(scene, observe(rng, scene, time_of=lambda c, i: i - late[c]))


@kind("frames", CLOCK)
def clocks_all(rng):
    """Every camera's clock has a rate of its own, up to 1 % from the others."""
    scene = make_scene(rng, **VIDEO)
    rates = rng.uniform(-0.005, 0.005, len(scene.cameras))
    return Recording(scene, observe(rng, scene, time_of=lambda c, i: i * (1 + rates[c])))


@kind("frames", CLOCK + [r"frames a second", r"\bratio\b", r"as many frames"])
def rate_ratio(rng):
    """A camera films at two thirds, three fifths or three quarters of the others' rate, its frames numbered one by one."""
    ratio = [3 / 2, 5 / 3, 4 / 3][int(rng.integers(3))]
    scene = make_scene(rng, count=4, video=True, frames=97)
    c = someone(rng, scene)
    corners = observe(rng, scene, time_of=lambda k, i: i * ratio if k == c else float(i))
    corners = {key: px for key, px in corners.items() if key[0] != c or key[1] * ratio <= len(scene.poses) - 1}
    return Recording(scene, corners, culprits=[scene.cameras[c].name])


@kind("frames", FRAMES + [r"drop"])
def dropped_frames(rng):
    """A camera's video lacks one to six frames here and there; what follows moves up."""
    lost = sorted(rng.choice(np.arange(6, VIDEO["frames"] - 6), int(rng.integers(1, 7)), replace=False))
    return retimed(rng, lambda i: float(i + sum(x <= i for x in lost)))


@kind("frames", FRAMES + [r"twice", r"duplicate", r"repeated"])
def duplicated_frames(rng):
    """A camera's video holds one to six frames twice; what follows comes later."""
    twice = sorted(rng.choice(np.arange(6, VIDEO["frames"] - 6), int(rng.integers(1, 7)), replace=False))
    return retimed(rng, lambda i: float(i - sum(x <= i for x in twice)))


@kind("frames", FRAMES + [r"shuffl", r"order"])
def shuffled_frames(rng):
    """A camera's frames are in random order."""
    rec = make(rng, **(VIDEO if rng.uniform() < 0.5 else {}))
    c = someone(rng, rec.scene)
    frames = of_camera(rec, c)
    mixed = dict(zip(frames, rng.permutation(frames)))
    return replaced(rec, c, {f: rec.corners[(c, m)] for f, m in mixed.items()})


def replaced(rec, c, views):
    corners = {key: px for key, px in rec.corners.items() if key[0] != c}
    corners.update({(c, int(f)): px for f, px in views.items()})
    return Recording(rec.scene, corners, culprits=[rec.scene.cameras[c].name])


@kind("frames", FRAMES)
def few_frames_misnumbered(rng):
    """Two to five photographs of a camera are exchanged among each other."""
    rec = make(rng)
    c = someone(rng, rec.scene)
    frames = of_camera(rec, c)
    picked = list(rng.choice(frames, int(rng.integers(2, 6)), replace=False))
    views = {f: rec.corners[(c, f)] for f in frames}
    for f, other in zip(picked, picked[1:] + picked[:1]):
        views[f] = rec.corners[(c, other)]
    return replaced(rec, c, views)


def equal_sizes(rng, **options):
    """A recording whose cameras have different lenses, so that an exchange matters, and one image size."""
    scene = make_scene(rng, **options)
    for camera in scene.cameras:
        camera.lens = studio.perspective_lens(rng, camera.size, math.degrees(2 * studio.field_of(camera)) * rng.uniform(0.9, 1.1), 2)
    return scene


@kind("frames", SWAPPED + FRAMES)
def swapped_from(rng):
    """The streams of two cameras are exchanged from an instant on."""
    scene = equal_sizes(rng)
    a, at = when_and_who(rng, scene)
    b = (a + 1 + int(rng.integers(len(scene.cameras) - 1))) % len(scene.cameras)
    swap = {a: b, b: a}
    corners = {}
    for (c, frame), px in observe(rng, scene).items():
        corners[(swap.get(c, c) if frame >= scene.frame(at) else c, frame)] = px
    names = [scene.cameras[a].name, scene.cameras[b].name]
    after = list(scene.cameras)
    after[a], after[b] = after[b], after[a]
    return Recording(scene, corners, truths=[scene.cameras, after], culprits=names)


@kind("frames", clean=True)
def swapped_whole(rng):
    """The files of two cameras carry each other's names; nothing in them says so, and everything but the names is right."""
    scene = equal_sizes(rng)
    a, b = rng.choice(len(scene.cameras), 2, replace=False)
    names = {a: scene.cameras[b].name, b: scene.cameras[a].name}
    return Recording(scene, observe(rng, scene), names=names)


@kind("frames", [r"freez", r"frozen", r"froze", r"identical", r"repeat"] + FRAMES)
def frozen_video(rng):
    """A camera's video freezes: its last picture stands for the rest."""
    rec = make(rng, **VIDEO)
    c, at = when_and_who(rng, rec.scene)
    frames = [f for f in of_camera(rec, c)]
    last = max(f for f in frames if f <= rec.scene.frame(at))
    views = {f: rec.corners[(c, f)] for f in frames if f <= last}
    views.update({f: rec.corners[(c, last)] for f in range(last + 1, len(rec.scene.poses))})
    return replaced(rec, c, views)


@kind("pictures", [r"rolling", r"shutter"])
def rolling_shutter(rng):
    """Every camera reads its image out in a fiftieth to a fifth of a frame while the board moves."""
    scene = make_scene(rng, **VIDEO)
    return Recording(scene, observe(rng, scene, readout=rng.uniform(0.02, 0.2)))


@kind("pictures", [r"rolling", r"shutter"])
def rolling_shutter_one(rng):
    """One camera does."""
    scene = make_scene(rng, **VIDEO)
    c = someone(rng, scene)
    own, readout = observe(rng, scene, readout=rng.uniform(0.02, 0.2)), observe(rng, scene)
    corners = {key: (own if key[0] == c else readout)[key] for key in readout if key in own}
    return Recording(scene, corners, culprits=[scene.cameras[c].name])


@kind("pictures", [r"blur", r"CAL-REJECTED", r"CAL-LOST", r"CAL-GROSS", r"noise"])
def motion_blur(rng):
    """Corners scatter along the motion by a hundredth to a tenth of it."""
    scene = make_scene(rng, **VIDEO)
    return Recording(scene, observe(rng, scene, blur=math.exp(rng.uniform(math.log(0.01), math.log(0.1)))))
