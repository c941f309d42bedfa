"""Recordings in which nothing is wrong."""

import numpy as np

import rigid
import studio
from recording import Recording, altered, calibration_text, make, make_scene, observe
from registry import WIDE, kind, kinds

CLEAN = dict(clean=True, statistics=True)


kinds("clean", (), {
    "clean_four": ("Four cameras, stills of a board.", lambda rng: make(rng, count=4)),
    "clean_ten": ("Ten cameras.", lambda rng: make(rng, count=10, frames=40)),
    "clean_ring": ("Six cameras all around; neighbours alone see the board together.",
        lambda rng: make(rng, count=6, layout="ring", frames=60)),
    "clean_stereo": ("Two cameras.", lambda rng: make(rng, count=2, layout="wall", frames=40)),
    "clean_wide": ("Perspective lenses of 95 to 110 degrees.", lambda rng: make(rng, hfov=(95, 110))),
}, **CLEAN)


@kind("clean", simpler=WIDE, **CLEAN)
def clean_fisheye(rng):
    """Equidistant lenses of 140 to 190 degrees."""
    return make(rng, lens="fisheye", hfov=(140, 190), layout="arc", frames=45)


kinds("clean", (), {
    "clean_mixed_sizes": ("4K beside VGA and HD, each with its own lens.",
        lambda rng: make(rng, count=5, sizes=[studio.UHD, studio.VGA, (1280, 720)])),
    "clean_few_boards": ("Twenty boards; every camera sees ten or more.", lambda rng: make(rng, frames=20, count=4, least=10)),
    "clean_video": ("A board that is carried about, filmed as a video.", lambda rng: make(rng, video=True, frames=49)),
}, **CLEAN)


@kind("clean", **CLEAN)
def clean_seed(rng):
    """A right calibration to start from."""
    rec = make(rng)
    rec.files["seed.json"] = calibration_text(rec.scene.cameras)
    rec.arguments = ["--start", "{folder}/seed.json"]
    return rec


@kind("clean", **CLEAN)
def clean_csv(rng):
    """Corners in mvstudio's own CSV."""
    rec = make(rng, count=4)
    return Recording(rec.scene, rec.corners, format="csv")


@kind("clean", **CLEAN)
def clean_portrait(rng):
    """Cameras that stand on their side, and one on its head; the pictures are as the sensors see."""
    scene = make_scene(rng, frames=45)
    for k, camera in enumerate(scene.cameras):
        roll = rigid.exp(np.array([0, 0, [np.pi / 2, np.pi, -np.pi / 2, 0][k % 4]]))
        rotation, translation = camera.cam_from_world
        scene.cameras[k] = altered(camera, cam_from_world=(roll @ rotation, roll @ translation))
    scene.partial = True
    return Recording(scene, observe(rng, scene))


@kind("clean", **CLEAN)
def clean_tiny(rng):
    """Images of 160 x 120 px."""
    return make(rng, sizes=[(160, 120)], sigma=rng.uniform(0.03, 0.1), partial=True, frames=45)


@kind("clean", **CLEAN)
def clean_huge(rng):
    """Images of 12000 x 8000 px."""
    return make(rng, sizes=[(12000, 8000)], sigma=rng.uniform(0.2, 0.6))


@kind("clean", **CLEAN)
def clean_twice(rng):
    """Every third view was exported twice, under a number of its own."""
    rec = make(rng, frames=45)
    rec.scene.stride = max(rec.scene.stride, 1)
    last = max(frame for _, frame in rec.corners)
    again = {(c, frame + last + 1000): px.copy() for (c, frame), px in rec.corners.items() if frame // rec.scene.stride % 3 == 0}
    return Recording(rec.scene, {**rec.corners, **again})


@kind("clean", **CLEAN)
def clean_rounded(rng):
    """A camera's corners are whole pixels."""
    rec = make(rng, sigma=rng.uniform(0.1, 0.3))
    c = int(rng.integers(len(rec.scene.cameras)))
    corners = {key: np.round(px) if key[0] == c else px for key, px in rec.corners.items()}
    rec.scene.cameras[c] = altered(rec.scene.cameras[c], sigma_px=float(np.hypot(rec.scene.cameras[c].sigma_px, 12 ** -0.5)))
    return Recording(rec.scene, corners)
