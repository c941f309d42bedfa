"""EasyMocap: intri.yml, extri.yml, annots, keypoints3d."""

import json
import re

import numpy as np

from exports.common import BODY25, Camera, JOINTS, check, need_file, rodrigues


def opencv_yaml(path):
    text = open(path).read()
    check(text.startswith("%YAML:1.0\n---\n"), path + ": header")
    matrices = {}
    form = r"^(\S+): !!opencv-matrix\s+rows: (\d+)\s+cols: (\d+)\s+dt: d\s+data: \[([^\]]*)\]"
    for name, rows, cols, data in re.findall(form, text, re.M):
        matrices[name] = np.array([float(v) for v in data.split(",")]).reshape(int(rows), int(cols))
    names = re.search(r"^names:\n((?:\s+- .*\n)*)", text, re.M)
    return [n.strip().strip('"') for n in re.findall(r"- (.*)", names.group(1))], matrices


def read_easymocap(folder, compare):
    names, intrinsics = opencv_yaml(folder + "/intri.yml")
    names2, extrinsics = opencv_yaml(folder + "/extri.yml")
    check(names == names2 == [c["name"] for c in compare.manifest["cameras"]], "names")
    cameras = {}
    for n in names:
        cameras[n] = Camera(intrinsics["K_" + n], intrinsics["dist_" + n], extrinsics["Rot_" + n], extrinsics["T_" + n])
        check(np.abs(rodrigues(extrinsics["R_" + n].ravel()) - cameras[n].R).max() < 1e-12, n + ": R and Rot differ")
        compare.camera(n, cameras[n], compare.manifest["frames"])
    worst = 0.0
    for f in compare.manifest["frames"]:
        people = json.load(open("%s/keypoints3d/%06d.json" % (folder, f)))
        joints = {}
        for person in people:
            k = np.array(person["keypoints3d"])
            joints[person["id"]] = k
            X = np.full((19, 3), np.nan)
            for j, name in enumerate(BODY25):
                if name in JOINTS and k[j].any():
                    X[JOINTS.index(name)] = k[j, :3]
            compare.joint_set(f, person["id"], X)
        check(set(joints) == set(compare.dataset.frames[f]), "frame %d: people" % f)
        for n in names:
            annots = json.load(open("%s/annots/%s/%06d.json" % (folder, n, f)))
            if compare.manifest["pictures"]:
                need_file(folder + "/" + annots["filename"])
            for a in annots["annots"]:
                k2 = np.array(a["keypoints"])
                seen = k2.any(1)
                if seen.any():
                    px = cameras[n].project(joints[a["personID"]][seen, :3])
                    worst = max(worst, float(np.abs(px - k2[seen, :2]).max()))
    return {"annots_px": worst}
