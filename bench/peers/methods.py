"""Triangulation as other programs do it, written anew in numpy from what their papers and documentation say.

Each takes p (cameras, 3, 4), px (points, cameras, 2) and returns (points, 3); NaN where there is no answer.
"""
import itertools

import numpy as np


def dlt_point(p, px, weight=None):
    """Homogeneous DLT of one point: the last right singular vector of the rows (x P3 - P1) w, (y P3 - P2) w."""
    rows = np.empty((2 * len(p), 4))
    rows[0::2] = px[:, :1] * p[:, 2] - p[:, 0]
    rows[1::2] = px[:, 1:] * p[:, 2] - p[:, 1]
    if weight is not None:
        rows *= np.repeat(weight, 2)[:, None]
    x = np.linalg.svd(rows)[2][-1]
    return x[:3] / x[3]


def aniposelib(p, px):
    """aniposelib's way (Karashchuk et al., "Anipose", Cell Reports 2021): an unweighted DLT of each point, one after another."""
    found = np.full((len(px), 3), np.nan)
    for i, seen in enumerate(px):
        good = ~np.isnan(seen[:, 0])
        if good.sum() >= 2:
            found[i] = dlt_point(p[good], seen[good])
    return found


def reprojection_error(p, px, x):
    """Mean distance in px over the cameras."""
    h = p @ np.append(x, 1)
    return np.hypot(*(h[:, :2] / h[:, 2:] - px).T).mean()


def pose2sim(p, px, limit_px=15, min_cameras=2):
    """Pose2Sim's way (Pagnon et al., Sensors 2021): a weighted DLT, leaving out 0, 1, 2, … cameras in every combination until
    the mean reprojection error is within the limit."""
    found = np.full((len(px), 3), np.nan)
    for i, seen in enumerate(px):
        n = len(p)
        for num_excluded in range(n - min_cameras + 1):
            best = (np.inf, None)
            for excluded in itertools.combinations(range(n), num_excluded):
                kept = [c for c in range(n) if c not in excluded]
                x = dlt_point(p[kept], seen[kept], np.ones(len(kept)))
                error = reprojection_error(p[kept], seen[kept], x)
                best = min(best, (error, x), key=lambda candidate: candidate[0])
            if best[0] <= limit_px:
                found[i] = best[1]
                break
    return found


def all_at_once(p, px):
    """The plain DLT of all points in one call of numpy, which neither program makes: the quickest that numpy can do."""
    rows = np.empty((len(px), 2 * len(p), 4))
    rows[:, 0::2] = px[:, :, :1] * p[:, 2] - p[:, 0]
    rows[:, 1::2] = px[:, :, 1:] * p[:, 2] - p[:, 1]
    x = np.linalg.svd(rows, full_matrices=False)[2][:, -1]
    return x[:, :3] / x[:, 3:]
