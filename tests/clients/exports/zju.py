"""annots.npy of ZJU-MoCap and Neural Body."""

import os

import numpy as np

from exports.common import Camera, check, need_file


def read_zju(folder, compare):
    annots = np.load(folder + "/annots.npy", allow_pickle=True).item()
    cams, frames = annots["cams"], compare.manifest["frames"]
    check(len(annots["ims"]) == len(frames), "frames")
    for i, entry in enumerate(compare.manifest["cameras"]):
        camera = Camera(cams["K"][i], cams["D"][i], cams["R"][i], np.array(cams["T"][i]).reshape(3, 1) / 1000)
        compare.camera(entry["name"], camera, frames)
        for f, ims in zip(frames, annots["ims"]):
            path = np.array(ims["ims"])[[i]][0]
            check(int(os.path.basename(path)[:-4]) == f, "frame number of " + path)
            if compare.manifest["pictures"]:
                need_file(folder + "/" + path)
            if compare.manifest["masks"]:
                for masks in ("mask", "mask_cihp"):  # HumanNeRF opens both, Neural Body the second
                    need_file(folder + "/" + masks + "/" + path[:-4] + ".png")
    check(all(np.array(cams["D"][i]).shape == (5, 1) and np.array(cams["T"][i]).shape == (3, 1) for i in range(len(cams["K"]))),
          "shapes of D and T")
    return {}
