"""nerfstudio's transforms.json."""

import json
import os

import numpy as np

from exports.common import Camera, check, instants, need_file
from exports.ply_file import read_ply
from exports.splatting import check_alpha


def read_nerfstudio(folder, compare):
    for frame, root in instants(folder, compare.manifest["frames"]).items():
        meta = json.load(open(root + "/transforms.json"))
        check(meta["camera_model"] == "OPENCV", "camera_model")
        check(np.array_equal(meta.get("applied_transform", np.eye(4)[:3]), np.eye(4)[:3]), "applied_transform")
        names = []
        for f in meta["frames"]:
            c2w = np.array(f["transform_matrix"])
            check(np.array_equal(c2w[3], [0, 0, 0, 1]), "transform_matrix")
            R = (c2w[:3, :3] @ np.diag([1, -1, -1])).T  # OpenGL axes to x right, y down, z forward
            f = {**meta, **f}  # what all cameras share may stand once
            K = [[f["fl_x"], 0, f["cx"] - 0.5], [0, f["fl_y"], f["cy"] - 0.5], [0, 0, 1]]
            camera = Camera(K, [f["k1"], f["k2"], f["p1"], f["p2"], 0], R, -R @ c2w[:3, 3], (f["w"], f["h"]))
            names.append(f["file_path"])
            if compare.manifest["pictures"]:
                need_file(root + "/" + f["file_path"])
            if compare.manifest["masks_as"] == "alpha":
                name = os.path.basename(f["file_path"]).rsplit(".", 1)[0]
                check_alpha(root + "/" + f["file_path"], *compare.mask(name, frame))
            check("mask_path" not in f or compare.manifest["masks_as"] == "folder", "mask_path was not asked for")
            if "mask_path" in f:
                need_file(root + "/" + f["mask_path"])
            compare.camera(os.path.basename(f["file_path"]).rsplit(".", 1)[0], camera, [frame] if frame is not None else [])
        if "train_filenames" in meta:
            train, test = set(meta["train_filenames"]), set(meta["test_filenames"])
            check(not train & test and train | test <= set(names), "train and test")
        if "ply_file_path" in meta:
            points = read_ply(root + "/" + meta["ply_file_path"])["vertex"]
            check(len(points) > 0 and {"x", "y", "z", "red"} <= set(points.dtype.names), "points")
    return {"points": len(points) if "ply_file_path" in meta else 0}
