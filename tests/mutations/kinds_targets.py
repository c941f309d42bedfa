"""Boards that look the same after a turn, several boards, targets in space; corners at the wrong camera or the wrong edge."""

import numpy as np

import rigid
import studio
from kinds_board import BOARD, NUMBERING, OUTLIERS, grid_of
from kinds_time import FRAMES, VIDEO, someone
from recording import Recording, altered, make, make_scene, observe
from registry import kind


# ---- boards that look the same after a turn --------------------------------------------------------------------------------------

def quarter_turned(board, px, quarters):
    """The corners numbered from another end of a board; odd quarters need as many columns as rows."""
    return px[np.rot90(grid_of(board), quarters).ravel()]


def turned_views(rng, scene, quarters_of, corners=None):
    """The views of a camera numbered by quarters_of() quarter turns; right is the file with its right numbers."""
    c = someone(rng, scene)
    right = corners or observe(rng, scene)
    corners = {key: quarter_turned(scene.board, px, quarters_of()) if key[0] == c else px for key, px in right.items()}
    return Recording(scene, corners, judged=right, culprits=[scene.cameras[c].name])


def rolled(camera, quarters):
    turn = rigid.exp(np.array([0, 0, quarters * np.pi / 2]))
    rotation, translation = camera.cam_from_world
    return altered(camera, cam_from_world=(turn @ rotation, turn @ translation))


@kind("board", NUMBERING)
def upside_down_camera(rng):
    """A camera hangs on its head, and its detector counts an 8x6 board from the other end."""
    scene = make_scene(rng, sides=(8, 6), partial=False)
    c = someone(rng, scene)
    scene.cameras[c] = rolled(scene.cameras[c], 2)
    right = observe(rng, scene)
    corners = {key: quarter_turned(scene.board, px, 2) if key[0] == c else px for key, px in right.items()}
    return Recording(scene, corners, judged=right, culprits=[scene.cameras[c].name])


@kind("board", NUMBERING)
def square_board_turned(rng):
    """A camera counts a 7x7 board by one, two or three quarter turns otherwise, always."""
    quarters = int(rng.integers(1, 4))
    return turned_views(rng, make_scene(rng, sides=(7, 7), partial=False), lambda: quarters)


@kind("board", NUMBERING)
def square_board_turned_some(rng):
    """A camera counts a 6x6 board from any of its corners, as it comes."""
    return turned_views(rng, make_scene(rng, sides=(6, 6), partial=False), lambda: int(rng.integers(4)))


@kind("board", NUMBERING)
def even_board_turned_some(rng):
    """A camera counts an 8x6 board from either end, as it comes."""
    return turned_views(rng, make_scene(rng, sides=(8, 6), partial=False), lambda: 2 * int(rng.integers(2)))


@kind("board", NUMBERING + FRAMES)
def turned_and_late(rng):
    """A camera counts an 8x6 board from either end, and its video begins 2 to 9 frames late."""
    late, scene = int(rng.integers(2, 10)), make_scene(rng, sides=(8, 6), partial=False, **VIDEO)
    c = someone(rng, scene)
    right = observe(rng, scene, time_of=lambda k, i: float(i - late) if k == c else float(i))
    corners = {key: quarter_turned(scene.board, px, 2 * int(rng.integers(2))) if key[0] == c else px for key, px in right.items()}
    return Recording(scene, corners, judged=right, culprits=[scene.cameras[c].name])


@kind("board", NUMBERING + FRAMES)
def all_turned_one_late(rng):
    """Every camera counts an 8x6 board from either end, and one camera's video begins 2 to 9 frames late."""
    late, scene = int(rng.integers(2, 10)), make_scene(rng, sides=(8, 6), partial=False, **VIDEO)
    c = someone(rng, scene)
    right = observe(rng, scene, time_of=lambda k, i: float(i - late) if k == c else float(i))
    corners = {key: quarter_turned(scene.board, px, 2 * int(rng.integers(2))) for key, px in right.items()}
    return Recording(scene, corners, judged=right, culprits=[scene.cameras[c].name])


# ---- several boards ----------------------------------------------------------------------------------------------------------------

def two_boards(rng, places):
    """A second board like the first, at places(i) = first_from_second in frame i."""
    scene = make_scene(rng, frames=45)
    first = observe(rng, scene)
    poses, scene.poses = scene.poses, [rigid.compose(pose, places(scene, i)) for i, pose in enumerate(scene.poses)]
    second = observe(rng, scene)
    scene.poses = poses
    return Recording(scene, first, second=second, format="csv")


def beside(scene, degrees, rng):
    w = scene.board.width()
    turn = rigid.exp(np.radians(degrees) * np.array([0, 1.0, 0]) + rng.normal(0, 0.05, 3))
    return turn, np.array([-1.3 * w, 0, 0]) + rng.normal(0, 0.05 * w, 3)


@kind("clean", clean=True)
def clean_two_boards(rng):
    """Two boards that are rigid to each other."""
    made = {}
    return two_boards(rng, lambda scene, i: made.setdefault(0, beside(scene, 15, rng)))


@kind("board", [r"CAL-BOARDS", r"boards? (are not rigid|moved)"])
def boards_moved(rng):
    """Two boards that move against each other from picture to picture, by some centimetres and degrees."""
    return two_boards(rng, lambda scene, i: beside(scene, 15, rng))


@kind("board", [r"CAL-BOARDS", r"boards? (are not rigid|moved)"])
def boards_moved_once(rng):
    """Two boards that somebody moved against each other in the middle of the recording."""
    made = {}
    return two_boards(rng, lambda scene, i: made.setdefault(i < 22, beside(scene, 15, rng)))


# ---- targets in space --------------------------------------------------------------------------------------------------------------

class Relief(studio.Board):
    """A grid of points of different heights."""

    def corners(self):
        x = super().corners()
        k = np.arange(len(x))
        x[:, 2] += 0.15 * self.width() * np.sin(2.4 * k + 1) * (k % 3 != 0)
        return x


def in_space(rng, wrong=None):
    scene = make_scene(rng, frames=40)
    scene.board = Relief(scene.board.cols, scene.board.rows, scene.board.pitch)
    told = scene.board.corners()
    if wrong:
        told[int(rng.integers(len(told)))] += wrong(scene.board)
    rows = [f"{i},{x:.6f},{y:.6f},{z:.6f}" for i, (x, y, z) in enumerate(told)]
    return Recording(scene, observe(rng, scene), board_text="points:{folder}/target.csv:m", told_points=told, format="csv",
                     files={"target.csv": "\n".join(["id,x,y,z", *rows]) + "\n"})


@kind("clean", clean=True)
def clean_target_in_space(rng):
    """A target of points in space."""
    return in_space(rng)


@kind("board", OUTLIERS + [r"\bpoint \d+", r"\bcorner \d+ of"])
def target_wrong_point(rng):
    """One point of a target in space is stated 1 to 5 % of the target's size beside its place."""
    direction = rng.normal(0, 1, 3)
    share = rng.uniform(0.01, 0.05)
    return in_space(rng, lambda board: share * board.width() * direction / np.linalg.norm(direction))


# ---- corners that are not a camera's own -----------------------------------------------------------------------------------------

@kind("corners", [r"same corners", r"identical", r"equal corners", r"one file", r"copy of", r"CAL-SAMEFILE"])
def equal_files(rng):
    """Two cameras have one and the same file."""
    rec = make(rng)
    a, b = rng.choice(len(rec.scene.cameras), 2, replace=False)
    corners = {key: px for key, px in rec.corners.items() if key[0] != b}
    corners.update({(int(b), frame): px for (c, frame), px in rec.corners.items() if c == a})
    return Recording(rec.scene, corners, culprits=[rec.scene.cameras[a].name, rec.scene.cameras[b].name])


@kind("corners", OUTLIERS + [r"border", r"edge of the image", r"outside", r"clipped"])
def clipped_corners(rng):
    """Corners beyond the image stand at its border."""
    scene = make_scene(rng, partial=True)
    corners = observe(rng, scene)
    for (c, frame), px in corners.items():
        camera, at = scene.cameras[c], scene.pose_at(frame / scene.stride)
        beyond = ~np.isfinite(px[:, 0])
        where = studio.project(camera.lens, rigid.apply(rigid.compose(camera.cam_from_world, at), scene.board.corners()))
        ok = beyond & np.isfinite(where[:, 0]) & ~studio.folded(camera.lens, rigid.apply(rigid.compose(camera.cam_from_world, at),
                                                                                      scene.board.corners()))
        px[ok] = np.clip(where[ok], 0, np.array(camera.size) - 1)
    right = {key: np.where(at_border(scene.cameras[key[0]], px)[:, None], np.nan, px) for key, px in corners.items()}
    return Recording(scene, corners, judged=right)


def at_border(camera, px):
    with np.errstate(invalid="ignore"):
        return ((px <= 0) | (px >= np.array(camera.size) - 1)).any(axis=1)


@kind("corners", [r"mirror", r"outside", r"\bx and y"])
def axes_exchanged(rng):
    """A camera's x and y are exchanged."""
    rec = make(rng)
    c = someone(rng, rec.scene)
    corners = {key: px[:, ::-1] if key[0] == c else px for key, px in rec.corners.items()}
    return Recording(rec.scene, corners, culprits=[rec.scene.cameras[c].name])


@kind("corners", [r"mirror", r"y axis"])
def y_from_below(rng):
    """A camera's y counts from the lower edge of the image."""
    rec = make(rng)
    c = someone(rng, rec.scene)
    h = rec.scene.cameras[c].size[1]
    corners = {key: px * [1, -1] + [0, h - 1] if key[0] == c else px for key, px in rec.corners.items()}
    return Recording(rec.scene, corners, culprits=[rec.scene.cameras[c].name])


@kind("corners", clean=True)
def half_board(rng):
    """A camera finds the corners of one half of the board only."""
    rec = make(rng, partial=True, frames=45)
    c, board = someone(rng, rec.scene), rec.scene.board
    left = (np.arange(board.cols * board.rows) % board.cols) < (board.cols + 1) // 2
    corners = {key: np.where(left[:, None], px, np.nan) if key[0] == c else px for key, px in rec.corners.items()}
    corners = {key: px for key, px in corners.items() if np.isfinite(px[:, 0]).sum() >= 8}
    return Recording(rec.scene, corners)


@kind("corners", BOARD + NUMBERING + FRAMES + OUTLIERS)
def views_exchanged(rng):
    """A tenth of a camera's views stand under another camera's name, and the other way round."""
    rec = make(rng)
    a, b = rng.choice(len(rec.scene.cameras), 2, replace=False)
    frames = sorted({f for k, f in rec.corners if k == a} | {f for k, f in rec.corners if k == b})
    some = set(rng.choice(frames, max(2, len(frames) // 10), replace=False))
    swap = {a: b, b: a}
    corners = {(int(swap.get(c, c)) if f in some else c, f): px for (c, f), px in rec.corners.items()}
    return Recording(rec.scene, corners)
