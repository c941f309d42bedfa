#include "dataset/exports/writers.h"
#include "geometry/rig/rig_io.h"

/// Blender, which has no file for a camera with its principal point off the centre but can hold one: a script that makes the
/// cameras from the calibration beside it, and images without distortion for their backgrounds.
namespace mvstudio::exports {
namespace {

constexpr char kScript[] = R"python("""The cameras of a studio in Blender 2.93 or later, with their images as backgrounds.

    blender -P cameras.py                     opens them
    blender -b -P cameras.py -- OUT.blend     saves them

calibration.json beside this file holds the cameras. Metres, z up, as in the dataset. Image size and the shape of the pixels belong to
a scene: cameras that differ in them get a scene of their own.
"""

import json
import os
import sys

FOLDER = os.path.dirname(os.path.abspath(__file__))
SENSOR_MM = 36.0


def blender_lens(camera):
    """Blender's numbers of a camera of calibration.json. shift is a share of the image's width in both directions; the principal
    point counts from the centre of the first pixel."""
    (width, height), lens = camera["size_px"], camera["intrinsics"]
    fx, fy, cx, cy = lens["fx"], lens["fy"], lens["cx"], lens["cy"]
    aspect = fx / fy  # height of a pixel, of its width
    return {"lens_mm": fx * SENSOR_MM / width,
            "shift_x": (width / 2 - (cx + 0.5)) / width,
            "shift_y": aspect * ((cy + 0.5) - height / 2) / width,
            "size": (width, height),
            "pixel_aspect": (1.0, aspect) if aspect >= 1 else (1 / aspect, 1.0)}


def pictures_of(name):
    """(frame number, path) of the camera's images."""
    folder = os.path.join(FOLDER, "images", name)
    files = sorted(f for f in os.listdir(folder) if f[0] != ".") if os.path.isdir(folder) else []
    return [(int(os.path.splitext(f)[0]), os.path.join(folder, f)) for f in files]


def add_background(data, images, bpy):
    first, last = images[0][0], images[-1][0]
    image = bpy.data.images.load(images[0][1])
    data.show_background_images = True
    background = data.background_images.new()
    background.image, background.alpha, background.frame_method = image, 1.0, "STRETCH"
    if last > first:
        image.source = "SEQUENCE"
        background.image_user.frame_start, background.image_user.frame_offset = first, first - 1
        background.image_user.frame_duration = last - first + 1


def add_camera(camera, collection, bpy, mathutils):
    lens = blender_lens(camera)
    data = bpy.data.cameras.new(camera["name"])
    data.type, data.sensor_fit, data.sensor_width, data.lens = "PERSP", "HORIZONTAL", SENSOR_MM, lens["lens_mm"]
    data.shift_x, data.shift_y = lens["shift_x"], lens["shift_y"]
    data.clip_start, data.clip_end, data.display_size = 0.01, 1000.0, 0.3
    x, y, z, w = camera["cam_from_world"]["rotation_xyzw"]
    pose = mathutils.Quaternion((w, x, y, z)).to_matrix().to_4x4()
    pose.translation = camera["cam_from_world"]["translation"]
    turn = mathutils.Matrix.Diagonal((1.0, -1.0, -1.0, 1.0))  # Blender's cameras look along -z with y up
    node = bpy.data.objects.new(camera["name"], data)
    node.matrix_world = pose.inverted() @ turn
    collection.objects.link(node)
    pictures = pictures_of(camera["name"])
    if pictures:
        add_background(data, pictures, bpy)
    return node, lens, pictures


def scene_of(lens, scenes, collection, bpy):
    """The scene with this image size and shape of pixels."""
    key = lens["size"] + lens["pixel_aspect"]
    if key not in scenes:
        scene = scenes[key] = bpy.context.scene if not scenes else bpy.data.scenes.new("cameras %d" % (len(scenes) + 1))
        scene.collection.children.link(collection)
        render = scene.render
        render.resolution_x, render.resolution_y = lens["size"]
        render.resolution_percentage = 100
        render.pixel_aspect_x, render.pixel_aspect_y = lens["pixel_aspect"]
    return scenes[key]


def main():
    import bpy
    import mathutils
    cameras = json.load(open(os.path.join(FOLDER, "calibration.json"), encoding="utf-8"))["cameras"]
    collection = bpy.data.collections.new("studio cameras")
    scenes = {}
    for camera in cameras:
        node, lens, pictures = add_camera(camera, collection, bpy, mathutils)
        scene = scene_of(lens, scenes, collection, bpy)
        node["scene"] = scene.name  # the scene to look through this camera in
        if scene.camera is None or scene.camera.name not in collection.objects:
            scene.camera = node
        if pictures:
            scene.frame_start, scene.frame_end = pictures[0][0], max(pictures[-1][0], pictures[0][0])
            scene.frame_set(pictures[0][0])
    print("%d cameras in %d scenes" % (len(cameras), len(scenes)))
    if "--" in sys.argv and sys.argv[-1] != "--":
        bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath(sys.argv[-1]))


if __name__ == "__main__":
    main()
)python";

}  // namespace

void WriteBlender(const Job& job) {
  job.Write("calibration.json", geometry::RigToJsonText(RigOf(job.take, AllViews(job.take))));
  job.Write("cameras.py", kScript);
  for (const int frame : job.take.frames) {
    for (size_t i = 0; i < job.take.views.size(); ++i)
      job.images.AddImage(i, frame, Numbered("images/" + job.take.views[i].info.name + "/", frame, 6, ""));
  }
}

}  // namespace mvstudio::exports
