"""Cameras that move, and calibrations to start from that are wrong."""

import math

import numpy as np

import rigid
import studio
from lens import Lens
from recording import Recording, altered, calibration_text, make_scene, observe
from registry import kind, kinds

MOVED = [r"CAL-MOVED", r"\bmoved between\b"]


def when_and_who(rng, scene):
    """A camera and an instant in the middle three fifths; the camera sees the board six times before and after it."""
    n = len(scene.poses)
    seen = np.array([studio.num_seen(scene.cameras, scene.board, p, scene.partial) for p in scene.poses])
    for _ in range(100):
        c, at = int(rng.integers(len(scene.cameras))), int(rng.integers(n // 5, 4 * n // 5 + 1))
        if seen[:at, c].sum() >= 6 and seen[at:, c].sum() >= 6:
            return c, at
    raise RuntimeError("no camera sees the board before and after")


def changed_from(rng, scene, change):
    """A camera that is another one from an instant on; right is what was before or what came after."""
    c, at = when_and_who(rng, scene)
    after = change(scene.cameras[c])
    corners = observe(rng, scene, camera_at=lambda k, i: after if k == c and i >= at else scene.cameras[k])
    other = [after if k == c else camera for k, camera in enumerate(scene.cameras)]
    return Recording(scene, corners, truths=[scene.cameras, other], culprits=[scene.cameras[c].name])


def direction(rng):
    v = rng.normal(0, 1, 3)
    return v / np.linalg.norm(v)


def kicked(rng, degrees, shift_m=0.0, **options):
    scene = make_scene(rng, **options)
    turn, shift = rigid.exp(math.radians(degrees) * direction(rng)), shift_m * direction(rng)

    def change(camera):
        centre = camera.centre() + shift
        rotation = turn @ camera.cam_from_world[0]
        return altered(camera, cam_from_world=(rotation, -rotation @ centre))
    return changed_from(rng, scene, change)


kinds("camera moves", MOVED, {
    "kicked_02deg": ("A camera turns by 0.2 degrees, once.", lambda rng: kicked(rng, 0.2)),
    "kicked_05deg": ("By 0.5 degrees.", lambda rng: kicked(rng, 0.5)),
    "kicked_2deg": ("By 2 degrees.", lambda rng: kicked(rng, 2)),
    "kicked_10deg": ("By 10 degrees.", lambda rng: kicked(rng, 10)),
    "kicked_video": ("By 0.3 to 5 degrees while a board is carried about.",
        lambda rng: kicked(rng, math.exp(rng.uniform(math.log(0.3), math.log(5))), video=True, frames=49)),
    "kicked_aside": ("A camera is shifted by 0.5 to 10 cm.",
        lambda rng: kicked(rng, 0, math.exp(rng.uniform(math.log(0.005), math.log(0.1))))),
})


@kind("camera moves", MOVED)
def kicked_and_back(rng):
    """A camera turns by 1 to 3 degrees for a fifth of the time and is put back."""
    scene = make_scene(rng, frames=50)
    c, at = when_and_who(rng, scene)
    turn, until = rigid.exp(math.radians(rng.uniform(1, 3)) * direction(rng)), at + 10
    camera = scene.cameras[c]
    rotation = turn @ camera.cam_from_world[0]
    after = altered(camera, cam_from_world=(rotation, -rotation @ camera.centre()))
    corners = observe(rng, scene, camera_at=lambda k, i: after if k == c and at <= i < until else scene.cameras[k])
    return Recording(scene, corners, culprits=[camera.name])


@kind("camera moves", MOVED + [r"drift"])
def sagging(rng):
    """A camera's mount gives way slowly, by 0.5 to 2 degrees over the recording."""
    scene = make_scene(rng)
    c, n = int(rng.integers(len(scene.cameras))), len(scene.poses)
    axis, total = direction(rng), math.radians(rng.uniform(0.5, 2))

    def at(k, i):
        camera = scene.cameras[k]
        rotation = rigid.exp(total * i / n * axis) @ camera.cam_from_world[0]
        return camera if k != c else altered(camera, cam_from_world=(rotation, -rotation @ camera.centre()))
    ends = [[at(k, i) for k in range(len(scene.cameras))] for i in (0, n // 2, n)]
    return Recording(scene, observe(rng, scene, camera_at=at), truths=ends, culprits=[scene.cameras[c].name])


@kind("camera moves", MOVED + [r"time offset", r"\blate\b"])
def kicked_and_late(rng):
    """A camera takes its frames 0.2 to 0.5 frames late, and turns by 0.5 to 2 degrees while a board is carried about."""
    scene = make_scene(rng, video=True, frames=49)
    c, at = when_and_who(rng, scene)
    turn, late = rigid.exp(math.radians(rng.uniform(0.5, 2)) * direction(rng)), rng.uniform(0.2, 0.5)
    camera = scene.cameras[c]
    rotation = turn @ camera.cam_from_world[0]
    after = altered(camera, cam_from_world=(rotation, -rotation @ camera.centre()))
    corners = observe(rng, scene, camera_at=lambda k, i: after if k == c and i >= at else scene.cameras[k],
                      time_of=lambda k, i: i - late if k == c else float(i))
    other = [after if k == c else x for k, x in enumerate(scene.cameras)]
    return Recording(scene, corners, truths=[scene.cameras, other], culprits=[camera.name])


@kind("camera moves", MOVED + [r"turned by 180", r"half a turn", r"upside"])
def picture_turned(rng):
    """A camera's picture stands on its head from an instant on, as when a phone turns its footage."""
    def change(camera):
        half = np.diag([-1.0, -1.0, 1.0])
        p = camera.lens.params.copy()
        p[2:4] = np.array(camera.size) - 1 - p[2:4]
        p[6:8] *= -1  # decentring follows the picture
        rotation, translation = camera.cam_from_world
        return altered(camera, lens=Lens(camera.lens.model, p), cam_from_world=(half @ rotation, half @ translation))
    return changed_from(rng, make_scene(rng), change)


# ---- seeds -----------------------------------------------------------------------------------------------------------------------

def seeded(rng, alter, more, culprit=True):
    """A calibration to start from in which one camera is wrong."""
    scene = make_scene(rng)
    for camera in scene.cameras:
        camera.lens = studio.perspective_lens(rng, camera.size, math.degrees(2 * studio.field_of(camera)), 5)
    rec = Recording(scene, observe(rng, scene))
    c = int(rng.integers(len(scene.cameras)))
    seed = [alter(camera) if k == c else camera for k, camera in enumerate(scene.cameras)]
    rec.files["seed.json"] = calibration_text(seed)
    name = scene.cameras[c].name
    rec.arguments = ["--start", "{folder}/seed.json"] + [a.replace("{name}", name) for a in more]
    rec.culprits = [name] if culprit else []
    return rec


SEED_WRONG = [r"given (lens|calibration|pose)", r"CAL-CONTRADICTS", r"CAL-HOLDOUT", r"CAL-GROSS"]


def reordered(camera):
    """k1 k2 k3 p1 p2 written where k1 k2 p1 p2 k3 is read."""
    p = camera.lens.params
    return altered(camera, lens=Lens("brown5", np.array([*p[:6], p[8], p[6], p[7]])))


def wrongly_distorted(camera):
    """The seed's lens bends although the footage was undistorted before."""
    p = camera.lens.params.copy()
    p[4:] = [-0.3, 0.1, 0.001, -0.001, 0]
    return altered(camera, lens=Lens("brown5", p))


def refocused_since(camera):
    """The lens stands in the file as it was before somebody touched its focus."""
    p = camera.lens.params.copy()
    p[:2] *= 0.97
    return altered(camera, lens=Lens("brown5", p))


def turned(camera):
    rotation = rigid.exp(np.radians([1.0, 2.0, 0.5])) @ camera.cam_from_world[0]
    return altered(camera, cam_from_world=(rotation, -rotation @ camera.centre()))


kinds("seeds", SEED_WRONG, {
    "seed_k_order": ("k's of a camera in the wrong order in the calibration to start from.", lambda rng: seeded(rng, reordered, [])),
    "seed_k_order_fixed": ("The same, and the lens is not to change.", lambda rng: seeded(rng, reordered, ["--fix", "lenses:{name}"])),
    "seed_distorted": ("A camera's distortion in the seed is not that of the footage.", lambda rng: seeded(rng, wrongly_distorted, [])),
    "seed_distorted_fixed": ("The same, and the lens is not to change.",
        lambda rng: seeded(rng, wrongly_distorted, ["--fix", "lenses:{name}"])),
    "seed_turned": ("A camera's pose in the seed is off by two degrees.", lambda rng: seeded(rng, turned, [])),
    "seed_turned_fixed": ("The same, and the poses are not to change.", lambda rng: seeded(rng, turned, ["--fix", "poses"])),
    "seed_refocused_fixed": ("A camera's focal length in the seed is 3 % too small, and the lens is not to change.",
        lambda rng: seeded(rng, refocused_since, ["--fix", "lenses:{name}"])),
})


@kind("seeds", SEED_WRONG + [r"\bunit", r"CAL-LENGTHS", r"CAL-SCALE", r"times"], simpler=())
def seed_unit_fixed(rng):
    """The poses in the seed are in another unit than the board: ten times, 25.4 times or a thousand times too large; they are held."""
    factor = float(rng.choice([10, 25.4, 1000]))

    def rescaled(camera):
        return altered(camera, cam_from_world=(camera.cam_from_world[0], factor * camera.cam_from_world[1]))
    rec = seeded(rng, lambda camera: camera, ["--fix", "poses"], culprit=False)
    rec.files["seed.json"] = calibration_text([rescaled(camera) for camera in rec.scene.cameras])
    return rec
