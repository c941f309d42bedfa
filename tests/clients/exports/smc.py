"""DNA-Rendering's SMC files (needs h5py) and HuMMan's cameras.json."""

import glob
import json

import numpy as np

from exports.common import Camera, check, need_file


def read_dna(folder, compare):
    import h5py
    annotations, = glob.glob(folder + "/annotations/*_annots.smc")
    smc = h5py.File(annotations, "r")
    frames = compare.manifest["frames"]
    if frames:
        main = h5py.File(annotations.replace("annotations", "main").replace("_annots", ""), "r")
        check(main["Camera_5mp"].attrs["num_device"] == len(compare.manifest["cameras"]), "num_device")
        check(main["Camera_5mp"].attrs["num_frame"] == len(frames), "num_frame")
        check(list(smc["mvstudio/frame_numbers"]) == frames, "frame numbers")
    worst = 0.0
    for i, entry in enumerate(compare.manifest["cameras"]):
        p = smc["Camera_Parameter"]["%02d" % i]
        w2c = np.linalg.inv(p["RT"][()])
        check(p["Color_Calibration"].shape == (3, 3), "Color_Calibration")
        camera = Camera(p["K"][()], p["D"][()], w2c[:3, :3], w2c[:3, 3])
        compare.camera(entry["name"], camera, frames)
        for f in range(len(frames)):
            if compare.manifest["pictures"]:
                check(main["Camera_5mp"][str(i)]["color"][str(f)][:2].tobytes() in (b"\xff\xd8", b"\x89P"), "picture")
            if compare.manifest["masks"]:
                check(smc["Mask"][str(i)]["mask"][str(f)][:4].tobytes() == b"\x89PNG", "mask")
        if "Keypoints_3D" in smc:
            k3, k2 = smc["Keypoints_3D"]["keypoints3d"][()], smc["Keypoints_2D"]["%02d" % i][()]
            seen = k2.any(2)
            if seen.any():
                worst = max(worst, float(np.abs(camera.project(k3[seen][:, :3]) - k2[seen][:, :2]).max()))
    if "Keypoints_3D" in smc:
        person = min(p for f in frames for p in compare.dataset.frames[f])
        for t, f in enumerate(frames):
            X = np.where(k3[t, :, :3].any(1)[:, None], k3[t, :, :3], np.nan)
            if person in compare.dataset.frames[f]:
                compare.joint_set(f, person, X)
    return {"keypoints2d_px": worst}


def read_humman(folder, compare):
    cameras = json.load(open(folder + "/cameras.json"))
    check(np.array_equal(cameras["kinect_color_000"]["R"], np.eye(3)) and not any(cameras["kinect_color_000"]["T"]), "the world")
    first = compare.source(compare.manifest["cameras"][0]["name"])[0]
    for i, entry in enumerate(compare.manifest["cameras"]):
        c = cameras["kinect_color_%03d" % i]
        R, T = np.array(c["R"]), np.array(c["T"])
        camera = Camera(c["K"], np.zeros(5), R @ first.R, R @ first.t + T)
        compare.camera(entry["name"], camera, compare.manifest["frames"])
        for f in compare.manifest["frames"]:
            if compare.manifest["pictures"]:
                need_file("%s/kinect_color/kinect_%03d/%06d.png" % (folder, i, f))
            if compare.manifest["masks"]:
                need_file("%s/kinect_mask/kinect_%03d/%06d.png" % (folder, i, f))
    return {}
