"""Recordings in which nothing is wrong."""

import studio
from recording import Recording, calibration_text, make
from registry import WIDE, kind

CLEAN = dict(clean=True, statistics=True)


@kind("clean", **CLEAN)
def clean_four(rng):
    """Four cameras, stills of a board."""
    return make(rng, count=4)


@kind("clean", **CLEAN)
def clean_ten(rng):
    """Ten cameras."""
    return make(rng, count=10, frames=40)


@kind("clean", **CLEAN)
def clean_ring(rng):
    """Six cameras all around; neighbours alone see the board together."""
    return make(rng, count=6, layout="ring", frames=60)


@kind("clean", **CLEAN)
def clean_stereo(rng):
    """Two cameras."""
    return make(rng, count=2, layout="wall", frames=40)


@kind("clean", **CLEAN)
def clean_wide(rng):
    """Perspective lenses of 95 to 110 degrees."""
    return make(rng, hfov=(95, 110))


@kind("clean", simpler=WIDE, **CLEAN)
def clean_fisheye(rng):
    """Equidistant lenses of 140 to 190 degrees."""
    return make(rng, lens="fisheye", hfov=(140, 190), layout="arc", frames=45)


@kind("clean", **CLEAN)
def clean_mixed_sizes(rng):
    """4K beside VGA and HD, each with its own lens."""
    return make(rng, count=5, sizes=[studio.UHD, studio.VGA, (1280, 720)])


@kind("clean", **CLEAN)
def clean_few_boards(rng):
    """Twenty boards; every camera sees ten or more."""
    return make(rng, frames=20, count=4, least=10)


@kind("clean", **CLEAN)
def clean_video(rng):
    """A board that is carried about, filmed as a video."""
    return make(rng, video=True, frames=49)


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
