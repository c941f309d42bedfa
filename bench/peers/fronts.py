#!/usr/bin/env python3
"""fronts.py STAGE session=… take=… calib=… out=… threads=…: other programs on the data of `mvstudio tradeoff all --peers`.

Prints a JSON list of ways; what is not installed says so. Stages but these two have no peers here: an empty list.

`triangulate`: errors are those of the front, the distance of the joints to a camera that is left out, median in px, over all
cameras in turn. Seconds are those of reading, of one triangulation and of one for each camera that is left out, as in
`mvstudio triangulate`. Time offsets are not used.

- Pose2Sim's and aniposelib's ways: ports to numpy of what their papers and documentation say (methods.py).
- COLMAP: `point_triangulator` on the joints as keypoints, each matched with itself in the other cameras; poses and lenses fixed.

`calibrate`: OpenCV in Python (opencv_rig.py), on the corners that `mvstudio calibrate --save-corners` found.
"""
import json
import pathlib
import resource
import shutil
import sqlite3
import struct
import subprocess
import sys
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    __import__("os").environ[variable] = "1"
import numpy as np

import methods

LENSES = ("pinhole", "brown1", "brown2", "brown4", "brown5")
TERMS = ("k1", "k2", "p1", "p2", "k3")


class Camera:
    def __init__(self, entry):
        if entry["model"] not in LENSES:
            raise ValueError(f"camera {entry['name']} has a lens of model {entry['model']}, these ports know {', '.join(LENSES)}")
        self.name, self.size = entry["name"], entry["size_px"]
        numbers = entry["intrinsics"]
        self.f, self.c = np.array([numbers["fx"], numbers["fy"]]), np.array([numbers["cx"], numbers["cy"]])
        self.d = [numbers.get(term, 0.0) for term in TERMS]
        x, y, z, w = self.quaternion = np.array(entry["cam_from_world"]["rotation_xyzw"])
        self.r = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                           [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                           [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
        self.t = np.array(entry["cam_from_world"]["translation"])

    def matrix(self):
        """(3, 4) of the lens without distortion."""
        k = np.diag([*self.f, 1.0])
        k[:2, 2] = self.c
        return k @ np.column_stack([self.r, self.t])

    def distorted(self, xy):
        k1, k2, p1, p2, k3 = self.d
        x, y = xy[..., 0], xy[..., 1]
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        return np.stack([x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y], -1)

    def undistorted(self, px):
        """Pixels of the lens without distortion."""
        xy = goal = (px - self.c) / self.f
        for _ in range(30):
            xy = xy + goal - self.distorted(xy)
        return xy * self.f + self.c

    def project(self, points):
        x = points @ self.r.T + self.t
        return self.distorted(x[:, :2] / x[:, 2:]) * self.f + self.c


def read_take(arguments):
    """Cameras, and px (frames * joints, cameras, 2), NaN where there is no joint."""
    cameras = [Camera(entry) for entry in json.loads(pathlib.Path(arguments["calib"]).read_text())["cameras"]]
    folder = pathlib.Path(arguments["session"]) / "pose2d" / arguments["take"]
    px = []
    for camera in cameras:
        frames = []
        for path in sorted((folder / camera.name).glob("*.json")):
            people = json.loads(path.read_text())["people"]
            numbers = np.array(people[0]["pose_keypoints_2d"] if people else [0.0] * 75).reshape(-1, 3)
            frames.append(np.where(numbers[:, 2:] > 0, numbers[:, :2], np.nan))
        px.append(np.concatenate(frames))
    return cameras, np.stack(px, 1)


def left_out_error(cameras, px, triangulate):
    """Of `triangulate(camera numbers, px)`, in px: the median over all joints and all cameras that are left out in turn."""
    distances = []
    for c, camera in enumerate(cameras):
        others = [i for i in range(len(cameras)) if i != c]
        distances.append(np.linalg.norm(camera.project(triangulate(others)) - px[:, c], axis=1))
    distances = np.concatenate(distances)
    return float(np.median(distances[np.isfinite(distances)]))


def numpy_port(arguments, name, method):
    begin_s, begin_cpu = time.perf_counter(), time.process_time()
    cameras, px = read_take(arguments)
    flat = np.stack([camera.undistorted(px[:, c]) for c, camera in enumerate(cameras)], 1)
    matrices = np.stack([camera.matrix() for camera in cameras])

    def triangulate(some):
        seen = np.isfinite(flat[:, some, 0]).sum(1) >= 2
        found = np.full((len(flat), 3), np.nan)
        found[seen] = method(matrices[some], flat[seen][:, some])
        return found

    triangulate(range(len(cameras)))
    error = left_out_error(cameras, px, triangulate)
    return {"name": name, "command": "bench/peers/methods.py", "seconds": time.perf_counter() - begin_s,
            "processor_seconds": time.process_time() - begin_cpu, "error": error,
            "peak_rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}


def pose2sim_of_seen(matrices, px):
    """Its way wants every camera: joints are done by the cameras that see them."""
    found = np.full((len(px), 3), np.nan)
    seen = np.isfinite(px[:, :, 0])
    for pattern in np.unique(seen, axis=0):
        rows = (seen == pattern).all(1)
        found[rows] = methods.pose2sim(matrices[pattern], px[rows][:, pattern])
    return found


class Colmap:
    """Images are named by camera and frame; each has the joints that are seen in it as keypoints."""
    PAIR = 2147483647

    def __init__(self, cameras, px, num_joints, folder, threads):
        self.cameras, self.px, self.joints, self.folder, self.threads = cameras, px, num_joints, folder, threads
        self.frames = len(px) // num_joints

    def image_id(self, c, frame):
        return 1 + frame * len(self.cameras) + c

    def seen(self, c, frame):
        rows = np.arange(frame * self.joints, (frame + 1) * self.joints)
        return rows[np.isfinite(self.px[rows, c, 0])]

    def call(self, command, **options):
        words = ["colmap", command] + [word for key, value in options.items() for word in ("--" + key.replace("__", "."), str(value))]
        done = subprocess.run(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env={**__import__("os").environ, "QT_QPA_PLATFORM": "offscreen"})
        if done.returncode:
            raise ValueError("colmap " + command + " ended with " + str(done.returncode) + ": " + done.stderr[-200:].replace("\n", " "))

    def write(self, some, place):
        database = place / "database.db"
        self.call("database_creator", database_path=database)
        rows = sqlite3.connect(database)
        cameras, images = [], []
        for c in some:
            camera = self.cameras[c]
            # fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6; its first pixel's middle is (0.5, 0.5).
            params = [*camera.f, *(camera.c + 0.5), *camera.d, 0.0, 0.0, 0.0]
            cameras.append(f"{c + 1} FULL_OPENCV {camera.size[0]} {camera.size[1]} " + " ".join(map(repr, map(float, params))))
            rows.execute("INSERT INTO cameras VALUES (?, 6, ?, ?, ?, 1)", (c + 1, *camera.size, np.array(params).tobytes()))
        for frame in range(self.frames):
            for c in some:
                camera, name, number = self.cameras[c], f"{self.cameras[c].name}_{frame:06d}.png", self.image_id(c, frame)
                x, y, z, w = camera.quaternion
                images.append(" ".join(map(repr, map(float, (w, x, y, z, *camera.t)))))
                images[-1] = f"{number} {images[-1]} {c + 1} {name}\n"
                points = (self.px[self.seen(c, frame), c] + 0.5).astype(np.float32)
                rows.execute("INSERT INTO images (image_id, name, camera_id) VALUES (?, ?, ?)", (number, name, c + 1))
                rows.execute("INSERT INTO keypoints VALUES (?, ?, 2, ?)", (number, len(points), points.tobytes()))
            self.match(some, frame, rows)
        rows.commit()
        rows.close()
        (place / "in").mkdir()
        (place / "in/cameras.txt").write_text("\n".join(cameras) + "\n")
        (place / "in/images.txt").write_text("\n".join(images) + "\n")
        (place / "in/points3D.txt").write_text("")

    def match(self, some, frame, rows):
        for i, a in enumerate(some):
            for b in some[i + 1:]:
                _, first, second = np.intersect1d(self.seen(a, frame), self.seen(b, frame), return_indices=True)
                pairs = np.stack([first, second], 1).astype(np.uint32)
                pair = self.PAIR * self.image_id(a, frame) + self.image_id(b, frame)
                rows.execute("INSERT INTO matches VALUES (?, ?, 2, ?)", (pair, len(pairs), pairs.tobytes()))
                rows.execute("INSERT INTO two_view_geometries (pair_id, rows, cols, data, config) VALUES (?, ?, 2, ?, 2)",
                             (pair, len(pairs), pairs.tobytes()))

    def triangulate(self, some):
        """(frames * joints, 3)."""
        place = self.folder / ("colmap-" + "-".join(map(str, some)))
        place.mkdir()
        self.write(list(some), place)
        (place / "out").mkdir()
        self.call("point_triangulator", database_path=place / "database.db", image_path=place, input_path=place / "in",
                  output_path=place / "out", Mapper__ba_refine_focal_length=0, Mapper__ba_refine_extra_params=0,
                  Mapper__num_threads=self.threads)
        found = np.full((len(self.px), 3), np.nan)
        data = (place / "out/points3D.bin").read_bytes()
        (count,), at = struct.unpack_from("<Q", data), 8
        for _ in range(count):
            _, x, y, z, _, _, _, _, length = struct.unpack_from("<Q3d3Bd Q".replace(" ", ""), data, at)
            image, keypoint = struct.unpack_from("<II", data, at + 51)
            frame, c = divmod(image - 1, len(self.cameras))
            found[self.seen(c, frame)[keypoint]] = x, y, z
            at += 51 + 8 * length
        shutil.rmtree(place)
        return found


def colmap(arguments):
    if not shutil.which("colmap"):
        return {"name": "COLMAP, point_triangulator", "why_not": "colmap is not installed"}
    usage = resource.RUSAGE_CHILDREN
    begin_s, begin_cpu = time.perf_counter(), time.process_time()
    cameras, px = read_take(arguments)
    solver = Colmap(cameras, px, 25, pathlib.Path(arguments["out"]), arguments.get("threads", "1"))
    before = resource.getrusage(usage)
    solver.triangulate(range(len(cameras)))
    error = left_out_error(cameras, px, solver.triangulate)
    after = resource.getrusage(usage)
    children = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"name": "COLMAP, point_triangulator", "command": "colmap point_triangulator", "seconds": time.perf_counter() - begin_s,
            "processor_seconds": time.process_time() - begin_cpu + children, "error": error,
            "peak_rss_mb": after.ru_maxrss / 1024}


def attempt(name, way):
    try:
        return way()
    except (ValueError, OSError, KeyError, IndexError, ImportError, subprocess.SubprocessError, sqlite3.Error, struct.error) as error:
        return {"name": name, "why_not": str(error)}


def main():
    if len(sys.argv) < 2 or sys.argv[1].startswith("-"):
        print(__doc__, file=sys.stderr)
        return 2
    stage, arguments = sys.argv[1], dict(word.split("=", 1) for word in sys.argv[2:])
    ways = []
    if stage == "triangulate":
        ways = [attempt("aniposelib's way, numpy port", lambda: numpy_port(arguments, "aniposelib's way, numpy port", methods.aniposelib)),
                attempt("Pose2Sim's way, numpy port", lambda: numpy_port(arguments, "Pose2Sim's way, numpy port", pose2sim_of_seen)),
                attempt("COLMAP, point_triangulator", lambda: colmap(arguments))]
    if stage == "calibrate":
        import opencv_rig
        ways = [attempt(opencv_rig.NAME, lambda: opencv_rig.way(arguments))]
    print(json.dumps(ways))
    return 0


if __name__ == "__main__":
    sys.exit(main())
