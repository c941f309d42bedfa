"""A calibration against the truth: every stated quantity with its error and its own standard deviation, in the program's gauge."""

import dataclasses
import math
from statistics import NormalDist

import numpy as np

import rigid
from lens import Lens, axis_of, axis_sigmas, folded, param_names, project, rays

FAMILY = 0.0027  # chance that a single normal error exceeds three standard deviations
PIXEL_SHARE = 14  # a lens and a pose: so many independent directions has the error of a camera's projections, at most


@dataclasses.dataclass
class Quantity:
    camera: str
    kind: str      # focal, centre, rotation, translation, pixel
    error: float
    sigma: float

    def z(self):
        return abs(self.error) / self.sigma if self.sigma > 0 else math.inf


@dataclasses.dataclass
class BorderErrors:
    """Largest errors px; infinite where the true lens has a ray and the estimate has none, zero where the true one has none."""
    side: float = 0.0     # 95 % of the way from the image's middle to its sides' middles, as the program states its sigmas
    corner: float = 0.0   # 95 % of the way to its corners
    folded: bool = False  # a corner of the image lies beyond the fold of the estimated lens, or of the true one


@dataclasses.dataclass
class Comparison:
    """`worst` over its limit (1: just right); `why` names the quantity."""
    right: bool
    worst: float
    why: str
    quantities: list        # all but pixels
    pixels: dict            # camera -> (errors (N, 2) px, sigmas (N,) px, within the boards' cells (N,))
    inside_only: bool       # right where boards were seen, wrong elsewhere
    pixels_right: bool      # projections are right where boards were seen, whatever lens and pose are
    borders: dict = dataclasses.field(default_factory=dict)  # camera -> BorderErrors

    def worst_pixel(self):
        errors = [np.linalg.norm(e, axis=1).max() for e, _, _ in self.pixels.values() if len(e)]
        return max(errors) if errors else math.nan


# ---- reading -----------------------------------------------------------------------------------------------------------------

@dataclasses.dataclass
class Estimate:
    name: str
    lens: Lens
    cam_from_world: tuple
    lens_covariance: np.ndarray = None
    pose_covariance: np.ndarray = None


def read_lens(entry):
    values = entry["intrinsics"]
    if entry["model"] == "splined":
        first = [values[k] for k in ("fx", "fy", "cx", "cy")]
        return Lens("splined", np.array(first + values["control_points"], float), entry["spline"])
    return Lens(entry["model"], np.array([values[k] for k in param_names(entry["model"])], float))


def read_rig(calibration):
    rig = {}
    for entry in calibration["cameras"]:
        pose = entry["cam_from_world"]
        covariance = [np.array(entry[k], float) if k in entry else None
                      for k in ("intrinsics_covariance", "cam_from_world_covariance")]
        rig[entry["name"]] = Estimate(entry["name"], read_lens(entry),
                                      (rigid.from_quaternion(pose["rotation_xyzw"]), np.array(pose["translation"], float)), *covariance)
    return rig


def told_board(recording, metrics):
    """The board's corners with the bend and stretch that the program found."""
    points = recording.told_points.copy()
    flat = points.copy()
    warp = metrics.get("board_warp_mm") or [0, 0]
    for axis in range(2):
        low, high = flat[:, axis].min(), flat[:, axis].max()
        points[:, 2] += 1e-3 * (warp[axis] or 0) * (1 - ((flat[:, axis] - (low + high) / 2) / ((high - low) / 2)) ** 2)
    stretch = metrics.get("board_stretch")
    if stretch:
        points[:, 0] += stretch["aspect"] * flat[:, 0] + stretch["shear"] * flat[:, 1]
        points[:, 1] += stretch["shear"] * flat[:, 0] - stretch["aspect"] * flat[:, 1]
    return points


# ---- boards' places by the estimated rig ---------------------------------------------------------------------------------------

def fit_board(views, points, start, steps=12):
    """world_from_board that explains `views` [(estimate, px (N, 2), sigma px)], robustly, and its rms in standard deviations; None
    where it is not determined."""
    pose = start

    def residuals(at):
        parts = []
        for camera, px, sigma in views:
            seen = np.isfinite(px[:, 0])
            x = rigid.apply(camera.cam_from_world, rigid.apply(at, points[seen]))
            parts.append(((px[seen] - project(camera.lens, x)) / sigma).ravel())
        return np.concatenate(parts)

    r = residuals(pose)
    if not np.isfinite(r).all() or len(r) < 16:
        return None
    scale = np.linalg.norm(points.max(0) - points.min(0))
    for _ in range(steps):
        columns = []
        for k in range(6):
            h = np.zeros(6)
            h[k] = 1e-6 * (1 if k < 3 else scale)
            columns.append((r - residuals(moved(pose, h, points))) / h[k])
        jacobian = np.stack(columns, axis=-1)
        weights = 1 / (1 + (r / max(2, 1.5 * np.median(np.abs(r)))) ** 2)
        if not np.isfinite(jacobian).all():
            return None
        normal = jacobian.T @ (weights[:, None] * jacobian)
        unit = 1 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
        step = unit * np.linalg.lstsq(unit[:, None] * normal * unit, unit * (jacobian.T @ (weights * r)), rcond=1e-12)[0]
        trial = moved(pose, step, points)
        now = residuals(trial)
        if not np.isfinite(now).all():
            return None
        pose, r = trial, now
        if np.linalg.norm(step[3:]) < 1e-7 * scale and np.linalg.norm(step[:3]) < 1e-7:
            break
    return pose, math.sqrt(np.mean(r * r))


def moved(pose, delta, points):
    """The board turned about its middle (in its own frame) and shifted."""
    middle = points.mean(axis=0)
    rotation = pose[0] @ rigid.exp(delta[:3])
    return rotation, pose[1] + pose[0] @ middle - rotation @ middle + delta[3:]


def mean_frames(recording, rig, metrics, est_from_true):
    """(3, 4): a point at rest with the boards, from the true world to the estimated one (docs of ProjectionUncertainty)."""
    points = told_board(recording, metrics)
    sigmas = {c["name"]: c.get("sigma_px") or 1.0 for c in metrics["cameras"]}
    late = {c["name"] for c in metrics["cameras"] if c.get("time_offset_frames")}
    shift = metrics.get("frame_shift") or [0] * len(metrics["cameras"])
    shifts = {c["name"]: s for c, s in zip(metrics["cameras"], shift)}
    scene, motions, errors = recording.scene, [], []
    corners = recording.judged or recording.corners
    for i in range(len(scene.poses)):
        views = []
        for c in range(len(scene.cameras)):
            name = recording.name_of(c)
            px = corners.get((c, scene.frame(i) - shifts.get(name, 0)))
            if px is not None and name in rig and name not in late and len(px) == len(points):
                views.append((rig[name], px, sigmas.get(name, 1.0)))
        true = scene.poses[i][0], scene.poses[i][1] * recording.scale
        fit = fit_board(views, points, rigid.compose(est_from_true, true)) if views else None
        if fit:
            motions.append(np.column_stack(rigid.compose(fit[0], rigid.inverse(true))))
            errors.append(fit[1])
    if not motions:
        return np.column_stack(est_from_true)
    errors = np.array(errors)
    keep = errors <= max(6.0, 3 * np.median(errors))
    return np.mean(np.array(motions)[keep], axis=0)


# ---- quantities ---------------------------------------------------------------------------------------------------------------

def gauge_camera(metrics):
    text = metrics.get("gauge") or ""
    return text[len("camera "):] if text.startswith("camera ") else None


def lens_quantities(estimate, true):
    if estimate.lens_covariance is None:
        return []
    sigmas = axis_sigmas(estimate.lens, estimate.lens_covariance)
    errors = np.concatenate(axis_of(estimate.lens)) - np.concatenate(axis_of(true.lens))
    kinds = ["focal", "focal", "centre", "centre"]
    return [Quantity(true.name, k, e, s) for k, e, s in zip(kinds, errors, sigmas) if s > 0]


def pose_quantities(estimate, cam_from_gauge):
    """Perturbation (rotation, translation) on the left that leads from the truth to the estimate."""
    if estimate.pose_covariance is None:
        return []
    error = np.concatenate([rigid.log(estimate.cam_from_world[0] @ cam_from_gauge[0].T),
                            estimate.cam_from_world[1] - cam_from_gauge[1]])
    sigmas = np.sqrt(np.maximum(0, np.diag(estimate.pose_covariance)))
    kinds = ["rotation"] * 3 + ["translation"] * 3
    return [Quantity(estimate.name, k, e, s) for k, e, s in zip(kinds, error, sigmas) if s > 0]


def pixel_errors(true, estimate, report, range_m, est_from_true, scale):
    """Errors (N, 2), sigmas (N,) and whether a board was seen there (N,), over the map that the program states."""
    sigmas = np.array(report["uncertainty_map_px"], float)
    rows, cols = sigmas.shape
    w, h = true.size
    v, u = np.meshgrid(np.linspace(0, h - 1, rows), np.linspace(0, w - 1, cols), indexing="ij")
    px = np.stack([u.ravel(), v.ravel()], axis=-1)
    errors = errors_at(px, true, estimate, range_m, est_from_true, scale)
    cells = np.array(report["coverage_cells"])
    seen = cells[np.clip((px[:, 1] + 0.5) * cells.shape[0] / h, 0, cells.shape[0] - 1).astype(int),
                 np.clip((px[:, 0] + 0.5) * cells.shape[1] / w, 0, cells.shape[1] - 1).astype(int)] > 0
    ok = np.isfinite(rays(true.lens, px)).all(axis=1) & np.isfinite(sigmas.ravel()) & (sigmas.ravel() > 0)
    errors[~np.isfinite(errors)] = 1e9  # a pixel with a stated sigma, whose point the estimated lens does not see
    return errors[ok], sigmas.ravel()[ok], seen[ok]


def errors_at(px, true, estimate, range_m, est_from_true, scale):
    """(N, 2): where the estimate sees the points that truly lie behind `px`, less `px`; NaN where either lens has no ray."""
    x_in_true = rigid.apply(rigid.inverse((true.cam_from_world[0], true.cam_from_world[1] * scale)), range_m * rays(true.lens, px))
    x_in_est = x_in_true @ est_from_true[:, :3].T + est_from_true[:, 3]
    return project(estimate.lens, rigid.apply(estimate.cam_from_world, x_in_est)) - px


def border_errors(true, estimate, range_m, est_from_true, scale):
    middle = (np.array(true.size) - 1) / 2
    sides = np.array([(1, 0), (-1, 0), (0, 1), (0, -1)])
    corners = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])

    def largest(aside):
        px = middle + aside * middle
        errors = np.linalg.norm(errors_at(px, true, estimate, range_m, est_from_true, scale), axis=1)
        errors[~np.isfinite(errors)] = math.inf
        errors[~np.isfinite(rays(true.lens, px)).all(axis=1)] = 0
        return float(errors.max())
    seen = rays(true.lens, middle + corners * middle)
    there = np.isfinite(seen).all(axis=1)
    beyond = not there.all() or bool(np.any(folded(estimate.lens, seen[there])))
    return BorderErrors(largest(0.95 * sides), largest(0.95 * corners), beyond)


def limits(quantities, pixels):
    """Limits in standard deviations that a right calibration exceeds somewhere as rarely as one number exceeds three sigmas: for
    a number, and for the length of a pixel's error over the sigma of its worst direction."""
    n = max(1, len(quantities) + PIXEL_SHARE * len(pixels))
    return NormalDist().inv_cdf(1 - FAMILY / 2 / n), math.sqrt(-2 * math.log(FAMILY / n))


def est_world_from_true(rig, true_cam_from_world, gauge):
    """The camera that is the gauge is where the program put it; without one the world is that of the given calibration."""
    if gauge not in true_cam_from_world or gauge not in rig:
        return np.eye(3), np.zeros(3)
    return rigid.compose(rigid.inverse(rig[gauge].cam_from_world), true_cam_from_world[gauge])


def compare(recording, truth, calibration, metrics):
    """The calibration against one list of true cameras."""
    rig = read_rig(calibration)
    by_name = {recording.name_of(c): camera for c, camera in enumerate(truth)}
    scale = recording.scale
    gauge = gauge_camera(metrics)
    scaled = {n: (c.cam_from_world[0], c.cam_from_world[1] * scale) for n, c in by_name.items()}
    est_from_true = est_world_from_true(rig, scaled, gauge)
    mean = mean_frames(recording, rig, metrics, est_from_true)
    reports = {c["name"]: c for c in metrics["cameras"]}
    ranges = {c["name"]: c["range_m"] for c in metrics["uncertainty"]["cameras"]}
    quantities, pixels, borders = [], {}, {}
    for name, estimate in rig.items():
        quantities += lens_quantities(estimate, by_name[name])
        quantities += pose_quantities(estimate, rigid.compose(scaled[name], rigid.inverse(est_from_true)))
        if reports[name].get("uncertainty_map_px") and ranges.get(name):
            pixels[name] = pixel_errors(by_name[name], estimate, reports[name], ranges[name], mean, scale)
            borders[name] = border_errors(by_name[name], estimate, ranges[name], mean, scale)
    return dataclasses.replace(conclude(quantities, pixels), borders=borders)


def conclude(quantities, pixels):
    z_limit, pixel_limit = limits(quantities, pixels)
    found = [(q.z() / z_limit, f"{q.camera} {q.kind}: {q.error:.3g} at sigma {q.sigma:.2g}") for q in quantities]
    outside = []
    for name, (errors, sigmas, seen) in pixels.items():
        ratio = np.linalg.norm(errors, axis=1) / sigmas / pixel_limit
        for part, where, into in ((seen, "", found), (~seen, " where no board was", outside)):
            if part.any():
                k = np.flatnonzero(part)[np.argmax(ratio[part])]
                text = f"{name} pixel{where}: {np.linalg.norm(errors[k]):.3g} px at sigma {sigmas[k]:.2g}"
                into.append((ratio[k], text))
    pixels_right = all(r <= 1 for r, text in found[len(quantities):])
    found = [(math.inf if math.isnan(r) else r, text) for r, text in found] or [(math.inf, "nothing is stated")]
    worst_inside = max(found)
    worst = max([worst_inside] + outside)
    right, inside = bool(worst[0] <= 1), bool(worst_inside[0] <= 1)
    return Comparison(right, float(worst[0]), worst[1], quantities, pixels, inside and not right, pixels_right)


def best_comparison(recording, calibration, metrics):
    """Against each of the truths that the recording allows; the one that fits best."""
    return min((compare(recording, truth, calibration, metrics) for truth in recording.truths), key=lambda c: c.worst)
