"""A studio with known geometry, as the calibration file that it would have."""
import json
import os
import pathlib
import sys

import numpy as np
import pytest

sys.path.insert(0, os.environ.get("MVSTUDIO_PYTHON", str(pathlib.Path(__file__).resolve().parents[2] / "build/release/python")))
import mvstudio  # noqa: E402

ROOT = pathlib.Path(os.environ.get("MVSTUDIO_SOURCE", pathlib.Path(__file__).resolve().parents[2]))
os.environ.setdefault("MVSTUDIO_BIN", str(ROOT / "build/release/bin/mvstudio"))

LENSES = {
    "brown5": [-0.12, 0.06, 6e-4, -4e-4, -0.01],
    "kannala4": [0.02, -0.006, 0.001, 0.0],
    "pinhole": [],
}
NAMES = {"brown5": ["k1", "k2", "p1", "p2", "k3"], "kannala4": ["k1", "k2", "k3", "k4"], "pinhole": []}


def looking_at_origin(center):
    """(3, 3), (3,): cam_from_world of a camera with z up in its images."""
    z = -center / np.linalg.norm(center)
    x = np.cross(z, [0, 0, 1])
    x /= np.linalg.norm(x)
    rotation = np.stack([x, np.cross(z, x), z])
    return rotation, -rotation @ center


def xyzw(rotation):
    w = np.sqrt(max(0, 1 + np.trace(rotation))) / 2
    return [(rotation[2, 1] - rotation[1, 2]) / (4 * w), (rotation[0, 2] - rotation[2, 0]) / (4 * w),
            (rotation[1, 0] - rotation[0, 1]) / (4 * w), w]


def camera(name, model, angle, covariance):
    rotation, translation = looking_at_origin(np.array([3 * np.cos(angle), 3 * np.sin(angle), 1.2]))
    intrinsics = dict(zip(["fx", "fy", "cx", "cy"] + NAMES[model], [900.0, 905.0, 641.5, 357.25] + LENSES[model]))
    found = {"name": name, "size_px": [1280, 720], "model": model, "intrinsics": intrinsics,
             "cam_from_world": {"rotation_xyzw": xyzw(rotation), "translation": translation.tolist()}}
    if covariance:
        sigmas = np.array([0.4, 0.4, 0.3, 0.3] + [1e-3] * len(LENSES[model]))
        found["intrinsics_covariance"] = np.diag(sigmas**2).tolist()
        found["cam_from_world_covariance"] = np.diag(np.array([2e-4, 2e-4, 3e-4, 5e-4, 5e-4, 8e-4]) ** 2).tolist()
    return found


def rig_text(models=("brown5", "kannala4", "pinhole", "brown5"), covariance=True):
    angles = np.linspace(0.3, 0.3 + 2 * np.pi, len(models), endpoint=False)
    cameras = [camera(f"cam_{i + 1:02d}", m, a, covariance) for i, (m, a) in enumerate(zip(models, angles))]
    return json.dumps({"schema": "mvstudio.calibration/1", "unit": "m", "cameras": cameras})


@pytest.fixture(scope="session")
def rig():
    return mvstudio.Rig.from_json(rig_text())


@pytest.fixture(scope="session")
def points():
    return np.random.default_rng(4).uniform(-0.8, 0.8, (200, 3)) * [1, 1, 1.1]


@pytest.fixture(scope="session")
def dataset(tmp_path_factory):
    """A dataset of a synthetic person: 4 cameras of 160 x 120 px, 6 frames, images without loss, masks of the truth."""
    folder = tmp_path_factory.mktemp("studio")
    mvstudio.command("synth", out=folder / "studio", cameras=4, size="160x120", board_frames=0, take_frames=6, samples=1, texture_px=64,
                     format="png")
    truth = folder / "studio/truth"
    mvstudio.stages.dataset_build(session=folder / "studio", take="take1", calib=truth / "calibration.json", pose3d=truth / "pose3d",
                                  masks=truth / "masks/take1", png=True, out=folder / "data")
    return folder / "data"


def numpy_project(rig, points, name):
    """The formula of docs/formulation.md once more."""
    transform = rig.cam_from_world(name)
    x = points @ transform[:3, :3].T + transform[:3, 3]
    fx, fy, cx, cy, *k = rig.params(name)
    a, b = x[:, 0] / x[:, 2], x[:, 1] / x[:, 2]
    if rig.model(name) == "kannala4":
        r = np.hypot(a, b)
        t = np.arctan(r)
        scale = t * (1 + k[0] * t**2 + k[1] * t**4 + k[2] * t**6 + k[3] * t**8) / r
        a, b = a * scale, b * scale
    elif k:
        s = a**2 + b**2
        radial = 1 + k[0] * s + k[1] * s**2 + k[4] * s**3
        a, b = (a * radial + 2 * k[2] * a * b + k[3] * (s + 2 * a**2), b * radial + k[2] * (s + 2 * b**2) + 2 * k[3] * a * b)
    return np.stack([fx * a + cx, fy * b + cy], axis=1)
