"""COLMAP's sparse model, binary and text."""

import os
import struct

import numpy as np

from exports.common import Camera, check, instants, need_file, quaternion_matrix
from exports.ply_file import read_ply
from exports.splatting import check_alpha, loader_px


COLMAP_MODELS = {0: ("SIMPLE_PINHOLE", 3), 1: ("PINHOLE", 4), 4: ("OPENCV", 8), 5: ("OPENCV_FISHEYE", 8), 6: ("FULL_OPENCV", 12)}


class Bytes:
    def __init__(self, path):
        self.data, self.at, self.path = open(path, "rb").read(), 0, path

    def take(self, form):
        values = struct.unpack_from("<" + form, self.data, self.at)
        self.at += struct.calcsize("<" + form)
        return values if len(values) > 1 else values[0]

    def text(self):
        end = self.data.index(b"\0", self.at)
        text = self.data[self.at:end].decode()
        self.at = end + 1
        return text

    def finish(self):
        check(self.at == len(self.data), self.path + ": bytes after the end")


def colmap_binary(folder):
    cameras, images, points = {}, {}, {}
    f = Bytes(folder + "/cameras.bin")
    for _ in range(f.take("Q")):
        ident, model, w, h = f.take("iiQQ")
        name, count = COLMAP_MODELS[model]
        cameras[ident] = (name, w, h, f.take("%dd" % count))
    f.finish()
    f = Bytes(folder + "/images.bin")
    for _ in range(f.take("Q")):
        ident = f.take("i")
        pose, camera, name = f.take("7d"), f.take("i"), f.text()
        images[ident] = (pose, camera, name, [f.take("ddq") for _ in range(f.take("Q"))])
    f.finish()
    f = Bytes(folder + "/points3D.bin")
    for _ in range(f.take("Q")):
        ident = f.take("Q")
        X, rgb, error = f.take("3d"), f.take("3B"), f.take("d")
        points[ident] = (X, rgb, error, [f.take("ii") for _ in range(f.take("Q"))])
    f.finish()
    return cameras, images, points


def colmap_text(folder):
    def lines(name):
        return [line.rstrip("\n") for line in open(folder + "/" + name) if not line.startswith("#")]

    cameras, images, points = {}, {}, {}
    for line in lines("cameras.txt"):
        w = line.split()
        cameras[int(w[0])] = (w[1], int(w[2]), int(w[3]), tuple(map(float, w[4:])))
    rows = lines("images.txt")
    for first, second in zip(rows[::2], rows[1::2]):
        w, p = first.split(), second.split()
        features = [(float(p[i]), float(p[i + 1]), int(p[i + 2])) for i in range(0, len(p), 3)]
        images[int(w[0])] = (tuple(map(float, w[1:8])), int(w[8]), w[9], features)
    for line in lines("points3D.txt"):
        w = line.split()
        track = [(int(w[i]), int(w[i + 1])) for i in range(8, len(w), 2)]
        points[int(w[0])] = (tuple(map(float, w[1:4])), tuple(map(int, w[4:7])), float(w[7]), track)
    return cameras, images, points


def read_colmap(folder, compare):
    worst_track, at_joints, colours, off_px, opaque = 0.0, 0, set(), 0.0, []
    for frame, root in instants(folder, compare.manifest["frames"]).items():
        alone = frame is None
        binary = colmap_binary(root if alone else root + "/sparse/0")
        check(alone or binary == colmap_text(root + "/sparse/0"), "the binary and the text model differ")
        cameras, images, points = binary
        readers = {}
        for ident, (pose, camera_id, name, _) in images.items():
            model, w, h, p = cameras[camera_id]
            K = [[p[0], 0, p[2] - 0.5], [0, p[1], p[3] - 0.5], [0, 0, 1]]
            dist = list(p[4:9]) + [0] * (5 - len(p[4:9]))
            check(model != "FULL_OPENCV" or not any(p[9:]), "k4, k5, k6 are not 0")
            readers[ident] = Camera(K, dist, quaternion_matrix(*pose[:4]), pose[4:], (w, h))
            if compare.manifest["pictures"]:
                need_file(root + "/images/" + name)
            if compare.manifest["masks_as"] == "alpha":
                opaque.append(check_alpha(root + "/images/" + name, *compare.mask(name.rsplit(".", 1)[0], frame)))
            elif compare.manifest["masks"]:
                need_file(root + "/masks/" + name + ".png")
            off_px = max(off_px, loader_px(readers[ident], [X for X, *_ in points.values()]))
            compare.camera(name.rsplit(".", 1)[0], readers[ident], [] if alone else [frame])
        if alone:
            return {}
        ply = read_ply(root + "/sparse/0/points3D.ply")["vertex"]
        check(len(ply) == len(points), "points3D.ply has other points than points3D.bin")
        joints = np.concatenate([X for X, _ in compare.dataset.frames[frame].values()] or [np.zeros((0, 3))])
        joints = joints[~np.isnan(joints[:, 0])]
        for row, (ident, (X, rgb, error, track)) in zip(ply, sorted(points.items())):
            distance = np.linalg.norm(joints - X, axis=1).min() if len(joints) else np.inf
            check(distance < 1, "point %d is %g m from every joint" % (ident, distance))
            at_joints += distance < 1e-9
            check(np.allclose([row["x"], row["y"], row["z"]], X, rtol=1e-6, atol=1e-6), "point %d differs in points3D.ply" % ident)
            check((row["red"], row["green"], row["blue"]) == rgb, "point %d has another colour in points3D.ply" % ident)
            check({"nx", "ny", "nz"} <= set(ply.dtype.names) and error == 0, "points3D.ply lacks normals, or an error is not 0")
            colours.add(rgb)
            check(len(track) >= 2, "point %d has a track of one" % ident)
            for image, feature in track:
                u, v, point = images[image][3][feature]
                check(point == ident, "track and feature disagree")
                worst_track = max(worst_track, float(np.abs(readers[image].project(X) + 0.5 - [u, v]).max()))
    check(compare.manifest["masks_as"] == "folder" or not os.path.isdir(folder + "/masks"), "masks/ was not asked for")
    return {"splatting_px": off_px, "opaque": opaque, "track_px": worst_track, "points": len(points), "at_joints": int(at_joints), "colours": sorted(colours)[:20],
            "pinhole": all(model in ("PINHOLE", "SIMPLE_PINHOLE") for model, *_ in cameras.values())}
