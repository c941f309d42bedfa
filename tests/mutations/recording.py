"""What a studio records: corners of a board by camera and frame, written as a corner file for `mvstudio calibrate`."""

import copy
import dataclasses
import json
import math

import numpy as np

import rigid
import studio
from lens import Lens, param_names, project


@dataclasses.dataclass
class Recording:
    """Corners with their truth; mutations change one thing of it."""
    scene: studio.Scene
    corners: dict                      # (camera index, frame number) -> (N, 2) px, NaN where not found
    board_text: str = ""               # what the program is told of the board
    told_points: np.ndarray = None     # the board's corners as told, in board
    judged: dict = None                # the corners with their right numbers, where all in the file are renumbered
    truths: list = None                # each a list of cameras; the result is right when it fits one of them
    scale: float = 1.0                 # told unit of length over the true one
    culprits: list = dataclasses.field(default_factory=list)   # names of the cameras at fault; one must be named
    arguments: list = dataclasses.field(default_factory=list)  # more flags; {folder} stands for the recording's folder
    files: dict = dataclasses.field(default_factory=dict)      # name -> text, beside the corner file
    format: str = "vnl"
    edit: object = None                # text of the corner file -> text
    order: list = None                 # order of the images in the file
    empty: list = dataclasses.field(default_factory=list)      # cameras that are listed without corners
    names: dict = None                 # camera index -> name in the file
    sizes: dict = None                 # camera index -> size that the program is told
    second: dict = None                # corners of a second board like the first, as `corners`; csv only

    def __post_init__(self):
        self.board_text = self.board_text or self.scene.board.text()
        if self.told_points is None:
            flat = studio.Board(self.scene.board.cols, self.scene.board.rows, self.scene.board.pitch)
            self.told_points = flat.corners()
        self.truths = self.truths or [self.scene.cameras]

    def name_of(self, c):
        return (self.names or {}).get(c, self.scene.cameras[c].name)

    def size_of(self, c):
        return (self.sizes or {}).get(c, self.scene.cameras[c].size)

    def used(self):
        return sorted({c for c, _ in self.corners})

    def extension(self):
        return self.format

    def text(self):
        text = vnl_text(self) if self.format == "vnl" else csv_text(self)
        return self.edit(text) if self.edit else text

    def size_arguments(self):
        if self.format == "csv":
            return []
        sizes = []
        for c in sorted(set(self.used()) | set(self.empty)):
            w, h = self.size_of(c)
            sizes += ["--size", f"{self.name_of(c)}={w}x{h}"]
        return sizes

    def num_views(self, camera):
        return sum(c == camera for c, _ in self.corners)


def vnl_text(rec):
    lines = ["# filename x y level"]
    for key in rec.order or sorted(rec.corners):
        image = f"{rec.name_of(key[0])}-{key[1]:05d}.png"
        for x, y in rec.corners[key]:
            lines.append(f"{image} {x:.4f} {y:.4f} 0" if np.isfinite(x) else f"{image} - - -")
    lines += [f"{rec.name_of(c)}-{i:05d}.png - - -" for c in rec.empty for i in range(5)]
    return "\n".join(lines) + "\n"


def csv_text(rec):
    lines = ["# mvstudio corners 1"]
    for c in sorted(set(rec.used()) | set(rec.empty)):
        w, h = rec.size_of(c)
        lines.append(f"# camera {w}x{h} {rec.name_of(c)}")
    boards = [rec.corners] + ([rec.second] if rec.second else [])
    lines += [f"# board {b} {rec.board_text}" for b in range(len(boards)) if "{" not in rec.board_text]
    lines.append("camera,frame,board,corner,x_px,y_px")
    for b, corners in enumerate(boards):
        for key in (rec.order if b == 0 and rec.order else sorted(corners)):
            lines += [f"{rec.name_of(key[0])},{key[1]},{b},{i},{x:.4f},{y:.4f}"
                      for i, (x, y) in enumerate(corners[key]) if np.isfinite(x)]
    return "\n".join(lines) + "\n"


# ---- observing ---------------------------------------------------------------------------------------------------------------

def observe(rng, scene, camera_at=None, time_of=None, board_at=None, readout=0.0, blur=0.0, shared_noise=None):
    """Corners by (camera, frame). camera_at(c, i) is the camera at instant i, time_of(c, i) the time that its frame i shows,
    board_at(i) the board. `readout`: rolling shutter, in frames; `blur`: px of noise along the motion for each px of it;
    shared_noise(c, i) -> (N, 2) px is added."""
    corners = {}
    for c, default in enumerate(scene.cameras):
        for i in range(len(scene.poses)):
            camera = camera_at(c, i) if camera_at else default
            time = time_of(c, i) if time_of else float(i)
            points = (board_at(i) if board_at else scene.board).corners()
            px = studio.see(camera, points, scene.pose_at(time), scene.partial)
            if px is None:
                continue
            if readout:
                px = rolled(scene, camera, points, time, readout, px)
            noise = rng.normal(0, camera.sigma_px, px.shape)
            if blur:
                noise += blur * rng.normal(0, 1, (len(px), 1)) * motion(scene, camera, points, time)
            if shared_noise:
                noise += shared_noise(c, i)
            corners[(c, scene.frame(i))] = px + noise
    return corners


def pixels(scene, camera, points, time):
    return project(camera.lens, rigid.apply(rigid.compose(camera.cam_from_world, scene.pose_at(time)), points))


def motion(scene, camera, points, time):
    """px per frame (N, 2)."""
    h = 0.02
    return np.nan_to_num(pixels(scene, camera, points, time + h) - pixels(scene, camera, points, time - h)) / (2 * h)


def rolled(scene, camera, points, time, readout, px):
    """Pixels with a shutter that runs over the image in `readout` frames; the middle row is exposed at `time`."""
    share = np.linspace(-0.6, 0.6, 25)
    paths = np.array([pixels(scene, camera, points, time + readout * s) for s in share])
    out = px.copy()
    for k in np.flatnonzero(np.isfinite(paths).all(axis=(0, 2)) & np.isfinite(px[:, 0])):
        late = paths[:, k, 1] / camera.size[1] - 0.5 - share  # falls with the share, zero when the shutter meets the corner
        when = np.interp(0, -late, share)
        out[k] = [np.interp(when, share, paths[:, k, axis]) for axis in range(2)]
    return out


# ---- scenes ------------------------------------------------------------------------------------------------------------------

def make_cameras(rng, count, layout, radius, sizes, lens, sigma, hfov):
    aside = min(0.06, 0.15 * math.tan(math.radians(min(hfov[0], 90) / 2)))
    eyes, targets = studio.place_cameras(rng, layout, count, radius, aside)
    size = studio.SIZES[rng.integers(len(studio.SIZES))]
    same, terms = rng.uniform() < 0.3, int(rng.choice([1, 2, 4, 5]))
    angle = rng.uniform(*hfov)
    cameras = []
    for c in range(count):
        own = sizes[c % len(sizes)] if sizes else size
        if lens == "fisheye":
            made = studio.fisheye_lens(rng, own, hfov[0] if hfov[0] == hfov[1] else rng.uniform(*hfov))
        else:
            made = studio.perspective_lens(rng, own, angle * rng.uniform(0.9, 1.1), terms)
        if same and cameras and own == cameras[0].size:
            made = Lens(cameras[0].lens.model, cameras[0].lens.params.copy())
        pose = rigid.look_at(eyes[c], targets[c], rng.normal(0, 0.05))
        cameras.append(studio.Camera(f"cam{c}", own, made, pose, sigma))
    return cameras


def make_scene(rng, count=None, frames=None, layout=None, video=False, sizes=None, lens="perspective", sigma=None, hfov=(45, 75),
               radius=None, near_far=(0.55, 1.15), tilt_deg=40, partial=None, least=None, sides=None):
    count = count or int(rng.integers(4, 6))
    frames = frames or int(rng.integers(34, 51))
    layout = layout or str(rng.choice(["arc", "wall", "arc"]))
    radius = radius or rng.uniform(1.5, 4)
    sigma = sigma or rng.uniform(0.1, 0.5)
    partial = bool(rng.uniform() < 0.5) if partial is None else partial
    for _ in range(20):
        cameras = make_cameras(rng, count, layout, radius, sizes, lens, sigma, hfov)
        f_over_width = min(c.lens.params[0] / c.size[0] for c in cameras)
        board = studio.board_for(rng, radius, f_over_width, sides)
        reach = (near_far[0] * radius, near_far[1] * radius)
        try:
            if video:
                keys = studio.film(rng, cameras, board, frames // 6 + 2, reach, True, tilt_deg)
                path = studio.path_through(studio.short_way(keys), 6)
                scene = studio.Scene(cameras, board, [path(float(i)) for i in range(frames)], 1, True, path)
            else:
                poses = studio.film(rng, cameras, board, frames, reach, partial, tilt_deg)
                scene = studio.Scene(cameras, board, poses, int(rng.choice([1, 10])), partial)
            if enough(scene, least or min(15, frames // 4)):
                return scene
        except RuntimeError:
            continue
    raise RuntimeError("no studio of this kind sees its board often enough")


def enough(scene, least):
    """Whether every camera sees the board often enough, most of the times together with another."""
    seen = np.array([studio.num_seen(scene.cameras, scene.board, pose, scene.partial) for pose in scene.poses])
    shared = seen[seen.sum(axis=1) >= 2]
    return bool(len(shared) and shared.sum(axis=0).min() >= least)


def make(rng, **options):
    """A recording in which nothing is wrong."""
    scene = make_scene(rng, **options)
    return Recording(scene, observe(rng, scene))


# ---- seeds -------------------------------------------------------------------------------------------------------------------

def calibration_text(cameras):
    """A calibration file (docs/formats.md) of these cameras."""
    def entry(camera):
        rotation, translation = camera.cam_from_world
        return {"name": camera.name, "size_px": list(camera.size), "model": camera.lens.model,
                "intrinsics": dict(zip(param_names(camera.lens.model), map(float, camera.lens.params))),
                "cam_from_world": {"rotation_xyzw": list(map(float, rigid.quaternion(rotation))),
                                   "translation": list(map(float, translation))}}
    return json.dumps({"schema": "mvstudio.calibration/1", "unit": "m", "cameras": [entry(c) for c in cameras]}, indent=1)


def altered(camera, lens=None, cam_from_world=None, **changes):
    other = copy.copy(camera)
    other.lens = lens or camera.lens
    other.cam_from_world = cam_from_world or camera.cam_from_world
    for key, value in changes.items():
        setattr(other, key, value)
    return other


def without(corners, keep):
    return {key: px for key, px in corners.items() if keep(*key)}
