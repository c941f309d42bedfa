#!/usr/bin/env python3
"""Reads a dataset in CMU Panoptic's layout the way its users' readers do; needs numpy, knows nothing of mvstudio.

Two readers side by side, written from their published rules:
- "voxel": world with z up in millimetres. M = [[1,0,0],[0,0,-1],[0,1,0]]; points X M * 10; R' = R M, T = -R'^T t * 10;
  k = distCoef[0,1,4], p = distCoef[2,3]; a body counts when its BodyCenter has c > 0.1, a joint when its c > 0.1; the picture of a
  body3DScene file is the one whose name differs in `body3DScene` -> camera and `.json` -> `.jpg`.
- "toolbox": the file's own centimetres, x_cam = R x + t, OpenCV's five coefficients.

    panoptic_reader.py DATASET [--cameras 00_03,00_06] [--step N] [--require-pictures] > result.json

Prints {"cameras": [...], "frames": [{"frame", "picture": {camera: path}, "bodies": [{"id", "points_mm", "counts",
"px": {camera: {"voxel": [[u, v]…], "toolbox": …, "depth_mm": […]}}}]}]}. Exit code 1 with one line when a rule is broken.
"""
import argparse
import glob
import json
import os
import sys

import numpy as np

M = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
NUM_JOINTS = 19
BODY_CENTER = 2


class BrokenRule(Exception):
    pass


def require(condition, text):
    if not condition:
        raise BrokenRule(text)


def load_cameras(root):
    paths = glob.glob(os.path.join(root, "calibration_*.json"))
    require(len(paths) == 1, f"{root}: {len(paths)} calibration files")
    sequence = os.path.basename(paths[0])[len("calibration_"):-len(".json")]
    with open(paths[0]) as file:
        calibration = json.load(file)
    cameras = {}
    for entry in calibration["cameras"]:
        name = entry["name"]
        require(name == "%02d_%02d" % (entry["panel"], entry["node"]), f"camera {name}: panel and node say otherwise")
        require(name not in cameras, f"camera {name} is there twice")
        require(entry["type"] in ("hd", "vga", "kinect-color"), f"camera {name}: type {entry['type']}")
        camera = {key: np.array(entry[key], dtype=float) for key in ("K", "distCoef", "R", "t", "resolution")}
        camera["t"] = camera["t"].reshape(3, 1)
        shapes = {"K": (3, 3), "distCoef": (5,), "R": (3, 3), "t": (3, 1), "resolution": (2,)}
        for key, shape in shapes.items():
            require(camera[key].shape == shape, f"camera {name}: {key} has shape {camera[key].shape}")
        require(abs(camera["R"] @ camera["R"].T - np.eye(3)).max() < 1e-6, f"camera {name}: R is no rotation")
        require(np.linalg.det(camera["R"]) > 0, f"camera {name}: R mirrors")
        cameras[name] = camera
    return sequence, cameras


def voxel_camera(camera):
    """As the voxel readers keep a camera: rotation, place in mm, fx, fy, cx, cy, three radial and two tangential coefficients."""
    rotation = camera["R"] @ M
    place_mm = -rotation.T @ camera["t"] * 10.0
    return rotation, place_mm, camera["K"], camera["distCoef"][[0, 1, 4]], camera["distCoef"][[2, 3]]


def project_voxel(points_mm, camera):
    rotation, place_mm, intrinsics, k, p = voxel_camera(camera)
    in_camera = rotation @ (points_mm.T - place_mm)
    y = in_camera[:2] / in_camera[2]
    r2 = np.sum(y * y, axis=0)
    radial = 1 + k[0] * r2 + k[1] * r2**2 + k[2] * r2**3
    tangential = p[0] * y[1] + p[1] * y[0]
    y = y * (radial + 2 * tangential) + np.outer(p[::-1], r2)
    focal = np.array([[intrinsics[0, 0]], [intrinsics[1, 1]]])
    center = np.array([[intrinsics[0, 2]], [intrinsics[1, 2]]])
    return (focal * y + center).T, in_camera[2]


def project_toolbox(points_cm, camera):
    a, b, depth = camera["R"] @ points_cm.T + camera["t"]
    a, b = a / depth, b / depth
    k1, k2, p1, p2, k3 = camera["distCoef"]
    r2 = a * a + b * b
    radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
    u = a * radial + 2 * p1 * a * b + p2 * (r2 + 2 * a * a)
    v = b * radial + 2 * p2 * a * b + p1 * (r2 + 2 * b * b)
    K = camera["K"]
    return np.stack([K[0, 0] * u + K[0, 1] * v + K[0, 2], K[1, 1] * v + K[1, 2]], axis=1)


def read_bodies(path):
    with open(path) as file:
        scene = json.load(file)
    for body in scene["bodies"]:
        joints = np.array(body["joints19"], dtype=float)
        require(joints.shape == (4 * NUM_JOINTS,), f"{path}: joints19 has shape {joints.shape}")
        joints = joints.reshape(-1, 4)
        counts = joints[:, 3] > 0.1
        if body["id"] >= 0 and counts[BODY_CENTER]:
            yield body["id"], joints[:, :3], counts


def read_frame(root, path, cameras, require_pictures):
    stem = os.path.basename(path)
    pictures = {}
    for name in cameras:
        picture = os.path.join("hdImgs", name, stem.replace("body3DScene", name).replace("json", "jpg"))
        if require_pictures:
            require(os.path.exists(os.path.join(root, picture)), f"{picture}: is not there")
        pictures[name] = picture
    bodies = []
    for body_id, points_cm, counts in read_bodies(path):
        points_mm = points_cm @ M * 10.0
        px = {}
        for name, camera in cameras.items():
            voxel, depth_mm = project_voxel(points_mm, camera)
            px[name] = {"voxel": voxel.tolist(), "toolbox": project_toolbox(points_cm, camera).tolist(),
                        "depth_mm": depth_mm.tolist()}
        bodies.append({"id": body_id, "points_mm": points_mm.tolist(), "counts": counts.tolist(), "px": px})
    return {"frame": int(stem[len("body3DScene_"):-len(".json")]), "picture": pictures, "bodies": bodies}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("dataset")
    parser.add_argument("--cameras", default="")
    parser.add_argument("--step", type=int, default=1)
    parser.add_argument("--require-pictures", action="store_true")
    arguments = parser.parse_args()
    sequence, cameras = load_cameras(arguments.dataset)
    if arguments.cameras:
        chosen = arguments.cameras.split(",")
        require(all(name in cameras for name in chosen), f"cameras {arguments.cameras}: not all are there")
        cameras = {name: cameras[name] for name in chosen}
    files = sorted(glob.glob(os.path.join(arguments.dataset, "hdPose3d_stage1_coco19", "body3DScene_*.json")))
    require(files, "no body3DScene files")
    frames = [read_frame(arguments.dataset, path, cameras, arguments.require_pictures) for path in files[::arguments.step]]
    json.dump({"sequence": sequence, "cameras": sorted(cameras), "frames": frames}, sys.stdout)


if __name__ == "__main__":
    try:
        main()
    except BrokenRule as rule:
        sys.exit(str(rule))
