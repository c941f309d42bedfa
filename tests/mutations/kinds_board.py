"""Boards that are not what the program is told, and corners that were found wrongly."""

import numpy as np

import studio
from kinds_time import of_camera, replaced, someone
from recording import Recording, make, make_scene, observe
from registry import kind, kinds

BOARD = [r"number of corners", r"corners, the board", r"\bboard'?s? (size|description|number)", r"--board", r"numbering", r"described", r"columns",
         r"not on the board"]
NUMBERING = [r"number(ed|ing)", r"half a turn", r"turned round", r"rotated", r"upside"]
OUTLIERS = [r"CAL-REJECTED", r"CAL-GROSS", r"CAL-LOST", r"rejected", r"off by more than"]


def told(rec, cols, rows, pitch):
    board = studio.Board(cols, rows, pitch)
    return Recording(rec.scene, rec.corners, board_text=board.text(), told_points=board.corners())


@kind("board", clean=True)
def wrong_pitch(rng):
    """The squares are told 2 to 10 % too large. Nothing in the corners says so; judged in the units of the told board."""
    rec = make(rng)
    factor = 1 + rng.uniform(0.02, 0.1)
    board = rec.scene.board
    wrong = told(rec, board.cols, board.rows, board.pitch * factor)
    wrong.scale = factor
    return wrong


@kind("board", [r"\bunit", r"\bmm\b.*\bm\b", r"thousand", r"too large", r"km"])
def wrong_unit(rng):
    """The squares are told in metres where they are millimetres: the rig is a thousand times too large."""
    rec = make(rng)
    board = rec.scene.board
    return told(rec, board.cols, board.rows, board.pitch * 1000)


@kind("board", BOARD)
def wrong_rows(rng):
    """One row too many is told."""
    rec = make(rng)
    board = rec.scene.board
    return told(rec, board.cols, board.rows + 1, board.pitch)


@kind("board", BOARD)
def wrong_rows_csv(rng):
    """One row too few is told, in a file that names the corners by number."""
    rec = make(rng)
    board = rec.scene.board
    wrong = told(rec, board.cols, board.rows - 1, board.pitch)
    wrong.format = "csv"
    return wrong


@kind("board", BOARD)
def wrong_columns_csv(rng):
    """One column too many is told: corners from the second row on stand elsewhere."""
    rec = make(rng)
    board = rec.scene.board
    wrong = told(rec, board.cols + 1, board.rows, board.pitch)
    wrong.format = "csv"
    return wrong


@kind("board", BOARD)
def rows_for_columns(rng):
    """Columns and rows are exchanged."""
    rec = make(rng)
    board = rec.scene.board
    return told(rec, board.rows, board.cols, board.pitch)


def renumbered(rng, order_of, some=1.0, everyone=False):
    """Corners of a camera (or of all) in another order, in a share of its views."""
    rec = make(rng, partial=False)
    c = someone(rng, rec.scene)
    order = order_of(rec.scene.board)
    corners = dict(rec.corners)
    for key in corners:
        if (everyone or key[0] == c) and rng.uniform() < some:
            corners[key] = corners[key][order]
    return Recording(rec.scene, corners, culprits=[] if everyone else [rec.scene.cameras[c].name], judged=rec.corners if everyone else None)


def grid_of(board):
    return np.arange(board.cols * board.rows).reshape(board.rows, board.cols)


@kind("board", NUMBERING)
def turned_one(rng):
    """A camera counts the corners from the other end, always."""
    return renumbered(rng, lambda board: grid_of(board).ravel()[::-1])


@kind("board", NUMBERING)
def turned_some(rng):
    """A camera counts the corners from the other end in a fifth of its views."""
    return renumbered(rng, lambda board: grid_of(board).ravel()[::-1], some=0.2)


@kind("board", clean=True)
def turned_all(rng):
    """All cameras count from the other end: the board's frame is another, the cameras are right."""
    return renumbered(rng, lambda board: grid_of(board).ravel()[::-1], everyone=True)


@kind("board", [r"mirror"])
def mirrored_one(rng):
    """A camera counts every row from the right."""
    return renumbered(rng, lambda board: grid_of(board)[:, ::-1].ravel())


@kind("board", [r"mirror"])
def mirrored_all(rng):
    """All cameras count every row from the right."""
    return renumbered(rng, lambda board: grid_of(board)[:, ::-1].ravel(), everyone=True)


@kind("board", NUMBERING + [r"shifted"])
def shifted_one(rng):
    """A camera takes each column of corners for the next one."""
    rec = make(rng, partial=True)
    c, board = someone(rng, rec.scene), rec.scene.board
    corners = dict(rec.corners)
    for key, px in rec.corners.items():
        if key[0] == c:
            rows = px.reshape(board.rows, board.cols, 2)
            corners[key] = np.concatenate([np.full((board.rows, 1, 2), np.nan), rows[:, :-1]], axis=1).reshape(-1, 2)
    return Recording(rec.scene, corners, culprits=[rec.scene.cameras[c].name])


@kind("board", NUMBERING + BOARD)
def shifted_numbers_all(rng):
    """All corners have the number of the next one."""
    rec = make(rng, partial=True)
    corners = {key: np.vstack([[[np.nan, np.nan]], px[:-1]]) for key, px in rec.corners.items()}
    return Recording(rec.scene, corners, judged=rec.corners)


# ---- shapes ----------------------------------------------------------------------------------------------------------------------

def shaped(rng, **shape):
    scene = make_scene(rng, frames=45)
    for key, value in shape.items():
        setattr(scene.board, key, value)
    return Recording(scene, observe(rng, scene))


@kind("board", [r"bent", r"bend", r"flat", r"warp"], statistics=True)
def bent_board(rng):
    """The board is bent by 0.2 to 1 % of its width."""
    rng_width = rng.uniform(0.002, 0.01) * rng.choice([-1, 1])
    scene = make_scene(rng, frames=45)
    scene.board.warp = (rng_width * scene.board.width(), rng.uniform(-1, 1) * rng_width * scene.board.width())
    return Recording(scene, observe(rng, scene))


@kind("board", [r"stretch", r"aspect", r"square"], statistics=True)
def stretched_board(rng):
    """The board's squares are 0.1 to 1 % longer than wide, and askew."""
    return shaped(rng, stretch=(rng.normal(0, 0.001), rng.uniform(0.0005, 0.005) * rng.choice([-1, 1])))


@kind("board", [r"CAL-LENGTHS.*cells"])
def cells_not_square(rng):
    """The cells are printed 2 to 12 % higher than wide (or wider than high), and told as squares."""
    scene = make_scene(rng)
    scene.board.stretch = (0.0, rng.uniform(0.01, 0.06) * rng.choice([-1, 1]))
    return Recording(scene, observe(rng, scene))


@kind("board", [r"bent", r"bend", r"flat", r"warp", r"CAL-LENGTHS"])
def limp_board(rng):
    """The board bends from one picture to the next, by up to 0.5 % of its width."""
    scene = make_scene(rng, frames=44)
    base = scene.board
    bends = rng.normal(0, 0.0025 * base.width(), (len(scene.poses), 2))
    corners = observe(rng, scene, board_at=lambda i: studio.Board(base.cols, base.rows, base.pitch, tuple(bends[i])))
    return Recording(scene, corners)


@kind("board", [r"two boards", r"another board", r"pitch", r"CAL-LENGTHS"] + BOARD)
def board_exchanged(rng):
    """From the middle on a board with squares 3 % larger is filmed."""
    scene = make_scene(rng, frames=44)
    base = scene.board
    larger = studio.Board(base.cols, base.rows, base.pitch * 1.03)
    return Recording(scene, observe(rng, scene, board_at=lambda i: base if i < 22 else larger))


# ---- corners ---------------------------------------------------------------------------------------------------------------------

@kind("corners", clean=True, statistics=True)
def glare_missing(rng):
    """A third of the corners are not found, in patches."""
    rec = make(rng, partial=True)
    for px in rec.corners.values():
        spot = px[rng.integers(len(px))]
        far = np.linalg.norm(px - spot, axis=1)
        if np.isfinite(far).sum() >= 20:
            px[far < np.nanquantile(far, 0.33)] = np.nan
    return rec


@kind("corners", OUTLIERS + [r"glare"])
def glare_biased(rng):
    """In a third of a camera's views a patch of corners is off by 1 to 4 px, away from a highlight."""
    rec = make(rng)
    c = someone(rng, rec.scene)
    for f in of_camera(rec, c):
        px = rec.corners[(c, f)]
        if rng.uniform() < 0.33:
            away = px - px[rng.integers(len(px))]
            far = np.linalg.norm(away, axis=1, keepdims=True)
            near = (far < np.nanquantile(far, 0.3)) & (far > 0)
            px += np.where(near, away / np.where(far > 0, far, 1) * rng.uniform(1, 4), 0)
    rec.culprits = [rec.scene.cameras[c].name]
    return rec


def with_outliers(rng, share):
    rec = make(rng)
    for (c, _), px in rec.corners.items():
        wrong = rng.uniform(size=len(px)) < share
        size = np.array(rec.scene.cameras[c].size)
        px[wrong] = np.where(rng.uniform(size=(wrong.sum(), 1)) < 0.5, rng.uniform(0, 1, (wrong.sum(), 2)) * size,
                             px[wrong] + rng.normal(0, 12, (wrong.sum(), 2)))
    return rec


kinds("corners", OUTLIERS, {
    "outliers_1": ("One corner in a hundred is somewhere else.", lambda rng: with_outliers(rng, 0.01)),
    "outliers_5": ("One in twenty.", lambda rng: with_outliers(rng, 0.05)),
    "outliers_20": ("One in five.", lambda rng: with_outliers(rng, 0.2)),
})


@kind("corners", OUTLIERS + [r"another board", r"found wrongly"])
def wild_boards(rng):
    """A twentieth of a camera's boards are hallucinated: a grid somewhere else."""
    rec = make(rng)
    c = someone(rng, rec.scene)
    size = np.array(rec.scene.cameras[c].size)
    views = {f: rec.corners[(c, f)] for f in of_camera(rec, c)}
    for f in rng.choice(sorted(views), max(2, len(views) // 20), replace=False):
        views[f] = views[f][::-1] * rng.uniform(0.3, 0.6) + rng.uniform(0, 0.4, 2) * size
    return replaced(rec, c, views)
