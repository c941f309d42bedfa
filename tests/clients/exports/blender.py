"""cameras.py and calibration.json: the script's numbers, drawn by Blender's rule for cameras."""

import importlib.util
import json

import numpy as np

from exports.common import Camera, check, need_file, quaternion_matrix


def load_script(folder):
    spec = importlib.util.spec_from_file_location("cameras", folder + "/cameras.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)  # makes nothing: Blender is asked for in main() alone
    return script


def through_blender(camera, lens, sensor_mm):
    """Projection by what Blender's manual says of sensor fit "horizontal": the sensor's width is the image's, shifts are shares of it."""
    width, height = lens["size"]
    aspect = lens["pixel_aspect"][1] / lens["pixel_aspect"][0]

    def project(X):
        x = camera.in_cam(X)
        right, up = x[..., 0] / x[..., 2], -x[..., 1] / x[..., 2]
        scale = lens["lens_mm"] / sensor_mm * width
        return np.stack([width / 2 + scale * right - lens["shift_x"] * width - 0.5,
                         height / 2 - (scale * up - lens["shift_y"] * width) / aspect - 0.5], -1)

    return project


def read_blender(folder, compare):
    script = load_script(folder)
    cameras = json.load(open(folder + "/calibration.json"))["cameras"]
    frames = compare.manifest["frames"]
    for camera in cameras:
        lens = script.blender_lens(camera)
        check(min(lens["pixel_aspect"]) == 1, "Blender's aspects are 1 or more")
        x, y, z, w = camera["cam_from_world"]["rotation_xyzw"]
        k = camera["intrinsics"]
        pose = Camera([[k["fx"], 0, k["cx"]], [0, k["fy"], k["cy"]], [0, 0, 1]], [0] * 5, quaternion_matrix(w, x, y, z),
                      camera["cam_from_world"]["translation"], camera["size_px"])
        check(camera["model"] == "pinhole", "a lens that Blender does not have")
        compare.camera(camera["name"], pose, frames, through_blender(pose, lens, script.SENSOR_MM))
        pictures = script.pictures_of(camera["name"])
        check(not compare.manifest["pictures"] or [f for f, _ in pictures] == frames, "images")
        for _, path in pictures:
            need_file(path)
    return {}
