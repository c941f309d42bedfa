"""What all readers share: the dataset by the rules of CMU Panoptic's toolbox, its cameras, and the comparison with what was exported."""

import glob
import json
import os

import numpy as np

JOINTS = ["Neck", "Nose", "MidHip", "LShoulder", "LElbow", "LWrist", "LHip", "LKnee", "LAnkle", "RShoulder", "RElbow", "RWrist",
          "RHip", "RKnee", "RAnkle", "LEye", "LEar", "REye", "REar"]
BODY25 = ["Nose", "Neck", "RShoulder", "RElbow", "RWrist", "LShoulder", "LElbow", "LWrist", "MidHip", "RHip", "RKnee", "RAnkle",
          "LHip", "LKnee", "LAnkle", "REye", "LEye", "REar", "LEar", "LBigToe", "LSmallToe", "LHeel", "RBigToe", "RSmallToe",
          "RHeel"]
FAULTS = []


def check(condition, text):
    if not condition:
        FAULTS.append(text)
    return condition


class Camera:
    """x_cam = R x_world + t, metres, z up; pixel (0, 0) is the centre of the top-left pixel; dist = k1, k2, p1, p2, k3."""

    def __init__(self, K, dist, R, t, size=None):
        self.K, self.dist = np.array(K, float), np.array(dist, float).ravel()
        self.R, self.t, self.size = np.array(R, float), np.array(t, float).ravel(), size

    def in_cam(self, X):
        return np.asarray(X) @ self.R.T + self.t

    def from_normalised(self, ab):
        a, b = ab[..., 0], ab[..., 1]
        k1, k2, p1, p2, k3 = self.dist
        r2 = a * a + b * b
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        u = a * radial + 2 * p1 * a * b + p2 * (r2 + 2 * a * a)
        v = b * radial + 2 * p2 * a * b + p1 * (r2 + 2 * b * b)
        return np.stack([self.K[0, 0] * u + self.K[0, 2], self.K[1, 1] * v + self.K[1, 2]], -1)

    def project(self, X):
        x = self.in_cam(X)
        return self.from_normalised(x[..., :2] / x[..., 2:])


def nearest_rotation(R):
    u, _, vt = np.linalg.svd(np.array(R, float))
    return u @ vt


class Dataset:
    def __init__(self, root):
        self.root = root
        calibration, = glob.glob(root + "/calibration_*.json")
        axes = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])  # x_panoptic = axes @ x_ours * 100
        self.cameras, self.frames, self.aliases = {}, {}, {}
        for c in json.load(open(calibration))["cameras"]:
            R = nearest_rotation(c["R"]) @ axes
            self.cameras[c["name"]] = Camera(c["K"], c["distCoef"], R, np.array(c["t"]).ravel() / 100, c["resolution"])
        for path in sorted(glob.glob(root + "/hdPose3d_stage1_coco19/body3DScene_*.json")):
            people = {}
            for body in json.load(open(path))["bodies"]:
                j = np.array(body["joints19"], float).reshape(19, 4)
                X = np.stack([j[:, 0], j[:, 2], -j[:, 1]], 1) / 100
                X[j[:, 3] < 0] = np.nan
                if body["id"] >= 0:
                    people[body["id"]] = (X, j[:, 3])
            self.frames[int(path[-13:-5])] = people


class Comparison:
    def __init__(self, dataset, manifest):
        self.dataset, self.manifest = dataset, manifest
        self.max_px = self.max_m = 0.0
        self.pixels = self.joints = 0

    def source(self, name):
        entry, = [c for c in self.manifest["cameras"] if c["name"] == name]
        return self.dataset.cameras[entry["dataset_name"]], entry["undistorted"]

    def mask(self, name, frame):
        """Path of the dataset's mask, and whether the export's image has the dataset's pixels."""
        entry, = [c for c in self.manifest["cameras"] if c["name"] == name]
        source = entry["dataset_name"]
        return "%s/masks/%s/%s_%08d.png" % (self.dataset.root, source, source, frame), not entry["undistorted"]

    def camera(self, name, camera, frames, project=None):
        """`camera` as exported under `name`; `project` replaces its projection where the reader has its own."""
        truth, undistorted = self.source(name)
        for frame in frames or sorted(self.dataset.frames):  # cameras exported alone have no frames
            for X, _ in self.dataset.frames[frame].values():
                X = X[~np.isnan(X[:, 0])]
                X = X[truth.in_cam(X)[:, 2] > 0]
                if not len(X):
                    continue
                expected = truth.project(X)
                inside = np.all((expected > -0.5) & (expected < np.array(truth.size) - 0.5), 1)
                if not inside.any():
                    continue
                got = (project or camera.project)(X[inside])
                if undistorted:
                    check(not camera.dist.any(), name + ": an undistorted camera with distortion")
                    k = camera.K
                    got = truth.from_normalised((got - k[:2, 2]) / [k[0, 0], k[1, 1]])
                self.max_px = max(self.max_px, float(np.abs(got - expected[inside]).max()))
                self.pixels += int(inside.sum())

    def joint_set(self, frame, person, X, tolerance_m=None):
        """(19, 3), nan where missing."""
        truth = self.dataset.frames[frame][person][0]
        check(np.array_equal(np.isnan(X[:, 0]), np.isnan(truth[:, 0])), "frame %d: other joints are missing" % frame)
        both = ~np.isnan(X[:, 0]) & ~np.isnan(truth[:, 0])
        if both.any():
            error = float(np.linalg.norm(X[both] - truth[both], axis=1).max())
            self.max_m = max(self.max_m, error)
            self.joints += int(both.sum())
            if tolerance_m is not None:
                check(error <= tolerance_m, "frame %d: a joint is off by %g m" % (frame, error))
            for name, camera in self.dataset.cameras.items():
                ok = both & (camera.in_cam(np.nan_to_num(truth))[:, 2] > 0.05)
                if ok.any() and error < 1e-3:
                    px = np.abs(camera.project(X[ok]) - camera.project(truth[ok])).max()
                    self.max_px = max(self.max_px, float(px))
                    self.pixels += int(ok.sum())


def rig_manifest(dataset):
    """Of cameras written by `calib convert`, which leaves no export.json."""
    cameras = [{"name": name, "dataset_name": name, "undistorted": False} for name in dataset.cameras]
    return {"frames": [], "cameras": cameras, "pictures": 0, "masks": 0, "masks_as": "none"}


def instants(folder, frames):
    if not frames:
        return {None: folder}
    if len(frames) == 1:
        return {frames[0]: folder}
    return {f: "%s/frame_%08d" % (folder, f) for f in frames}


def need_file(path):
    return check(os.path.isfile(path), path + " is missing")


def quaternion_matrix(w, x, y, z):
    n = w * w + x * x + y * y + z * z
    s = 2 / n
    return np.array([[1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
                     [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
                     [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)]])


def rodrigues(v):
    angle = np.linalg.norm(v)
    if angle == 0:
        return np.eye(3)
    x, y, z = np.array(v) / angle
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew
