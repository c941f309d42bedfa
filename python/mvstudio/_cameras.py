"""Cameras that are at hand as arrays, as calibration.json has them (docs/formats.md)."""
from __future__ import annotations

from typing import Any

import numpy as np

from mvstudio._error import Error

_TERMS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4")  # OpenCV's order
_MODELS = {0: "pinhole", 1: "brown1", 2: "brown2", 4: "brown4", 5: "brown5", 8: "rational8", 12: "thinprism12"}


def _quaternion(rotation: np.ndarray) -> list[float]:
    """x, y, z, w of a rotation: the eigenvector of Bar-Itzhack's matrix, "New method for extracting the quaternion from a rotation
    matrix", 2000."""
    (a, b, c), (d, e, f), (g, h, i) = rotation
    matrix = np.array([[a - e - i, b + d, c + g, h - f], [b + d, e - a - i, f + h, c - g], [c + g, f + h, i - a - e, d - b],
                       [h - f, c - g, d - b, a + e + i]])
    found = np.linalg.eigh(matrix)[1][:, -1]
    return [float(value) for value in found * (1 if found[3] >= 0 else -1)]


def _array(name: str, key: str, value: Any, shape: tuple[int, ...]) -> np.ndarray:
    found = np.asarray(value, dtype=float)
    if found.shape != shape:
        raise Error("CLI-USAGE", f"`cameras` {name!r}: `{key}` has shape {found.shape}, expected {shape}")
    return found


def _intrinsics(name: str, K: np.ndarray, terms: np.ndarray, model: Any) -> tuple[str, dict[str, float]]:
    if not (np.allclose(K, np.triu(K), atol=0) and K[0, 1] == 0 and K[2, 2] == 1):
        raise Error("CLI-USAGE", f"`cameras` {name!r}: `K` is no matrix of focal lengths and principal point without skew")
    if model is None:
        model = _MODELS.get(len(terms))
    names = ("k1", "k2", "k3", "k4") if model == "kannala4" else _TERMS[:len(terms)]
    if model not in (*_MODELS.values(), "kannala4") or len(names) != len(terms) or (model != "kannala4" and model != _MODELS.get(len(terms))):
        raise Error("CLI-USAGE", f"`cameras` {name!r}: {len(terms)} terms of `distortion` are no lens {model or 'of OpenCV'}",
                    "use 0, 4, 5, 8 or 12, or 4 with model='kannala4'")
    numbers = {"fx": K[0, 0], "fy": K[1, 1], "cx": K[0, 2], "cy": K[1, 2], **dict(zip(names, terms))}
    return str(model), {key: float(value) for key, value in numbers.items()}


def camera_entry(name: str, given: dict[str, Any]) -> dict[str, Any]:
    """The entry of a camera; what may be given: `Rig.from_cameras`."""
    unknown = given.keys() - {"size_px", "K", "distortion", "model", "cam_from_world"}
    missing = {"size_px", "K"} - given.keys()
    if unknown or missing:
        raise Error("CLI-USAGE", f"`cameras` {name!r}: " + (f"there is no {sorted(unknown)[0]!r}" if unknown else f"{sorted(missing)[0]!r} is missing"),
                    "it takes size_px, K, distortion, model, cam_from_world")
    terms = np.asarray(given.get("distortion", ()) if given.get("distortion") is not None else (), dtype=float).ravel()
    model, intrinsics = _intrinsics(name, _array(name, "K", given["K"], (3, 3)), terms, given.get("model"))
    pose = given.get("cam_from_world")
    transform = np.eye(4) if pose is None else _array(name, "cam_from_world", pose, (4, 4))
    rotation = transform[:3, :3]
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6) or np.linalg.det(rotation) < 0:
        raise Error("CLI-USAGE", f"`cameras` {name!r}: `cam_from_world` does not begin with a rotation", "its last row is 0, 0, 0, 1")
    return {"name": name, "size_px": [int(n) for n in _array(name, "size_px", given["size_px"], (2,))], "model": model,
            "intrinsics": intrinsics,
            "cam_from_world": {"rotation_xyzw": _quaternion(rotation), "translation": [float(t) for t in transform[:3, 3]]}}
