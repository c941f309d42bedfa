"""Lenses and pictures that change, and lenses at the extremes."""

import math

import numpy as np

import rigid
import studio
from kinds_cameras import MOVED, changed_from, direction
from lens import Lens
from recording import Recording, altered, make_scene, observe
from registry import WIDE, kind

LENS_CHANGED = [r"refocus", r"\bfocus changed", r"\bzoom", r"focal length changed", r"lens changed", r"CAL-LENSCHANGED"]


def scaled_picture(camera, factor, about):
    p = camera.lens.params.copy()
    p[:2] *= factor
    p[2:4] = about + factor * (p[2:4] - about)
    return altered(camera, lens=Lens(camera.lens.model, p))


@kind("lens changes", LENS_CHANGED)
def refocused(rng):
    """The focal length of a camera changes by 0.5 to 4 %, once."""
    factor = 1 + rng.choice([-1, 1]) * rng.uniform(0.005, 0.04)
    scene = make_scene(rng)
    return changed_from(rng, scene, lambda camera: scaled_picture(camera, factor, camera.lens.params[2:4]))


@kind("lens changes", LENS_CHANGED + [r"\bcrop"])
def zoomed(rng):
    """A camera zooms digitally by 1.05 to 1.5 about the image's middle, once."""
    factor = rng.uniform(1.05, 1.5)
    scene = make_scene(rng)
    return changed_from(rng, scene, lambda camera: scaled_picture(camera, factor, (np.array(camera.size) - 1) / 2))


@kind("lens changes", [r"\bcrop", r"stabili[sz]", r"principal point moved"] + MOVED)
def recropped(rng):
    """The crop of a camera's picture shifts by 10 to 60 px, once (as electronic stabilisation does)."""
    shift = rng.uniform(10, 60) * np.array([1, 0])
    scene = make_scene(rng)

    def change(camera):
        p = camera.lens.params.copy()
        p[2:4] += shift
        return altered(camera, lens=Lens(camera.lens.model, p))
    return changed_from(rng, scene, change)


def whole(rng, change, told_size=None):
    """A camera whose footage was changed from beginning to end; what is true is the camera that the footage shows."""
    scene = make_scene(rng)
    c = int(rng.integers(len(scene.cameras)))
    scene.cameras = [change(camera) if k == c else camera for k, camera in enumerate(scene.cameras)]
    rec = Recording(scene, observe(rng, scene))
    rec.sizes = {c: told_size(scene.cameras[c])} if told_size else None
    return rec


@kind("lens changes", clean=False)
def cropped_whole(rng):
    """A camera's footage is a crop from beside the middle: the principal point is far from the image's centre."""
    def change(camera):
        w, h = camera.size
        size = (int(0.7 * w), int(0.7 * h))
        corner = np.array([rng.uniform(0, 0.3 * w), rng.uniform(0, 0.3 * h)])
        p = camera.lens.params.copy()
        p[2:4] -= corner
        return altered(camera, lens=Lens(camera.lens.model, p), size=size)
    return whole(rng, change)


@kind("lens changes")
def scaled_whole(rng):
    """A camera's footage was scaled to half its size."""
    def change(camera):
        small = scaled_picture(camera, 0.5, np.array([-0.5, -0.5]))
        return altered(small, size=(camera.size[0] // 2, camera.size[1] // 2))
    return whole(rng, change)


@kind("lens changes", [r"size", r"principal", r"cropp?", r"coverage", r"CAL-LOWCOV"])
def scaled_whole_old_size(rng):
    """A camera's footage was scaled to half, and the size is told as before: the boards keep to a quarter of the image."""
    def change(camera):
        small = scaled_picture(camera, 0.5, np.array([-0.5, -0.5]))
        return altered(small, size=(camera.size[0] // 2, camera.size[1] // 2))
    rec = whole(rng, change, lambda camera: (camera.size[0] * 2, camera.size[1] * 2))
    (c, size), = rec.sizes.items()
    rec.scene.cameras[c] = altered(rec.scene.cameras[c], size=size)
    rec.truths, rec.sizes = [rec.scene.cameras], None
    return rec


@kind("lens changes")
def anamorphic(rng):
    """A camera's pixels are not square: 4:3 footage stretched to 16:9."""
    def change(camera):
        p = camera.lens.params.copy()
        p[[0, 2]] *= 4 / 3
        return altered(camera, lens=Lens(camera.lens.model, p), size=(camera.size[0] * 4 // 3, camera.size[1]))
    return whole(rng, change)


@kind("lens changes", [r"mirror"])
def mirrored_footage(rng):
    """A camera's picture is flipped."""
    scene = make_scene(rng)
    corners = observe(rng, scene)
    c = int(rng.integers(len(scene.cameras)))
    w = scene.cameras[c].size[0]
    for key in corners:
        if key[0] == c:
            corners[key] = corners[key] * [-1, 1] + [w - 1, 0]
    return Recording(scene, corners, culprits=[scene.cameras[c].name])


# ---- lenses at the extremes ------------------------------------------------------------------------------------------------------

@kind("lenses", [r"CAL-FOCAL", r"CAL-ASSUMED", r"CAL-UNCERTAIN", r"focal length", r"tilted", r"far"])
def long_lens(rng):
    """Focal lengths of 100,000 px: a metre-wide board at a hundred metres."""
    hfov = 2 * math.degrees(math.atan(1920 / 2 / 1e5))
    scene = make_scene(rng, sizes=[(1920, 1080)], hfov=(hfov, hfov), radius=200, near_far=(0.99, 1.01), layout="arc", partial=True)
    return Recording(scene, observe(rng, scene))


@kind("lenses", [r"CAL-FOCAL", r"CAL-ASSUMED", r"CAL-UNCERTAIN"], simpler=WIDE, statistics=True)
def fisheye_230(rng):
    """Fisheye lenses of 230 degrees."""
    scene = make_scene(rng, lens="fisheye", hfov=(230, 230), layout="arc", frames=45)
    return Recording(scene, observe(rng, scene))


@kind("lenses", clean=True, statistics=True)
def mixed_lenses(rng):
    """Narrow, normal and wide lenses in one rig."""
    scene = make_scene(rng, count=5, frames=45)
    for k, camera in enumerate(scene.cameras):
        camera.lens = studio.perspective_lens(rng, camera.size, [28, 55, 90][k % 3], 4 if k % 3 else 2)
    scene.poses = studio.film(rng, scene.cameras, scene.board, 50, tuple(np.array([0.6, 1.1]) * typical(scene)), True)
    scene.partial = True
    return Recording(scene, observe(rng, scene))


def typical(scene):
    return float(np.median([np.linalg.norm(c.centre()) for c in scene.cameras]))


@kind("lenses", clean=True, statistics=True)
def noisy_camera(rng):
    """One camera is five times as noisy as the others."""
    scene = make_scene(rng, sigma=rng.uniform(0.1, 0.25))
    c = int(rng.integers(len(scene.cameras)))
    scene.cameras[c] = altered(scene.cameras[c], sigma_px=5 * scene.cameras[c].sigma_px)
    return Recording(scene, observe(rng, scene))


@kind("lenses", clean=True, statistics=True)
def near_coincident(rng):
    """Two of the cameras stand one to five millimetres apart."""
    scene = make_scene(rng)
    a, b = scene.cameras[0], scene.cameras[1]
    rotation = rigid.exp(rng.normal(0, 0.03, 3)) @ a.cam_from_world[0]
    eye = a.centre() + rng.uniform(0.001, 0.005) * direction(rng)
    scene.cameras[1] = altered(b, cam_from_world=(rotation, -rotation @ eye))
    scene.poses = studio.film(rng, scene.cameras, scene.board, 50, tuple(np.array([0.55, 1.1]) * typical(scene)), scene.partial)
    return Recording(scene, observe(rng, scene))


