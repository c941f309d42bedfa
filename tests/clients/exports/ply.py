"""rig.ply and skeleton/*.ply."""

import numpy as np

from exports.common import check
from exports.ply_file import read_ply


def read_ply_export(folder, compare):
    rig = read_ply(folder + "/rig.ply")
    points = np.stack([rig["vertex"][k] for k in "xyz"], 1).reshape(-1, 5, 3)
    check(len(rig["edge"]) == 8 * len(points), "edges")
    for entry, frustum in zip(compare.manifest["cameras"], points):
        truth, _ = compare.source(entry["name"])
        compare.max_m = max(compare.max_m, float(np.abs(frustum[0] + truth.R.T @ truth.t).max()))
        w, h = truth.size
        corners = np.array([[-0.5, -0.5], [w - 0.5, -0.5], [w - 0.5, h - 0.5], [-0.5, h - 0.5]])
        compare.max_px = max(compare.max_px, float(np.abs(truth.project(frustum[1:]) - corners).max()))
        compare.pixels += 4
    for frame in compare.manifest["frames"]:
        skeleton = read_ply("%s/skeleton/%08d.ply" % (folder, frame))
        X = np.stack([skeleton["vertex"][k] for k in "xyz"], 1)
        people = compare.dataset.frames[frame]
        truth = np.concatenate([people[p][0] for p in sorted(people)] or [np.zeros((0, 3))])
        truth = truth[~np.isnan(truth[:, 0])]
        if check(X.shape == truth.shape, "frame %d: joints" % frame) and len(X):
            compare.max_m = max(compare.max_m, float(np.abs(X - truth).max()))
            compare.joints += len(X)
    return {}
