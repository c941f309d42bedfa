"""ActorsHQ: calibration.csv, aabbs.csv."""

import glob
import os

import numpy as np

from exports.common import Camera, check, need_file, rodrigues


def read_actorshq(folder, compare):
    root, = [os.path.dirname(p) for p in glob.glob(folder + "/*/calibration.csv")]
    rows = [line.strip().split(",") for line in open(root + "/calibration.csv")]
    check(rows[0] == "name,w,h,rx,ry,rz,tx,ty,tz,fx,fy,px,py".split(","), "columns")
    boxes = []
    if compare.manifest["frames"]:
        boxes = [line.strip().split(",") for line in open(folder + "/aabbs.csv")][1:]
    for row in rows[1:]:
        w, h = int(row[1]), int(row[2])
        v = np.array([float(x) for x in row[3:]])
        R = rodrigues(v[:3]).T  # the file's is camera to world
        # Its sampler puts pixel i at i + 0.5.
        K = [[v[6] * w, 0, v[8] * w - 0.5], [0, v[7] * h, v[9] * h - 0.5], [0, 0, 1]]
        compare.camera(row[0], Camera(K, np.zeros(5), R, -R @ v[3:6], (w, h)), compare.manifest["frames"])
        for f in compare.manifest["frames"]:
            if compare.manifest["pictures"]:
                need_file("%s/rgbs/%s/%s_rgb%06d.jpg" % (root, row[0], row[0], f))
            if compare.manifest["masks"]:
                need_file("%s/masks/%s/%s_mask%06d.png" % (root, row[0], row[0], f))
    for box in boxes:
        low, high = np.array(box[1:4], float), np.array(box[4:7], float)
        for X, _ in compare.dataset.frames[int(box[0])].values():
            X = X[~np.isnan(X[:, 0])]
            check(np.all((X > low) & (X < high)), "frame %s: joints outside the box" % box[0])
    return {"boxes": len(boxes)}
