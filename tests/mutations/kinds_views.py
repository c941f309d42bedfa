"""Too few boards, too much alike, or not linked."""

import functools
import math

import numpy as np

import rigid
import studio
from kinds_time import of_camera
from recording import Recording, make, make_scene, observe, without
from registry import kind, kinds

FEW = [r"CAL-FEWVIEWS", r"CAL-NOHOLDOUT", r"CAL-ASSUMED", r"CAL-UNCERTAIN", r"CAL-FOCAL", r"CAL-VOLUME", r"boards only", r"only \d+ boards",
       r"too few", r"\d+ boards? do(es)? not", r"more boards", r"boards do not determine", r"never sees? the board", r"share no board"]
LINK = [r"share no board", r"groups", r"\blink"]


kinds("few boards", FEW, {f"few_{boards:02d}": (f"{boards} boards.", functools.partial(make, frames=boards, count=4))
                           for boards in (3, 4, 6, 8, 10, 12, 14)})


@kind("few boards", FEW + [r"tilt", r"parallel"])
def all_parallel(rng):
    """Every board is parallel to the images of cameras that look the same way."""
    scene = make_scene(rng, layout="wall")
    for camera in scene.cameras:
        eye = camera.centre()
        rotation = scene.cameras[0].cam_from_world[0]
        camera.cam_from_world = (rotation, -rotation @ eye)
    scene.poses = parallel_boards(rng, scene)
    scene.partial = True
    return Recording(scene, observe(rng, scene))


def parallel_boards(rng, scene):
    """Boards that face the cameras squarely, in places that two of them see."""
    rotation = rigid.inverse(scene.cameras[0].cam_from_world)[0]
    poses = []
    while len(poses) < 45:
        target = int(rng.integers(len(scene.cameras)))
        middle = studio.aim(rng, scene.cameras, scene.board, target, (1.2, 4.0))[1]
        turned = rotation @ rigid.exp(np.array([0, 0, rng.normal(0, 0.2)]))
        pose = turned, middle - turned @ scene.board.middle()
        if sum(studio.num_seen(scene.cameras, scene.board, pose, True)) >= 2:
            poses.append(pose)
    return poses


@kind("few boards", FEW + [r"places?\b", r"one place"])
def one_place(rng):
    """Every picture shows the board in one place, up to a millimetre."""
    scene = make_scene(rng)
    best = max(scene.poses, key=lambda p: sum(studio.num_seen(scene.cameras, scene.board, p, scene.partial)))
    scene.poses = [(best[0], best[1] + rng.normal(0, 0.0005, 3)) for _ in scene.poses]
    return Recording(scene, observe(rng, scene))


def held(rng, places, each, noise=0.0, **options):
    """A board held still in `places` places for `each` instants; `noise` px of its errors are the same in all pictures of a place."""
    scene = make_scene(rng, frames=places, **options)
    scene.poses = [pose for pose in scene.poses for _ in range(each)]
    scene.stride = 1
    n = scene.board.cols * scene.board.rows
    common = rng.normal(0, noise, (len(scene.cameras), places, n, 2))
    return Recording(scene, observe(rng, scene, shared_noise=lambda c, i: common[c, i // each]))


kinds("held still", (), {
    "held_still": ("The board is held still in 16 to 24 places, for 4 frames in each.",
        lambda rng: held(rng, int(rng.integers(14, 19)), 4)),
    "held_still_alike": ("The same; most of a corner's error is the same in all pictures of a place.",
        lambda rng: held(rng, int(rng.integers(14, 19)), 4, noise=0.4, sigma=0.1)),
    "held_still_long": ("In 12 places, for 10 frames in each, with equal errors.",
        lambda rng: held(rng, 12, 8, noise=0.3, sigma=0.15, count=4)),
    "held_still_frozen": ("The pictures of a place are the same picture: their errors are equal.",
        lambda rng: held(rng, int(rng.integers(14, 19)), 4, noise=0.3, sigma=1e-4)),
}, clean=True, statistics=True)


# ---- links -----------------------------------------------------------------------------------------------------------------------

@kind("links", LINK, simpler=())
def disconnected(rng):
    """Two groups of cameras that never see the board together."""
    rec = make(rng, count=4, frames=56)
    half = {0: 0, 1: 0, 2: 1, 3: 1}
    frames = sorted({f for _, f in rec.corners})
    group = {f: int(i % 2) for i, f in enumerate(frames)}
    return Recording(rec.scene, without(rec.corners, lambda c, f: half[c] == group[f]))


@kind("links", LINK + FEW)
def hanging_by_a_thread(rng):
    """Two groups of cameras that see the board together once."""
    rec = make(rng, count=4, frames=56)
    frames = sorted({f for _, f in rec.corners})
    both = next(f for f in frames if {c for c, g in rec.corners if g == f} & {0, 1} and {c for c, g in rec.corners if g == f} & {2, 3})
    group = {f: int(i % 2) for i, f in enumerate(frames)}
    return Recording(rec.scene, without(rec.corners, lambda c, f: f == both or (c >= 2) == group[f]))


@kind("links", FEW + [r"\bno corner", r"no camera"], simpler=())
def camera_without_corners(rng):
    """A camera is listed whose pictures show no board."""
    rec = make(rng, count=4)
    c = int(rng.integers(1, 4))
    corners = without(rec.corners, lambda k, f: k != c)
    style = str(rng.choice(["vnl", "csv"]))
    return Recording(rec.scene, corners, empty=[c], format=style, culprits=[rec.scene.cameras[c].name])


@kind("links", FEW + LINK)
def camera_with_one_view(rng):
    """A camera sees one board."""
    return thinned(rng, 1)


@kind("links", FEW + LINK)
def camera_with_three_views(rng):
    """A camera sees three boards."""
    return thinned(rng, 3)


def thinned(rng, views):
    rec = make(rng, count=4)
    c = int(rng.integers(4))
    shared = [f for f in of_camera(rec, c) if any((k, f) in rec.corners for k in range(4) if k != c)]
    keep = set(rng.choice(shared, views, replace=False))
    corners = without(rec.corners, lambda k, f: k != c or f in keep)
    return Recording(rec.scene, corners, culprits=[rec.scene.cameras[c].name])


@kind("links", [r"CAL-LOWCOV", r"CAL-UNCERTAIN", r"cover"], statistics=True)
def middle_only(rng):
    """A camera sees the board in the middle of its image only."""
    rec = make(rng, frames=45)
    c = int(rng.integers(len(rec.scene.cameras)))
    w, h = rec.scene.cameras[c].size

    def central(k, f):
        x, y = np.nanmean(rec.corners[(k, f)], axis=0)
        return k != c or math.hypot(x / w - 0.5, y / h - 0.5) < 0.22
    corners = without(rec.corners, central)
    return Recording(rec.scene, corners, culprits=[rec.scene.cameras[c].name])
