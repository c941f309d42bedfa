"""Which warnings about a recording in which nothing is wrong are false: the truth does not bear them out."""

import math
import re

import numpy as np

from truth import BorderErrors

HALF = 0.5           # of what is stated or of the limit: an error that large bears a stated uncertainty out
FEW_PLACES = 5
LOW_COVERAGE = 0.4
CORNER_PX = 10.0     # the program's limit in the image's corners
NOTHING = BorderErrors()


def false_alarms(recording, run, comparison):
    """Texts of the warnings that the truth contradicts."""
    return [f"{code}: {text}" for code, text, _ in run.messages() if not borne_out(code, text, recording, run, comparison)]


def borne_out(code, text, recording, run, comparison):
    camera = re.search(r"camera (\S+?):", text)
    check = CHECKS.get(code)
    return bool(camera and check and comparison and check(camera.group(1), text, recording, run, comparison))


def uncertain(name, text, _recording, _run, comparison):
    """The error at the image's sides, or in its corners, is half of the limit or more."""
    borders = comparison.borders.get(name, NOTHING)
    limit = re.search(r"good is below ([\d.]+)", text)
    return borders.side >= HALF * float(limit.group(1)) if limit else "corners" in text and borders.corner >= HALF * CORNER_PX


def noisy(name, text, recording, _run, comparison):
    """The corners are as noisy as that, or projections are off by half of it where boards were seen."""
    held_out = float(re.search(r"held-out error ([\d.]+)", text).group(1))
    sigma = next(c.sigma_px for i, c in enumerate(recording.scene.cameras) if recording.name_of(i) == name)
    if "good is below" in text and 1.2 * math.sqrt(2) * sigma >= float(re.search(r"good is below ([\d.]+)", text).group(1)):
        return True
    errors, _, seen = comparison.pixels[name]
    return seen.any() and np.linalg.norm(errors[seen], axis=1).max() >= HALF * held_out


def folds(name, _text, _recording, _run, comparison):
    return comparison.borders.get(name, NOTHING).folded


def focal(name, _text, _recording, _run, comparison):
    return any(q.camera == name and q.kind == "focal" and abs(q.error) >= HALF * q.sigma for q in comparison.quantities)


def views_of(name, recording):
    return [(i, px) for (c, i), px in recording.corners.items() if recording.name_of(c) == name]


def few_places(name, _text, recording, _run, _comparison):
    scene, places = recording.scene, set()
    for frame, _ in views_of(name, recording):
        pose = scene.pose_at(frame / scene.stride)
        places.add(tuple(np.round(pose[1] / scene.board.width(), 2)))
    return len(places) < FEW_PLACES


def low_coverage(name, _text, recording, run, _comparison):
    report = next(c for c in run.result["metrics"]["cameras"] if c["name"] == name)
    rows, cols = np.array(report["coverage_cells"]).shape
    size = next(c.size for i, c in enumerate(recording.scene.cameras) if recording.name_of(i) == name)
    px = np.concatenate([p[np.isfinite(p[:, 0])] for _, p in views_of(name, recording)])
    cells = {tuple(cell) for cell in np.floor((px + 0.5) / size * [cols, rows]).astype(int)}
    return len(cells) < LOW_COVERAGE * rows * cols


CHECKS = {"CAL-UNCERTAIN": uncertain, "CAL-HOLDOUT": noisy, "CAL-FOLD": folds, "CAL-FOCAL": focal, "CAL-FEWVIEWS": few_places,
          "CAL-LOWCOV": low_coverage}
