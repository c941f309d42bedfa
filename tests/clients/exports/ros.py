"""camera_info files of ROS: lenses alone."""

import re

import numpy as np

from exports.common import Camera, check


def numbers(text, key):
    """Of `key: {rows, cols, data}`."""
    found = re.search(key + r":\n  rows: (\d+)\n  cols: (\d+)\n  data: \[(.*)\]", text)
    values = np.array([float(v) for v in found.group(3).split(",")])
    return values.reshape(int(found.group(1)), int(found.group(2)))


def read_ros(folder, compare):
    for entry in compare.manifest["cameras"]:
        text = open(folder + "/" + entry["name"] + ".yaml").read()
        truth, _ = compare.source(entry["name"])
        size = [int(re.search(key + r": (\d+)", text).group(1)) for key in ("image_width", "image_height")]
        check(size == list(truth.size) and "camera_name: " + entry["name"] in text, "size or name")
        check("distortion_model: plumb_bob" in text, "distortion_model")
        K, P = numbers(text, "camera_matrix"), numbers(text, "projection_matrix")
        check(np.array_equal(P[:, :3], K) and not P[:, 3].any(), "projection_matrix")
        check(np.array_equal(numbers(text, "rectification_matrix"), np.eye(3)), "rectification_matrix")
        compare.camera(entry["name"], Camera(K, numbers(text, "distortion_coefficients"), truth.R, truth.t), compare.manifest["frames"])
    return {}
