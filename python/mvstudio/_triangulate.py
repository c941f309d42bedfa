"""Points from their pixels in several cameras."""
from __future__ import annotations

import enum
from collections import namedtuple
from typing import Any

import numpy as np

from mvstudio import _core
from mvstudio._error import Error
from mvstudio._progress import Shown
from mvstudio._rig import Rig

Status = enum.IntEnum("Status", {word: i for i, word in enumerate(_core.STATUS_WORDS)}, module=__name__)  # type: ignore[misc]
Status.__doc__ = "Why a computation did or did not give a value; a value is valid only with ``Status.Ok`` (0)."


class Points(namedtuple("Points", ["x", "covariance", "status"])):
    """Triangulated points; unpacks as ``x, covariance, status``.

    Attributes
    ----------
    x : ndarray, (n, 3)
        Metres in world; NaN where the status is not `Status.Ok`.
    covariance : ndarray, (n, 3, 3)
        Square metres; NaN likewise.
    status : ndarray, (n,), uint8
        `Status` of each point.
    used : ndarray, (c, n), bool
        Which views the points are made of.
    rms_px : ndarray, (n,)
        ``sqrt(mean |r|^2)`` of the views used, observed minus projected.
    """

    used: np.ndarray
    rms_px: np.ndarray

    @property
    def ok(self) -> np.ndarray:
        """(n,) bool: where the status is `Status.Ok`."""
        return self.status == 0


def triangulate(points2d: Any, rig: Rig, *, scores: Any = None, min_score: float = 0.3, sigma_px: Any = 1.0,
                method: str = "robust", min_views: int = 2, max_residual_sigmas: float = 4.0, min_parallax_sigmas: float = 5.0,
                max_distance_m: float = 0.0, calibration_covariance: bool = True, single_precision: bool = False,
                progress: Any = None, threads: int = 0, seed: int = 1) -> Points:
    """Points from their pixels in two cameras and more.

    Parameters
    ----------
    points2d : array_like, (c, n, 2)
        Pixels, a row for each camera of the rig in its order; NaN where a camera does not see a point.
    rig : Rig
    scores : array_like, (c, n), or None
        Confidence of the detections; those below `min_score` are left out.
    min_score : float
    sigma_px : float or array_like, (c, n)
        Standard deviation of each coordinate of a detection.
    method : str
        ``"robust"`` chooses the views that agree; ``"all-views"``, ``"linear"``, ``"midpoint"``, ``"dlt"``, … trust all.
    min_views : int
        Views that a point needs.
    max_residual_sigmas : float
        A view with a larger residual is not used.
    min_parallax_sigmas : float
        Below it a point is ``LowParallax``.
    max_distance_m : float
        Points farther from every camera are ``FarPoint``; 0: no limit.
    calibration_covariance : bool
        Whether the covariance holds the calibration's own uncertainty, where the rig states one.
    single_precision : bool
        Solve in float where the accuracy check allows it.
    progress : callable, bool or None
        ``progress(stage, done, total, note)``; True: shown on stderr.
    threads : int
        0: as many as the machine has; the result does not depend on it.
    seed : int

    Returns
    -------
    Points
        ``x, covariance, status``, and with ``used`` and ``rms_px``.

    Notes
    -----
    The methods are those of docs/triangulation.md; covariances are of first order.
    """
    px = np.asarray(points2d, dtype=float)
    if px.ndim != 3 or px.shape[0] != len(rig) or px.shape[2] != 2:
        raise Error("CLI-USAGE", f"`points2d`: expected shape ({len(rig)}, n, 2), a row for each camera, got {px.shape}")
    seen = np.ones(px.shape[:2], dtype=bool)
    if scores is not None:
        confident = np.asarray(scores, dtype=float)
        if confident.shape != px.shape[:2]:
            raise Error("CLI-USAGE", f"`scores`: expected shape {px.shape[:2]}, got {confident.shape}")
        seen = confident >= min_score
    try:
        sigmas = np.ascontiguousarray(np.broadcast_to(np.asarray(sigma_px, dtype=float), px.shape[:2]))
    except ValueError:
        raise Error("CLI-USAGE", f"`sigma_px`: expected a number or shape {px.shape[:2]}, got {np.shape(sigma_px)}") from None
    if not np.all(sigmas > 0):
        raise Error("CLI-USAGE", "`sigma_px`: expected numbers above 0")
    with Shown(progress) as callback:
        x, covariance, status, used, rms_px = _core.triangulate(
            rig._held, px, sigmas, seen, method, min_views, max_residual_sigmas, min_parallax_sigmas, max_distance_m,
            single_precision, calibration_covariance, callback, threads, seed)
    points = Points(x, covariance, status)
    points.used, points.rms_px = used, rms_px
    return points
