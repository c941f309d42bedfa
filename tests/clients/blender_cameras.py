"""Runs an export's cameras.py in Blender and compares Blender's own projection of points with that of calibration.json.

Usage: blender --background --python blender_cameras.py -- FOLDER

Prints a JSON object with the largest difference in pixels.
"""

import json
import os
import runpy
import sys

import bpy
import mathutils
from bpy_extras.object_utils import world_to_camera_view

FOLDER = sys.argv[-1]
POINTS = [(0, 0, 1), (0.4, 0.2, 0.1), (-0.3, 0.5, 1.7), (0.2, -0.6, 0.9)]


def expected(camera, point):
    x, y, z, w = camera["cam_from_world"]["rotation_xyzw"]
    p = mathutils.Quaternion((w, x, y, z)) @ mathutils.Vector(point) + mathutils.Vector(camera["cam_from_world"]["translation"])
    k = camera["intrinsics"]
    return k["fx"] * p.x / p.z + k["cx"], k["fy"] * p.y / p.z + k["cy"]


def shown(background, frame):
    """The image that a background shows at a frame, as Blender's manual counts sequences: `size` of a sequence itself is that of
    the file with frame 0 or 1, if there is one."""
    folder, name = os.path.split(background.image.filepath)
    stem, ending = os.path.splitext(name)
    user = background.image_user
    number = int(stem) if background.image.source == "FILE" else frame - user.frame_start + 1 + user.frame_offset
    return bpy.data.images.load(os.path.join(folder, f"{number:0{len(stem)}d}{ending}"))


def main():
    sys.argv = sys.argv[:1]
    runpy.run_path(FOLDER + "/cameras.py", run_name="__main__")
    worst, cameras, pictures = 0.0, json.load(open(FOLDER + "/calibration.json"))["cameras"], 0
    for scene in bpy.data.scenes:
        for layer in scene.view_layers:
            layer.update()
    for camera in cameras:
        node = bpy.data.objects[camera["name"]]
        scene = bpy.data.scenes[node["scene"]]
        pictures += sum(1 for b in node.data.background_images if list(shown(b, scene.frame_current).size) == camera["size_px"])
        for point in POINTS:
            seen = world_to_camera_view(bpy.data.scenes[node["scene"]], node, mathutils.Vector(point))
            u, v = expected(camera, point)
            width, height = camera["size_px"]
            worst = max(worst, abs(seen.x * width - 0.5 - u), abs((1 - seen.y) * height - 0.5 - v))
    print(json.dumps({"cameras": len(cameras), "scenes": len(bpy.data.scenes), "pictures": pictures, "max_px": worst}))


main()
