"""Takes of 2D joints with exactly one thing wrong: whether `mvstudio triangulate` names it first, and whether the flag that it prints
mends it. run.py --takes [--kinds NAMES] [--sample] [--json FILE] [--keep FOLDER]
"""

import dataclasses
import fnmatch
import json
import os
import pathlib
import re
import tempfile

import numpy as np

import program

DATA = pathlib.Path(os.environ.get("MVSTUDIO_DATA", pathlib.Path(__file__).resolve().parents[3] / "shared/data"))
PAIRS_25 = [(5, 2), (6, 3), (7, 4), (12, 9), (13, 10), (14, 11), (16, 15), (18, 17), (19, 22), (20, 23), (21, 24)]
PAIRS_25B = [(1, 2), (3, 4), (5, 6), (7, 8), (9, 10), (11, 12), (13, 14), (15, 16), (19, 22), (20, 23), (21, 24)]
SAMPLE = ["studio/y_below_all", "studio/normalized_all", "studio/turned_90_all", "studio/inverted"]


@dataclasses.dataclass
class Take:
    rig: dict           # our calibration file
    frames: dict        # camera -> {frame: (people, joints, 3)}
    skeleton: str
    pairs: list         # joints that a mirror exchanges
    seconds_apart: bool = True   # frames follow each other in time

    def size(self, camera):
        return next(c["size_px"] for c in self.rig["cameras"] if c["name"] == camera)


# ---- recordings -----------------------------------------------------------------------------------------------------------------

def read_folder(folder):
    frames = {}
    for path in sorted(folder.glob("*.json")):
        people = [np.array(p["pose_keypoints_2d"], float).reshape(-1, 3) for p in json.loads(path.read_text())["people"]
                  if p.get("pose_keypoints_2d")]
        frames[int(re.findall(r"\d+", path.name.replace("_keypoints", ""))[-1])] = np.array(people)
    return frames


def calibration(binary, path, scratch):
    run = program.execute(binary, ["calib", "convert", str(path), "--overwrite"], scratch, pathlib.Path(scratch) / "rig.json")
    assert run.exit == 0, run.errors
    return json.loads((pathlib.Path(scratch) / "rig.json").read_text())


def balancing(binary, scratch):
    root = DATA / "pose2sim"
    rig = calibration(binary, root / "calibration/Calib_qualisys.toml", scratch)
    frames = {f"cam_0{k}": read_folder(root / f"balancing/pose-associated/cam0{k}_json") for k in range(1, 5)}
    return Take(rig, frames, "body25b", PAIRS_25B)


def panoptic(name):
    def make(binary, scratch):
        root = DATA / name
        rig = calibration(binary, root / f"calibration_{name}.json", scratch)
        if len(rig["cameras"]) > 6:
            rig["cameras"] = rig["cameras"][::2]
        for key in ("calibration_covariance", "joint_covariance"):
            rig.pop(key, None)
        names = [c["name"] for c in rig["cameras"]]
        return Take(rig, {n: {f: p for f, p in read_folder(root / "pose2d" / n).items() if f < 62} for n in names}, "body25", PAIRS_25)
    return make


def walker(t):
    """BODY_25 joints of a person who walks and waves, metres."""
    heading, phase = 0.6 * t + 0.5 * np.sin(1.3 * t), 5 * t
    c, s = np.cos(heading), np.sin(heading)
    place = np.array([0.9 * np.sin(0.7 * t) + 0.2 * np.sin(1.9 * t), 0.9 * np.cos(0.5 * t), 0])
    at = lambda forward, left, up: place + [c * forward - s * left, s * forward + c * left, up]  # noqa: E731
    joints = np.zeros((25, 3))
    joints[[0, 1, 8]] = at(0.12, 0, 1.58), at(0, 0, 1.42), at(0, 0, 0.95)
    joints[[15, 16, 17, 18]] = at(0.1, -0.03, 1.62), at(0.1, 0.03, 1.62), at(0.02, -0.08, 1.6), at(0.02, 0.08, 1.6)
    for side, shoulder, hip, toe, arm in ((1, 5, 12, 19, 0.4 + 0.8 * np.sin(2.3 * t)), (-1, 2, 9, 22, 0.3 + 0.9 * np.sin(1.7 * t))):
        leg = 0.35 * side * np.sin(phase)
        joints[shoulder] = at(0, 0.19 * side, 1.42)
        joints[shoulder + 1] = at(0.28 * np.sin(arm), 0.24 * side, 1.42 - 0.28 * np.cos(arm))
        joints[shoulder + 2] = at(0.28 * np.sin(arm) + 0.25 * np.sin(1.6 * arm), 0.24 * side,
                                  1.42 - 0.28 * np.cos(arm) - 0.25 * np.cos(1.6 * arm))
        joints[hip] = at(0, 0.1 * side, 0.93)
        joints[hip + 1] = at(0.42 * np.sin(leg), 0.1 * side, 0.93 - 0.42 * np.cos(leg))
        joints[hip + 2] = at(0.8 * np.sin(leg), 0.1 * side, 0.93 - 0.82 * np.cos(leg))
        for k, (f, left) in enumerate(((0.18, 0), (0.15, 0.06 * side), (-0.06, 0))):
            joints[toe + k] = joints[hip + 2] + [c * f - s * left, s * f + c * left, -0.06]
    return joints


def studio(_binary, _scratch):
    """Four cameras around the walker, 120 frames at 30 Hz, 1.5 px of noise."""
    rng, cameras, frames = np.random.default_rng(5), [], {}
    for k in range(4):
        angle = 2 * np.pi * (k + 0.3) / 4
        centre = np.array([4.5 * np.cos(angle), 4.5 * np.sin(angle), 2.4 if k % 2 else 1.3])
        forward = np.array([0, 0, 0.9]) - centre
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        rotation = np.array([right, np.cross(forward, right), forward])
        focal, name = 1150 + 30 * k, f"c{k}"
        cameras.append({"name": name, "model": "pinhole", "size_px": [1920, 1080],
                        "intrinsics": {"fx": focal, "fy": focal, "cx": 953.0 + 4 * k, "cy": 551.0 - 3 * k},
                        "cam_from_world": pose(rotation, -rotation @ centre)})
        frames[name] = {}
        for f in range(120):
            x = walker(f / 30) @ rotation.T - rotation @ centre
            px = focal * x[:, :2] / x[:, 2:] + [953.0 + 4 * k, 551.0 - 3 * k] + rng.normal(size=(25, 2)) * 1.5
            frames[name][f] = np.hstack([px, np.full((25, 1), 0.9)])[None]
    return Take({"schema": "mvstudio.calibration/1", "unit": "m", "gauge": "studio", "cameras": cameras}, frames, "body25", PAIRS_25)


RECORDINGS = {"studio": studio, "balancing": balancing, "person_a": panoptic("person_a"), "turn_a": panoptic("turn_a")}


# ---- what is wrong --------------------------------------------------------------------------------------------------------------

def quaternion(matrix):
    """x, y, z, w of a rotation."""
    k = np.array([[matrix[0, 0] - matrix[1, 1] - matrix[2, 2], 0, 0, 0],
                  [matrix[0, 1] + matrix[1, 0], matrix[1, 1] - matrix[0, 0] - matrix[2, 2], 0, 0],
                  [matrix[0, 2] + matrix[2, 0], matrix[1, 2] + matrix[2, 1], matrix[2, 2] - matrix[0, 0] - matrix[1, 1], 0],
                  [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1], np.trace(matrix)]]) / 3
    return np.linalg.eigh(k)[1][:, -1]


def matrix(camera):
    x, y, z, w = camera["cam_from_world"]["rotation_xyzw"]
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def pose(rotation, translation):
    return {"rotation_xyzw": [float(v) for v in quaternion(rotation)], "translation": [float(v) for v in translation]}


def pixels(change, which=slice(None)):
    """Changes the pixels of some cameras: change(people, (width, height))."""
    def spoil(take):
        for camera in list(take.frames)[which]:
            for people in take.frames[camera].values():
                if people.size:
                    people[..., :2] = change(people[..., :2].copy(), np.array(take.size(camera), float))
    return spoil


def mirrored(which=slice(None)):
    def spoil(take):
        pixels(lambda p, s: np.stack([s[0] - 1 - p[..., 0], p[..., 1]], -1), which)(take)
        for camera in list(take.frames)[which]:
            for people in take.frames[camera].values():
                for a, b in take.pairs if people.size else ():
                    people[:, [a, b]] = people[:, [b, a]]
    return spoil


def turned(degrees, which=slice(None)):
    changes = {90: lambda p, s: np.stack([s[1] - 1 - p[..., 1], p[..., 0]], -1), 180: lambda p, s: s - 1 - p,
               270: lambda p, s: np.stack([p[..., 1], s[0] - 1 - p[..., 0]], -1)}
    return pixels(changes[degrees], which)


def poses(change, which=slice(None)):
    def spoil(take):
        for camera in take.rig["cameras"][which]:
            rotation, translation = change(matrix(camera), np.array(camera["cam_from_world"]["translation"]))
            camera["cam_from_world"] = pose(rotation, translation)
            camera.pop("cam_from_world_covariance", None)
    return spoil


def rates(take):
    for camera in list(take.frames)[1::2]:
        take.frames[camera] = {f // 2: p for f, p in take.frames[camera].items() if f % 2 == 0}


def late(take):
    camera = list(take.frames)[1]
    take.frames[camera] = {f + 9: p for f, p in take.frames[camera].items()}


def exchanged(take):
    a, b = list(take.frames)[:2]
    take.frames[a], take.frames[b] = take.frames[b], take.frames[a]


def doubled(take):
    a, b = list(take.frames)[:2]
    take.frames[b] = take.frames[a]


def scores(take):
    for frames in take.frames.values():
        for people in frames.values():
            if people.size:
                people[..., 2] *= 0.1


FLIP = np.array([1, -1, 1])
ONE = slice(2, 3)
below = lambda p, s: np.stack([p[..., 0], s[1] - p[..., 1]], -1)  # noqa: E731
parts = lambda p, s: p / s  # noqa: E731
half = lambda p, s: (p + 0.5) / 2 - 0.5  # noqa: E731
MOVED = np.array([[0.9, -0.43589, 0], [0.43589, 0.9, 0], [0, 0, 1]])

# name -> (what spoils a take, the cause in metrics.causes or a pattern of the message)
KINDS = {
    "normalized_all": (pixels(parts), "normalized"), "normalized_one": (pixels(parts, ONE), "normalized"),
    "y_below_all": (pixels(below), "y-from-below"), "y_below_one": (pixels(below, ONE), "y-from-below"),
    "turned_90_all": (turned(90), "turned"), "turned_90_one": (turned(90, ONE), "turned"),
    "turned_180_one": (turned(180, ONE), "turned"), "turned_270_all": (turned(270), "turned"),
    "inverted": (poses(lambda r, t: (r.T, -r.T @ t)), "poses-inverted"),
    "mirrored_poses": (poses(lambda r, t: (FLIP[:, None] * r * FLIP, FLIP * t)), "poses-mirrored"),
    "rates": (rates, "rates"), "late": (late, "time-offset"),
    "mirrored_all": (mirrored(), "mirrored"), "mirrored_one": (mirrored(ONE), "mirrored"),
    "half_all": (pixels(half), "image-size"), "half_one": (pixels(half, ONE), "image-size"),
    "exchanged": (exchanged, "exchanged"), "moved": (poses(lambda r, t: (MOVED @ r, t), ONE), "moved"),
    "same_file": (doubled, "re:one recording was given for both"), "low_scores": (scores, "re:below --min-score"),
}
FLAGS = r"--(normalized|flip-y|flip-x|swap-sides|rotate|image-size|rate|swap-cameras|without-camera|invert|mirror|min-score|ignore-scores)\b"


# ---- runs -----------------------------------------------------------------------------------------------------------------------

def write(take, folder):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.json").write_text(json.dumps(take.rig))
    words = ["--calib", str(folder / "rig.json"), "--skeleton", take.skeleton]
    for camera, frames in take.frames.items():
        (folder / camera).mkdir(exist_ok=True)
        for number, people in frames.items():
            content = {"version": 1.3, "people": [{"pose_keypoints_2d": [float(f"{v:.6f}") for v in person.ravel()]} for person in people]}
            (folder / camera / f"{number:012d}_keypoints.json").write_text(json.dumps(content))
        words += ["--pose2d", f"{camera}={folder / camera}"]
    return words


def mending(run):
    """The flags that the first message with some advises; ["--sync"] for `mvstudio sync`."""
    for _, _, hint in run.messages():
        if "mvstudio sync" in hint:
            return ["--sync"]
        words = []
        for match in re.finditer(FLAGS + r"(?: (?!or\b|\(|--)([^\s();]+[^\s();,]))?", hint.split(", or ")[0]):
            words += [f"--{match[1]}", *([match[2]] if match[2] else [])]
        if words:
            return ["--min-score", "0"] if words[0] == "--min-score" else words
    if "--without-camera" in run.errors:
        return re.findall(r"--without-camera \w+", run.errors)[0].split()
    return []


def names_first(run, cause):
    if cause.startswith("re:"):
        return any(re.search(cause[3:], text) for _, text, _ in run.messages())
    causes = run.result.get("metrics", {}).get("causes", [])
    said = any("TRI-CAUSE" == code or "TRI-TIMING" == code for code, _, _ in run.messages())
    if cause == "moved":  # where the take is not lost, the camera is named by its own figures
        return (said and len(causes) > 1 and causes[1]["cause"] == cause) or any("CAMERA" in code for code, _, _ in run.messages())
    return said and len(causes) > 1 and causes[1]["clear"] and causes[1]["cause"] == cause


def triangulate(binary, words, folder, name):
    return program.execute(binary, ["triangulate", *words], folder, folder / name)


def figures(run):
    metrics = run.result.get("metrics", {})
    left_out = (metrics.get("holdout") or {}).get("median_px")
    return metrics.get("num_points", 0) / max(metrics.get("num_joints_carriable", 0), 1), left_out


def is_mended(clean, run, fewer):
    """As good as the take that was not spoiled; `fewer`: with fewer cameras."""
    share, left_out = figures(run)
    clean_share, clean_left_out = figures(clean)
    close = left_out is None or clean_left_out is None or left_out < (2 if fewer else 1.25) * clean_left_out + 1
    return run.exit in (clean.exit, 0) and share > clean_share - 0.05 and close


def run_one(binary, recording, name, clean, folder):
    spoil, cause = KINDS[name]
    take = RECORDINGS[recording](binary, folder)
    spoil(take)
    words = write(take, folder)
    run = triangulate(binary, words, folder, "spoiled")
    flags = mending(run)
    if flags == ["--sync"]:
        program.execute(binary, ["sync", *words], folder, folder / "sync")
        flags = ["--sync", str(folder / "sync/sync.json")]
    mended = triangulate(binary, [*words, *flags], folder, "mended") if flags else None
    return {"take": f"{recording}/{name}", "exit": run.exit, "named": bool(names_first(run, cause)),
            "mended": bool(mended and is_mended(clean, mended, "--without-camera" in flags)), "flags": flags,
            "said": [f"{code} {text}" for code, text, _ in run.messages()][:3], "seconds": round(run.seconds, 1)}


def main(options):
    chosen = [f"{r}/{k}" for r in RECORDINGS for k in KINDS if r != "turn_a"] if not options.sample else SAMPLE
    if options.kinds != "*":
        chosen = [f"{r}/{k}" for r in RECORDINGS for k in KINDS if any(fnmatch.fnmatch(f"{r}/{k}", w) for w in options.kinds.split(","))]
    rows, clean = [], {}
    with tempfile.TemporaryDirectory(prefix="mvstudio-takes-") as scratch:
        for k, take in enumerate(chosen):
            recording, name = take.split("/")
            if recording != "studio" and not DATA.is_dir():
                print(f"{take}: no {DATA}")
                continue
            folder = pathlib.Path(options.keep or scratch).resolve() / f"{k}-{recording}-{name}"
            folder.mkdir(parents=True)
            if recording not in clean:
                first = pathlib.Path(scratch) / recording
                first.mkdir()
                clean[recording] = triangulate(options.bin, write(RECORDINGS[recording](options.bin, first), first), first, "clean")
            rows.append(run_one(options.bin, recording, name, clean[recording], folder))
            good = rows[-1]["named"] and rows[-1]["mended"]
            if not good or not options.quiet:
                print(("right " if good else "WRONG ") + json.dumps(rows[-1]), flush=True)
            if options.json:
                options.json.write_text(json.dumps({"takes": rows}, indent=1))
    named, mended = sum(r["named"] for r in rows), sum(r["mended"] for r in rows)
    print(f"{len(rows)} spoiled takes: the cause comes first in {named}, the printed flag mends {mended}")
    needed = 0.95 * len(rows)
    return 0 if named >= needed and mended >= needed else 1
