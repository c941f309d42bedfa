"""Thinned real recordings: a few of the boards calibrate, the boards that were left out say how well. The default against every
fixed lens. Data: $MVSTUDIO_DATA, else ../shared/data beside the project's root."""

import collections
import concurrent.futures
import json
import os
import pathlib
import tempfile
import zlib

import numpy as np

import program
import rigid
import tables
import truth
from lens import rays

PERSPECTIVE = ["pinhole", "brown1", "brown2", "brown4", "brown5", "rational8"]
WIDE = ["ucm", "ucm_p", "eucm", "doublesphere", "kannala4", "kannala4_p"]
# Name: file, flags, fixed lenses.
SETS = {
    "opencv_stereo": ("opencv_stereo/corners-classic.vnl", ["--board", "grid:9x6:25mm", "--size", "640x480"], PERSPECTIVE),
    "opencv_stereo_sb": ("opencv_stereo/corners-sb.vnl", ["--board", "grid:9x6:25mm", "--size", "640x480"], PERSPECTIVE),
    "figueroa": ("mrcal_figueroa/corners-cam0.vnl", ["--board", "grid:10x10:77mm", "--size", "6016x4016"], PERSPECTIVE + ["kannala4"]),
    "caliscope": ("caliscope/sessions/post_optimization/calibration/extrinsic/xy.csv", [], PERSPECTIVE),
    "omni_mono": ("opencv_omni_charuco/omni_calib_data.xml", [], WIDE),
    "omni_stereo": ("opencv_omni_charuco/omni_stereocalib_data.xml", ["--corners-unit", "mm"], WIDE),
}
SIZES = [6, 8, 10, 15, 20]
LEAST_HELD_OUT = 3
GROSS_PX = 5


def data_root():
    return pathlib.Path(os.environ.get("MVSTUDIO_DATA") or pathlib.Path(__file__).resolve().parents[3] / "shared/data")


class Corners:
    """A corner file in mvstudio's CSV: `views` frame -> camera -> (ids, px)."""

    def __init__(self, text):
        self.head, self.rows = [], collections.defaultdict(list)
        self.views = collections.defaultdict(dict)
        points, spec = [], ""
        for line in text.splitlines():
            cells = line.split(",")
            if line.startswith("#") or line.startswith("camera,frame,"):
                self.head.append(line)
                words = line.split()
                points += [[float(x) for x in words[4:7]]] if words[:2] == ["#", "point"] else []
                spec = words[3] if words[:3] == ["#", "board", "0"] else spec
                continue
            self.rows[int(cells[1])].append(line)
            ids, px = self.views[int(cells[1])].setdefault(cells[0], ([], []))
            ids.append(int(cells[3])), px.append([float(cells[4]), float(cells[5])])
        self.points = np.array(points) if points else grid_points(spec)

    def thinned(self, frames):
        return "\n".join(self.head + [line for f in sorted(frames) for line in self.rows[f]]) + "\n"


def grid_points(spec):
    """Corners of `grid:9x6:0.025m` or `chessboard:…`; lengths in m, cm or mm."""
    kind, size, step = spec.split(":")[:3]
    cols, rows = (int(n) - (kind == "charuco") for n in size.split("x"))
    unit = next(u for u in ("mm", "cm", "m") if step.endswith(u))
    step = float(step[:-len(unit)]) * {"mm": 1e-3, "cm": 1e-2, "m": 1}[unit]
    row, col = np.divmod(np.arange(cols * rows), cols)
    return np.stack([col * step, row * step, 0 * col], axis=-1)


# ---- scoring boards that were left out --------------------------------------------------------------------------------------------

def homography(x, y):
    """3x3 from plane points (N, 2) to (N, 2), by direct linear transformation of scaled points."""
    def scaling(p):
        scale, middle = 1 / max(1e-12, p.std()), p.mean(axis=0)
        return np.array([[scale, 0, -scale * middle[0]], [0, scale, -scale * middle[1]], [0, 0, 1]])
    tx, ty = scaling(x), scaling(y)
    a, b = (np.column_stack([p, np.ones(len(p))]) @ t.T for p, t in ((x, tx), (y, ty)))
    none = [0, 0, 0]
    rows = [row for p, q in zip(a, b) for row in ([*p * q[2], *none, *-q[0] * p], [*none, *p * q[2], *-q[1] * p])]
    return np.linalg.inv(ty) @ np.linalg.svd(np.array(rows))[2][-1].reshape(3, 3) @ tx


def board_pose(estimate, points, px):
    """world_from_board of a plane board by one camera, to start from; None where the lens has no rays."""
    ray = rays(estimate.lens, px)
    ok = np.isfinite(ray[:, 0])
    if ok.sum() < 6:
        return None
    middle = ray[ok].mean(axis=0) / np.linalg.norm(ray[ok].mean(axis=0))
    axis = np.cross(middle, [0, 0, 1])
    turn = rigid.exp(axis / max(1e-12, np.linalg.norm(axis)) * np.arccos(np.clip(middle[2], -1, 1)))
    seen = ray[ok] @ turn.T
    h = homography(points[ok, :2], seen[:, :2] / seen[:, 2:])
    h *= np.sign(h[2] @ [*points[ok, :2].mean(axis=0), 1]) / np.sqrt(np.linalg.norm(h[:, 0]) * np.linalg.norm(h[:, 1]))
    u, _, v = np.linalg.svd(np.column_stack([h[:, 0], h[:, 1], np.cross(h[:, 0], h[:, 1])]))
    cam_from_board = turn.T @ (u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v), turn.T @ h[:, 2]
    return rigid.compose(rigid.inverse(estimate.cam_from_world), cam_from_board)


def held_out_errors(rig, points, views):
    """Errors (N,) px of a board's corners: its place from every second corner of all cameras, the error on the others, and the
    halves exchanged. Corners of a board that cannot be placed count as infinite."""
    errors = []
    arrays = {name: full(points, *view) for name, view in views.items() if name in rig}
    for half in range(2):
        used = {n: np.where((np.arange(len(points)) % 2 == half)[:, None], px, np.nan) for n, px in arrays.items()}
        best = max(used, key=lambda n: np.isfinite(used[n][:, 0]).sum(), default=None)
        if best is None:
            return errors
        seen = np.isfinite(used[best][:, 0])
        start = board_pose(rig[best], points[seen], used[best][seen])
        fit = start and truth.fit_board([(rig[n], px, 1.0) for n, px in used.items()], points, start, steps=25)
        for name, px in arrays.items():
            other = np.isfinite(px[:, 0]) & ~np.isfinite(used[name][:, 0])
            if not fit:
                errors += [np.inf] * int(other.sum())
                continue
            x = rigid.apply(rig[name].cam_from_world, rigid.apply(fit[0], points[other]))
            miss = np.linalg.norm(truth.project(rig[name].lens, x) - px[other], axis=1)
            errors += list(np.where(np.isfinite(miss), miss, np.inf))
    return errors


def full(points, ids, px):
    out = np.full((len(points), 2), np.nan)
    out[ids] = px
    return out


def score(run, corners, held_out):
    """Status and held-out figures of one calibration."""
    row = {"status": "refused", "exit": run.exit, "median_px": None, "seconds": round(run.seconds, 2),
           "messages": [list(m[:2]) for m in run.messages()]}
    if run.calibration is None:
        return row
    metrics = run.result["metrics"]
    recording = type("Told", (), {"told_points": corners.points})
    points = truth.told_board(recording, metrics)
    rig = truth.read_rig(run.calibration)
    errors = np.array([e for f in held_out for e in held_out_errors(rig, points, corners.views[f])])
    good = errors[errors < GROSS_PX]
    row.update(status=metrics["verdict"]["status"],
               median_px=float(np.median(errors)) if np.isfinite(np.median(errors)) else None,
               rms_px=float(np.sqrt(np.mean(good ** 2))) if len(good) else None, gross=float(np.mean(~(errors < GROSS_PX))),
               models=[c["model"] for c in metrics["cameras"]])
    return row


# ---- running ------------------------------------------------------------------------------------------------------------------------

def load(binary, name, work):
    """The set's corners, by way of --save-corners; None where the data are not there."""
    path, flags, _ = SETS[name]
    source, folder = data_root() / path, pathlib.Path(work) / name
    if not source.exists():
        return None
    folder.mkdir(parents=True, exist_ok=True)
    saved = folder / "all.csv"
    program.execute(binary, ["calibrate", "--corners", str(source), *flags, "--save-corners", str(saved), "--holdout-folds", "0",
                             "--model", "pinhole"], folder, folder / "out-all", 600)
    return Corners(saved.read_text())


def run_subset(binary, name, boards, fold, work):
    corners = Corners((pathlib.Path(work) / name / "all.csv").read_text())
    frames = sorted(corners.views)
    chosen = np.random.default_rng([zlib.crc32(name.encode()), boards, fold]).permutation(frames)[:boards]
    held_out = [f for f in frames if f not in set(chosen)]
    row = {"set": name, "boards": boards, "fold": fold, "frames": [int(f) for f in sorted(chosen)], "fixed": {}}
    with tempfile.TemporaryDirectory(dir=work) as scratch:
        folder = pathlib.Path(scratch)
        path = folder / "corners.csv"
        path.write_text(corners.thinned(chosen))
        for model in [None] + SETS[name][2]:
            more = ["--model", model] if model else []
            run = program.execute(binary, ["calibrate", "--corners", str(path), *more], folder, folder / ("out-" + (model or "auto")))
            if model:
                row["fixed"][model] = score(run, corners, held_out)
            else:
                row["default"] = score(run, corners, held_out)
    return row


def tasks_of(binary, names, folds, work):
    tasks = []
    for name in names:
        corners = load(binary, name, work)
        if corners is None:
            print(f"left out: {name}: {data_root() / SETS[name][0]} is not there")
            continue
        tasks += [(binary, name, n, fold, work) for n in SIZES if n + LEAST_HELD_OUT <= len(corners.views) for fold in range(folds)]
    return tasks


def main(options):
    names = list(SETS) if options.kinds == "*" else options.kinds.split(",")
    rows = []
    with tempfile.TemporaryDirectory(prefix="mvstudio-thinned-") as work, concurrent.futures.ProcessPoolExecutor(options.jobs) as pool:
        futures = [pool.submit(run_subset, *task) for task in tasks_of(options.bin, names, options.folds, work)]
        for future in concurrent.futures.as_completed(futures):
            rows.append(future.result())
            done = rows[-1]
            print(f"{len(rows)}/{len(futures)} {done['set']} {done['boards']} {done['fold']}: {done['default']['status']} "
                  f"{done['default']['median_px']}; " + ", ".join(f"{m} {f['median_px']}" for m, f in done["fixed"].items()), flush=True)
            if options.json:
                options.json.write_text(json.dumps({"real": rows}, indent=1))
    print("\n" + tables.real_table(rows))
    return 0 if rows else 77
