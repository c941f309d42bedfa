"""Synthetic rigs with known truth: cameras, a board, its places in time, and the corners that the cameras see of it."""

import dataclasses
import math

import numpy as np

import rigid
from lens import Lens, folded, project

SIZES = [(640, 480), (1280, 720), (1280, 960), (1920, 1080)]
BOARDS = [(9, 6), (8, 5), (7, 6), (8, 7), (6, 5)]  # one number odd, one even
VGA, UHD = (640, 480), (3840, 2160)


@dataclasses.dataclass
class Camera:
    name: str
    size: tuple
    lens: Lens
    cam_from_world: tuple
    sigma_px: float = 0.2  # of its corners, per coordinate

    def centre(self):
        return rigid.inverse(self.cam_from_world)[1]


@dataclasses.dataclass
class Board:
    """cols x rows inner corners; bend and stretch as the program describes them (calib/bundle/view.h)."""
    cols: int
    rows: int
    pitch: float
    warp: tuple = (0.0, 0.0)
    stretch: tuple = (0.0, 0.0)

    def corners(self):
        """(N, 3), metres, in board, row by row."""
        row, col = np.divmod(np.arange(self.cols * self.rows), self.cols)
        x = np.stack([col * self.pitch, row * self.pitch, np.zeros(len(row))], axis=-1)
        bend = sum(w * (1 - (2 * k / (n - 1) - 1) ** 2) for w, k, n in zip(self.warp, (col, row), (self.cols, self.rows)))
        shear, aspect = self.stretch
        return np.stack([x[:, 0] * (1 + aspect) + x[:, 1] * shear, x[:, 1] * (1 - aspect) + x[:, 0] * shear, bend], axis=-1)

    def middle(self):
        return np.array([(self.cols - 1) * self.pitch / 2, (self.rows - 1) * self.pitch / 2, 0])

    def width(self):
        return (self.cols - 1) * self.pitch

    def text(self):
        return f"grid:{self.cols}x{self.rows}:{self.pitch:.9g}m"


@dataclasses.dataclass
class Scene:
    cameras: list
    board: Board
    poses: list          # world_from_board at times 0, 1, 2, …
    stride: int = 1      # of the frames' numbers
    partial: bool = False  # boards may reach over the image's border, as ChArUco boards do
    path: object = None    # time -> world_from_board of a board that is carried about

    def pose_at(self, time):
        """world_from_board; between the instants where the board is carried about. The ends hold still."""
        time = min(max(time, 0.0), len(self.poses) - 1.0)
        return self.path(time) if self.path and time != int(time) else self.poses[int(round(time))]

    def frame(self, i):
        return i * self.stride


# ---- cameras -----------------------------------------------------------------------------------------------------------------

def perspective_lens(rng, size, hfov_deg, terms):
    """A Brown lens whose picture grows up to 1.3 times the image's corner."""
    w, h = size
    f = w / 2 / math.tan(math.radians(hfov_deg) / 2)
    reach = 1.3 * math.hypot(w, h) / 2 / f
    r = np.linspace(0, reach, 200)
    while True:
        k1, k2, k3 = rng.uniform(-0.28, 0.03), rng.uniform(-0.02, 0.12), rng.uniform(-0.02, 0.02)
        k = np.array([k1, k2 if terms >= 2 else 0, k3 if terms >= 5 else 0]) if terms else np.zeros(3)
        s = r * r
        if np.all(1 + 3 * k[0] * s + 5 * k[1] * s ** 2 + 7 * k[2] * s ** 3 > 0.2):
            break
    p = rng.normal(0, 4e-4, 2) if terms >= 4 else np.zeros(2)
    distortion = [k[0], k[1], p[0], p[1], k[2]][:terms]
    name = {0: "pinhole", 1: "brown1", 2: "brown2", 4: "brown4", 5: "brown5"}[terms]
    return Lens(name, np.array([*axis_numbers(rng, f, size), *distortion]))


def fisheye_lens(rng, size, fov_deg):
    """An equidistant lens, slightly bent, whose circle of `fov_deg` touches the image's longer sides."""
    k = [rng.uniform(-0.02, 0.01), rng.uniform(-0.003, 0.003), 0.0, 0.0]
    theta = math.radians(fov_deg) / 2
    f = size[0] / 2 / (theta * (1 + k[0] * theta ** 2 + k[1] * theta ** 4))
    return Lens("kannala4", np.array([*axis_numbers(rng, f, size), *k]))


def axis_numbers(rng, f, size):
    middle = (np.array(size) - 1) / 2
    return [f, f * (1 + rng.normal(0, 5e-4)), *(middle + rng.normal(0, 0.008 * size[0], 2))]


def place_cameras(rng, layout, count, radius, aside=0.06):
    """Centres (count, 3) and targets (count, 3), world, z up, the studio's middle at the origin; cameras look past it by about
    `aside` of the radius."""
    if layout == "wall":
        x = (np.arange(count) - (count - 1) / 2) * 0.35 * radius / max(1, count / 4)
        eyes = np.stack([x, np.full(count, -radius), rng.uniform(-0.15, 0.15, count) * radius], axis=-1)
        targets = eyes * [0.8, 0, 0.8]
    else:
        spread = 2 * math.pi * (1 - 1 / count) if layout == "ring" else math.radians(rng.uniform(60, 110))
        angles = np.linspace(-spread / 2, spread / 2, count) + rng.normal(0, 0.05, count) - math.pi / 2
        heights = rng.uniform(-0.25, 0.35, count) * radius
        eyes = np.stack([radius * np.cos(angles), radius * np.sin(angles), heights], axis=-1)
        targets = rng.normal(0, aside * radius, (count, 3))
    return eyes, targets


# ---- boards ------------------------------------------------------------------------------------------------------------------

def board_for(rng, distance, f_over_width, sides=None):
    """A board that fills about a third of the image at that distance, of `sides` corners where given."""
    cols, rows = sides or BOARDS[rng.integers(len(BOARDS))]
    width = 0.3 * distance / max(f_over_width, 0.35)
    return Board(cols, rows, float(f"{width / (cols - 1):.2g}"))


def aim(rng, cameras, board, target, distance_range, tilt_deg=40, roll_deg=35, reach=0.8):
    """A board somewhere in the image of cameras[target], turned to it and to another camera, tilted by up to tilt_deg."""
    camera = cameras[target]
    eye, look = camera.centre(), camera.cam_from_world[0][2]
    lens_fov = field_of(camera)
    angle, spin = reach * lens_fov * math.sqrt(rng.uniform()), rng.uniform(0, 2 * math.pi)
    direction = camera.cam_from_world[0].T @ np.array([math.sin(angle) * math.cos(spin), math.sin(angle) * math.sin(spin), math.cos(angle)])
    middle = eye + direction * rng.uniform(*distance_range)
    others = [c.centre() for i, c in enumerate(cameras) if i != target and np.dot(c.cam_from_world[0][2], look) > -0.2] or [eye]
    second = min(others, key=lambda c: np.linalg.norm(c - eye) * rng.uniform(0.5, 1.5))
    to = [(x - middle) / np.linalg.norm(x - middle) for x in (eye, second)]
    share = rng.uniform(0.35, 1.0)
    normal = share * to[0] + (1 - share) * to[1]
    tilt = math.radians(tilt_deg) * math.sqrt(rng.uniform())
    spin = rng.uniform(0, 2 * math.pi)
    rotation = rigid.facing(normal, math.radians(rng.uniform(-roll_deg, roll_deg)))
    rotation = rotation @ rigid.exp(tilt * np.array([math.cos(spin), math.sin(spin), 0]))
    return rotation, middle - rotation @ board.middle()


def field_of(camera):
    """Half the angle that the image's width spans, rad."""
    f, w = camera.lens.params[0], camera.size[0]
    return w / 2 / f if camera.lens.model in ("kannala4", "ucm") else math.atan(w / 2 / f)


def see(camera, board_points, world_from_board, partial):
    """Exact pixels (N, 2) of the board's corners, NaN where not seen; None when the board counts as not seen."""
    cam_from_board = rigid.compose(camera.cam_from_world, world_from_board)
    x = rigid.apply(cam_from_board, board_points)
    middle = x.mean(axis=0)
    facing = cam_from_board[0][:, 2] @ middle / np.linalg.norm(middle)
    if facing < 0.34:
        return None
    px = project(camera.lens, x)
    px[outside(camera, px) | folded(camera.lens, x)] = np.nan
    if camera.lens.model == "kannala4":
        beyond = np.arctan2(np.hypot(x[:, 0], x[:, 1]), x[:, 2]) > field_of(camera) * 1.02
        px[beyond] = np.nan
    found = np.isfinite(px[:, 0]).sum()
    return px if found == len(px) or (partial and found >= max(12, 0.4 * len(px))) else None


def outside(camera, px, margin=3):
    with np.errstate(invalid="ignore"):
        return ~((px >= margin) & (px <= np.array(camera.size) - 1 - margin)).all(axis=-1)


def num_seen(scene_cameras, board, pose, partial):
    points = board.corners()
    return [see(c, points, pose, partial) is not None for c in scene_cameras]


def film(rng, cameras, board, count, distance_range, partial, tilt_deg=40, alone=0.15):
    """`count` places of the board, each seen by two cameras or, now and then, by one; every camera gets its share."""
    poses, seen = [], np.zeros(len(cameras), int)
    for _ in range(200 * count):
        if len(poses) == count:
            return poses
        target = int(np.argmin(seen + rng.uniform(0, 1 + seen.mean() / 3, len(seen))))
        pose = aim(rng, cameras, board, target, distance_range, tilt_deg)
        sees = np.array(num_seen(cameras, board, pose, partial))
        if sees.sum() >= 2 or (sees[target] and rng.uniform() < alone / 10):
            poses.append(pose)
            seen += sees
    raise RuntimeError("this studio does not see its board often enough")


def short_way(keys):
    """The places in an order in which each is followed by the nearest of the rest."""
    order, rest = [keys[0]], list(keys[1:])
    while rest:
        k = int(np.argmin([np.linalg.norm(key[1] - order[-1][1]) for key in rest]))
        order.append(rest.pop(k))
    return order


def path_through(keys, per_key):
    """A smooth motion through the key places, `per_key` instants from one to the next: time -> world_from_board."""
    last = len(keys) - 1

    def at(time):
        k = min(int(time / per_key), last - 1)
        t = time / per_key - k
        p = [keys[min(max(k + j, 0), last)][1] for j in (-1, 0, 1, 2)]
        x = 0.5 * (2 * p[1] + (p[2] - p[0]) * t + (2 * p[0] - 5 * p[1] + 4 * p[2] - p[3]) * t * t +
                   (3 * p[1] - p[0] - 3 * p[2] + p[3]) * t ** 3)
        return rigid.blend(keys[k][0], keys[k + 1][0], t * t * (3 - 2 * t)), x
    return at
