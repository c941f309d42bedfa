"""Lens models of docs/formulation.md in numpy, independent of the program: projection, rays, focal length on the axis."""

import dataclasses

import numpy as np

PERSPECTIVE = {"pinhole": 0, "brown1": 1, "brown2": 2, "brown4": 4, "brown5": 5, "rational8": 8, "thinprism12": 12}
WIDE = {"kannala4": 4, "ucm": 1, "eucm": 2, "doublesphere": 2}
# Names of the distortion parameters in the calibration file, in order.
BROWN_NAMES = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4"]
WIDE_NAMES = {"kannala4": ["k1", "k2", "k3", "k4"], "ucm": ["xi"], "eucm": ["alpha", "beta"], "doublesphere": ["xi", "alpha"]}


@dataclasses.dataclass
class Lens:
    """A lens; params are fx, fy, cx, cy (px) and the distortion in the order of docs/formulation.md."""
    model: str
    params: np.ndarray
    spline: dict = None  # order, cols, rows, fov_x_deg of `splined`

    def with_params(self, params):
        return Lens(self.model, np.asarray(params, float), self.spline)


def base_of(model):
    """The model without decentring, and whether it has it."""
    return (model[:-2], True) if model.endswith("_p") else (model, False)


def param_names(model):
    base, decentred = base_of(model)
    names = BROWN_NAMES[:PERSPECTIVE[base]] if base in PERSPECTIVE else WIDE_NAMES[base]
    return ["fx", "fy", "cx", "cy"] + names + (["p1", "p2"] if decentred else [])


def decentre(a, b, p1, p2):
    s = a * a + b * b
    return a + 2 * p1 * a * b + p2 * (s + 2 * a * a), b + p1 * (s + 2 * b * b) + 2 * p2 * a * b


def perspective_plane(x, d):
    """Normalised image coordinates of points (..., 3) behind a lens with up to 12 coefficients."""
    k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4 = np.concatenate([d, np.zeros(12 - len(d))])
    z = np.where(x[..., 2] > 0, x[..., 2], np.nan)
    a, b = x[..., 0] / z, x[..., 1] / z
    s = a * a + b * b
    scale = (1 + s * (k1 + s * (k2 + s * k3))) / (1 + s * (k4 + s * (k5 + s * k6)))
    return (a * scale + 2 * p1 * a * b + p2 * (s + 2 * a * a) + s * (s1 + s * s2),
            b * scale + p1 * (s + 2 * b * b) + 2 * p2 * a * b + s * (s3 + s * s4))


def wide_denominator(base, x, d):
    """Q of docs/formulation.md: (x, y) / Q is the picture."""
    rho, dist, z = np.hypot(x[..., 0], x[..., 1]), np.linalg.norm(x, axis=-1), x[..., 2]
    if base == "kannala4":
        theta = np.arctan2(rho, z)
        t2 = theta * theta
        picture = theta * (1 + t2 * (d[0] + t2 * (d[1] + t2 * (d[2] + t2 * d[3]))))
        near = rho < 1e-9 * dist
        return np.where(near, np.where(z > 0, z, np.nan), rho / np.where(near, 1, picture))
    if base == "ucm":
        return z + d[0] * dist
    if base == "eucm":
        return d[0] * np.sqrt(d[1] * rho * rho + z * z) + (1 - d[0]) * z
    w = z + d[0] * dist
    return d[1] * np.hypot(rho, w) + (1 - d[1]) * w


def wide_plane(base, x, d):
    q = wide_denominator(base, x, d)
    q = np.where(q > 0, q, np.nan)
    return x[..., 0] / q, x[..., 1] / q


def spline_weights(order, t):
    if order == 3:
        return [(1 - t) ** 3 / 6, (3 * t ** 3 - 6 * t ** 2 + 4) / 6, (-3 * t ** 3 + 3 * t ** 2 + 3 * t + 1) / 6, t ** 3 / 6]
    return [(1 - 2 * t) ** 2 / 8, 3 / 4 - t ** 2, (1 + 2 * t) ** 2 / 8]


def spline_plane(x, lens):
    grid = lens.spline
    order, cols, rows = grid["order"], grid["cols"], grid["rows"]
    control = lens.params[4:].reshape(rows, cols, 2)
    u = 2 * x[..., :2] / (np.linalg.norm(x, axis=-1) + x[..., 2])[..., None]
    step = 2 * 2 * np.tan(np.radians(grid["fov_x_deg"]) / 4) / (cols - order)
    at = u / step + (np.array([cols, rows]) - 1) / 2
    at = np.where(np.isfinite(at), at, -9)
    cell = np.floor(at) if order == 3 else np.round(at)
    first = cell.astype(int) - 1
    inside = np.all((first >= 0) & (first + order < [cols, rows]), axis=-1)
    first = np.clip(first, 0, np.array([cols, rows]) - order - 1)
    wx, wy = (spline_weights(order, (at - cell)[..., k]) for k in range(2))
    shift = sum(wx[i][..., None] * wy[j][..., None] * control[first[..., 1] + j, first[..., 0] + i]
                for i in range(order + 1) for j in range(order + 1))
    plane = np.where(inside[..., None], u + shift, np.nan)
    return plane[..., 0], plane[..., 1]


def project(lens, x_in_cam):
    """Pixels (..., 2) of points (..., 3) in cam; NaN where the lens has no picture of them."""
    x = np.asarray(x_in_cam, float)
    base, decentred = base_of(lens.model)
    with np.errstate(all="ignore"):
        if lens.model == "splined":
            a, b = spline_plane(x, lens)
        elif base in PERSPECTIVE:
            a, b = perspective_plane(x, lens.params[4:4 + PERSPECTIVE[base]])
        else:
            a, b = wide_plane(base, x, lens.params[4:4 + WIDE[base]])
        if decentred:
            a, b = decentre(a, b, *lens.params[-2:])
        fx, fy, cx, cy = lens.params[:4]
        return np.stack([fx * a + cx, fy * b + cy], axis=-1)


def folded(lens, x_in_cam):
    """Points (..., 3) so far aside that a perspective lens's polynomial has turned back: no lens shows them there."""
    base, _ = base_of(lens.model)
    if base not in PERSPECTIVE or PERSPECTIVE[base] == 0:
        return np.zeros(np.shape(x_in_cam)[:-1], bool)
    k1, k2, _, _, k3, k4, k5, k6 = np.concatenate([lens.params[4:4 + PERSPECTIVE[base]], np.zeros(12)])[:8]
    r = np.linspace(0, 20, 4001)
    s = r * r
    picture = r * (1 + s * (k1 + s * (k2 + s * k3))) / (1 + s * (k4 + s * (k5 + s * k6)))
    turned = np.flatnonzero(np.diff(picture) <= 0)
    limit = r[turned[0]] if len(turned) else np.inf
    x = np.asarray(x_in_cam, float)
    with np.errstate(all="ignore"):
        return np.hypot(x[..., 0], x[..., 1]) / x[..., 2] > limit


def rays(lens, px):
    """Unit rays (N, 3) of pixels (N, 2), before the picture folds; NaN where there is none."""
    px = np.asarray(px, float)
    f, centre = axis_of(lens)
    picture = (px - centre) / f
    found = np.full((len(px), 3), np.nan)
    for share in (1, 0.5, 0.2, 0):  # of the picture, where Newton's method starts
        left = np.isnan(found[:, 0])
        if left.any():
            found[left] = newton_rays(lens, px[left], share * picture[left])
    return found


def newton_rays(lens, px, start, steps=60):
    """By Newton's method on the stereographic plane; NaN where it ends elsewhere, or beyond the fold."""
    u = np.clip(start, -1.9, 1.9)
    for _ in range(steps):
        here = project(lens, from_stereographic(u)) - px
        h = 1e-6
        jacobian = np.stack([(project(lens, from_stereographic(u + np.eye(2)[k] * h)) - px - here) / h for k in range(2)], axis=-1)
        bad = ~np.isfinite(jacobian).all(axis=(-1, -2)) | (np.abs(np.linalg.det(np.nan_to_num(jacobian))) < 1e-9)
        jacobian[bad] = np.eye(2)
        step = np.linalg.solve(jacobian, np.nan_to_num(here)[..., None])[..., 0]
        length = np.linalg.norm(step, axis=-1, keepdims=True)
        step *= np.minimum(1, 0.3 / np.maximum(length, 1e-12))
        u = np.where(bad[:, None] | ~np.isfinite(here), u * 0.9, u - step)
    ray = from_stereographic(u)
    ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
    miss = np.linalg.norm(project(lens, ray) - px, axis=-1)
    ray[~(miss < 1e-5) | folded(lens, ray)] = np.nan
    return ray


def from_stereographic(u):
    return np.concatenate([u, 1 - (u * u).sum(-1, keepdims=True) / 4], axis=-1)


def axis_of(lens):
    """Focal length (2,) px per radian at the optical axis and the pixel (2,) of the axis: the same for every family of models."""
    h = 1e-6
    points = np.array([[h, 0, 1], [-h, 0, 1], [0, h, 1], [0, -h, 1]])
    px = project(lens, points)
    focal = np.array([px[0, 0] - px[1, 0], px[2, 1] - px[3, 1]]) / (2 * h)
    return focal, (px[0] + px[1] + px[2] + px[3]) / 4


def axis_sigmas(lens, covariance):
    """Standard deviations of axis_of (focal x, y, centre x, y) by the covariance of the parameters."""
    def stacked(params):
        return np.concatenate(axis_of(lens.with_params(params)))
    columns = []
    for k in range(len(lens.params)):
        h = np.zeros(len(lens.params))
        h[k] = 1e-4 if k < 4 else 1e-5
        columns.append((stacked(lens.params + h) - stacked(lens.params - h)) / (2 * h[k]))
    jacobian = np.stack(columns, axis=-1)
    return np.sqrt(np.maximum(0, np.diag(jacobian @ covariance @ jacobian.T)))
