"""2D joints of many people for scripts/growth: one walk of a studio of pinhole cameras, set at the places of a grid."""
import csv
import json
import random

SPACING_M, COLUMNS, NOISE_PX, AHEAD = 1.2, 4, 0.2, 7


def walk_of(path):
    """[frame][joint] -> place in world, metres, by the studio's truth."""
    frames = {}
    with (path / "truth/pose3d/points.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            frames.setdefault(int(row["frame"]), []).append(tuple(float(row[k]) for k in ("x_m", "y_m", "z_m")))
    return [frames[f] for f in sorted(frames)]


def rotated(q, x):
    """Quaternion x, y, z, w times a vector."""
    u, w = q[:3], q[3]
    cross = (u[1] * x[2] - u[2] * x[1], u[2] * x[0] - u[0] * x[2], u[0] * x[1] - u[1] * x[0])
    twice = tuple(2 * c for c in cross)
    again = (u[1] * twice[2] - u[2] * twice[1], u[2] * twice[0] - u[0] * twice[2], u[0] * twice[1] - u[1] * twice[0])
    return tuple(a + w * b + c for a, b, c in zip(x, twice, again))


def pixel(camera, x_in_world):
    """Where a pinhole sees a point, or None."""
    pose, k = camera["cam_from_world"], camera["intrinsics"]
    x, y, z = (a + b for a, b in zip(rotated(pose["rotation_xyzw"], x_in_world), pose["translation"]))
    if z <= 0.1:
        return None
    u, v = k["fx"] * x / z + k["cx"], k["fy"] * y / z + k["cy"]
    return (u, v) if 0 <= u < camera["size_px"][0] and 0 <= v < camera["size_px"][1] else None


def place_of(person, people):
    """Offset of a person from the walk's own place: a grid about it."""
    columns = min(COLUMNS, max(1, round(people ** 0.5)))
    rows = (people + columns - 1) // columns
    return (SPACING_M * (person % columns - (columns - 1) / 2), SPACING_M * (person // columns - (rows - 1) / 2), 0.0)


def person_in(camera, walk, frame, person, people, noise):
    """OpenPose's 75 numbers."""
    index = (frame + AHEAD * person) % (2 * len(walk) - 2)
    joints = walk[min(index, 2 * len(walk) - 2 - index)]
    offset, values = place_of(person, people), []
    for joint in joints:
        seen = pixel(camera, tuple(a + b for a, b in zip(joint, offset)))
        values += [seen[0] + noise.gauss(0, NOISE_PX), seen[1] + noise.gauss(0, NOISE_PX), 0.9] if seen else [0, 0, 0]
    return values


def write_people(path, out, frames, people):
    """Folders of OpenPose files, one a camera."""
    walk = walk_of(path)
    cameras = json.loads((path / "truth/calibration.json").read_text(encoding="utf-8"))["cameras"]
    noise = random.Random(1)
    for camera in cameras:
        (out / camera["name"]).mkdir(parents=True)
        for frame in range(frames):
            found = [{"pose_keypoints_2d": person_in(camera, walk, frame, k, people, noise)} for k in range(people)]
            (out / camera["name"] / f"{frame:08d}_keypoints.json").write_text(json.dumps({"version": 1.3, "people": found}))


def self_test():
    assert rotated((0, 0, 0, 1), (1, 2, 3)) == (1, 2, 3)
    half = 0.5 ** 0.5
    assert max(abs(a - b) for a, b in zip(rotated((0, 0, half, half), (1, 0, 0)), (0, 1, 0))) < 1e-12
    camera = {"cam_from_world": {"rotation_xyzw": [0, 0, 0, 1], "translation": [0, 0, 2]}, "size_px": [100, 100],
              "intrinsics": {"fx": 50, "fy": 50, "cx": 49.5, "cy": 49.5}}
    assert pixel(camera, (1, 0, 0)) == (74.5, 49.5) and pixel(camera, (0, 0, -3)) is None and pixel(camera, (9, 0, 0)) is None
    places = [place_of(k, 16) for k in range(16)]
    assert len(set(places)) == 16 and max(abs(sum(p[i] for p in places)) for i in (0, 1)) < 1e-9 and place_of(0, 1) == (0, 0, 0)
