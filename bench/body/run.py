#!/usr/bin/python3
"""How a fitted body bears bad input: held-out scores without a network, fitted beside unfitted.

run.py DATASET --out FOLDER --train-cameras A,B,C --holdout-cameras D,E --holdout-frames 90-119 [--variants exact,joints-5px,...]
       [--size 96] [--pose-by images|joints] [--program FILE]

Copies the dataset's calibration, joints and masks with one fault each (images stay where they are, as links), fits a body to it, and
scores it on the dataset's true held-out images and masks. Held-out cameras keep their calibration and masks. Writes
FOLDER/robustness.md and robustness.json. Finished variants are kept: run it again to go on. Needs numpy and scikit-image.

Variants: exact; joints-Npx: each joint is triangulated again from its projections with N px of noise in every training camera;
eroded, dilated: masks by 2 px; wrong-masks: one mask of ten is that of another frame; camera: the first training camera is turned by
0.3 degrees; one-camera: the first training camera alone; few-frames: three frames; gaps: every third joint is missing at random.
"""
import argparse
import json
import os
import shutil
import subprocess
import sys

import numpy as np
from skimage import io, morphology

VARIANTS = ["exact", "joints-2px", "joints-5px", "joints-10px", "eroded", "dilated", "wrong-masks", "camera", "one-camera", "few-frames",
            "gaps"]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset")
    parser.add_argument("--out", required=True)
    parser.add_argument("--train-cameras", required=True)
    parser.add_argument("--holdout-cameras", required=True)
    parser.add_argument("--holdout-frames", required=True)
    parser.add_argument("--variants", default=",".join(VARIANTS))
    parser.add_argument("--size", default="96")
    parser.add_argument("--pose-by", default="images")
    parser.add_argument("--program", default="build/release/bin/mvstudio")
    return parser.parse_args()


def read_json(path):
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def write_json(path, value):
    with open(path, "w", encoding="utf-8") as file:
        json.dump(value, file)


def calibration_path(folder):
    return [os.path.join(folder, name) for name in os.listdir(folder) if name.startswith("calibration_")][0]


def copy_with_links(source, folder):
    """A dataset whose images and masks are links."""
    os.makedirs(folder)
    os.symlink(os.path.abspath(os.path.join(source, "hdImgs")), os.path.join(folder, "hdImgs"))
    calibration = calibration_path(source)
    write_json(os.path.join(folder, os.path.basename(calibration)), read_json(calibration))
    joints = os.path.join(folder, "hdPose3d_stage1_coco19")
    os.makedirs(joints)
    for name in os.listdir(os.path.join(source, "hdPose3d_stage1_coco19")):
        write_json(os.path.join(joints, name), read_json(os.path.join(source, "hdPose3d_stage1_coco19", name)))
    for camera in os.listdir(os.path.join(source, "masks")):
        there = os.path.join(source, "masks", camera)
        here = os.path.join(folder, "masks", camera)
        os.makedirs(here)
        for name in os.listdir(there):
            os.symlink(os.path.abspath(os.path.join(there, name)), os.path.join(here, name))


def each_scene(folder, change):
    """`change`(19 joints (19, 4) as read) for each person of each frame."""
    joints = os.path.join(folder, "hdPose3d_stage1_coco19")
    for name in sorted(os.listdir(joints)):
        scene = read_json(os.path.join(joints, name))
        for body in scene["bodies"]:
            body["joints19"] = change(np.array(body["joints19"]).reshape(19, 4)).ravel().tolist()
        write_json(os.path.join(joints, name), scene)


def projections(folder, cameras):
    """3 x 4 matrices, pixels from centimetres."""
    all_cameras = {camera["name"]: camera for camera in read_json(calibration_path(folder))["cameras"]}
    return [np.array(all_cameras[c]["K"]) @ np.hstack([np.array(all_cameras[c]["R"]), np.array(all_cameras[c]["t"]).reshape(3, 1)])
            for c in cameras]


def triangulate(matrices, pixels):
    """Linear triangulation (Hartley and Zisserman, Multiple View Geometry, 12.2)."""
    rows = [row for p, (u, v) in zip(matrices, pixels) for row in (u * p[2] - p[0], v * p[2] - p[1])]
    rows = [row / np.linalg.norm(row[:3]) for row in rows]
    point = np.linalg.svd(np.array(rows))[2][-1]
    return point[:3] / point[3]


def noisy_joints(folder, cameras, sigma_px, rng):
    matrices = projections(folder, cameras)

    def change(joints):
        for j in range(19):
            seen = [p @ np.append(joints[j, :3], 1) for p in matrices]
            joints[j, :3] = triangulate(matrices, [x[:2] / x[2] + rng.normal(0, sigma_px, 2) for x in seen])
        return joints
    each_scene(folder, change)


def each_mask(folder, cameras, change):
    """`change`(camera, names, i) gives the pixels of the mask `names[i]` of a training camera."""
    for camera in cameras:
        names = sorted(os.listdir(os.path.join(folder, "masks", camera)))
        masks = [change(camera, names, i) for i in range(len(names))]
        for name, mask in zip(names, masks):
            path = os.path.join(folder, "masks", camera, name)
            os.unlink(path)
            io.imsave(path, mask, check_contrast=False)


def read_mask(folder, camera, name):
    return io.imread(os.path.join(folder, "masks", camera, name))


def turn_camera(folder, name, degrees):
    """About its own y axis: the image slides sideways."""
    path = calibration_path(folder)
    rig = read_json(path)
    angle = np.radians(degrees)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    for camera in rig["cameras"]:
        if camera["name"] == name:
            camera["R"] = (turn @ np.array(camera["R"])).tolist()
            camera["t"] = (turn @ np.array(camera["t"]).reshape(3, 1)).tolist()
    write_json(path, rig)


def keep_frames(folder, frames, holdout):
    """Of the others nobody knows the joints. `holdout`: FIRST-LAST."""
    first, last = (int(word) for word in holdout.split("-"))
    joints = os.path.join(folder, "hdPose3d_stage1_coco19")
    for name in os.listdir(joints):
        frame = int(name.split("_")[-1].split(".")[0])
        if frame not in frames and not first <= frame <= last:
            os.unlink(os.path.join(joints, name))


def make_faulty(a, variant, folder):
    cameras = a.train_cameras.split(",")
    rng = np.random.default_rng(5)
    copy_with_links(a.dataset, folder)
    if variant.startswith("joints-"):
        noisy_joints(folder, cameras, float(variant[len("joints-"):-len("px")]), rng)
    disk = morphology.disk(2)
    if variant == "eroded":
        each_mask(folder, cameras, lambda camera, names, i: morphology.erosion(read_mask(folder, camera, names[i]), disk))
    if variant == "dilated":
        each_mask(folder, cameras, lambda camera, names, i: morphology.dilation(read_mask(folder, camera, names[i]), disk))
    if variant == "wrong-masks":
        each_mask(folder, cameras, lambda camera, names, i: read_mask(
            folder, camera, names[(i + len(names) // 3) % len(names) if rng.random() < 0.1 else i]))
    if variant == "camera":
        turn_camera(folder, cameras[0], 0.3)
    if variant == "few-frames":
        keep_frames(folder, [0, 30, 60], a.holdout_frames)
    if variant == "gaps":
        def drop(joints):
            for j in (4, 5, 7, 8, 10, 11, 13, 14):  # limbs: elbows, wrists, knees, ankles
                if rng.random() < 1 / 3:
                    joints[j, 3] = -1
            return joints
        each_scene(folder, drop)


def call(program, words):
    run = subprocess.run([program, *words, "--json"], capture_output=True, text=True)
    if run.returncode not in (0, 6):
        sys.exit(f"{program} {' '.join(words)}\nended with {run.returncode}: {run.stderr.strip() or run.stdout.strip()}")
    return json.loads(run.stdout)


def score(a, dataset, variant, fit, out):
    cameras = a.train_cameras.split(",")[0] if variant == "one-camera" else a.train_cameras
    train = call(a.program, ["avatar", "train", dataset, "--out", out, "--steps", "0", "--size", a.size, "--fit", fit, "--pose-by", a.pose_by,
                             "--train-cameras", cameras, "--holdout-cameras", a.holdout_cameras, "--holdout-frames", a.holdout_frames])
    scores = call(a.program, ["avatar", "eval", out, "--overwrite", "--features", "gabor"])["metrics"]
    found = scores["baselines"].get("body_alone") or scores["baselines"]["template_alone"]
    return {"ssim": found["ssim"], "psnr_db": found["psnr_db"], "iou": found["mask_iou"], "warnings": train["warnings"],
            "body": train["metrics"].get("body")}


def row(variant, result):
    fitted, unfitted = result["auto"], result["girths"]
    named = sorted({warning["code"] for warning in fitted["warnings"]})
    rejected = len(fitted["body"]["rejected"]) if fitted["body"] else 0
    return (f"| {variant} | {unfitted['ssim']:.3f} | {fitted['ssim']:.3f} | {unfitted['iou']:.3f} | {fitted['iou']:.3f} | {rejected} | "
            f"{', '.join(named)} |")


def main():
    a = arguments()
    os.makedirs(a.out, exist_ok=True)
    results_path = os.path.join(a.out, "robustness.json")
    results = read_json(results_path) if os.path.exists(results_path) else {}
    for variant in a.variants.split(","):
        dataset = os.path.join(a.out, variant)
        if not os.path.isdir(dataset):
            shutil.rmtree(dataset + ".part", ignore_errors=True)
            make_faulty(a, variant, dataset + ".part")
            os.rename(dataset + ".part", dataset)
        for fit in ("girths", "auto"):
            if fit in results.setdefault(variant, {}):
                continue
            results[variant][fit] = score(a, dataset, variant, fit, os.path.join(a.out, f"{variant}-{fit}"))
            write_json(results_path, results)
        print(row(variant, results[variant]), flush=True)
    head = ["| input | SSIM girths | fitted | IoU girths | fitted | rejected | warnings |", "|---|---|---|---|---|---|---|"]
    with open(os.path.join(a.out, "robustness.md"), "w", encoding="utf-8") as file:
        file.write("\n".join(head + [row(v, results[v]) for v in results]) + "\n")


if __name__ == "__main__":
    main()
