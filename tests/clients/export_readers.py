#!/usr/bin/env python3
"""Reads exports as the programs that they are for do, from those programs' public rules alone, and checks them against the dataset.

Usage: export_readers.py FORMAT FOLDER DATASET [FORMAT FOLDER DATASET ...]

The dataset (CMU Panoptic layout) is read by the rules of its toolbox. Every joint is projected by the dataset's own cameras and by
the exported ones; where a camera was undistorted, the exported pixel is carried back through the lens first. A
folder without export.json holds cameras alone. Prints a JSON object for each export with the largest difference, the counts and
the faults; exits 1 when there is one. Needs numpy, and h5py for `dna`.
"""

import json
import os
import sys

from exports.colmap import read_colmap
from exports.nerfstudio import read_nerfstudio
from exports.zju import read_zju
from exports.easymocap import read_easymocap
from exports.actorshq import read_actorshq
from exports.dynamic3dgs import read_dynamic3dgs
from exports.smc import read_dna, read_humman
from exports.joint_files import read_trc, read_csv, read_npz
from exports.c3d import read_c3d
from exports.bvh import read_bvh
from exports.gltf import read_gltf
from exports.ply import read_ply_export
from exports.blender import read_blender
from exports.ros import read_ros
from exports.mcap import read_mcap
from exports.common import FAULTS, Comparison, Dataset, check, rig_manifest

READERS = {"colmap": read_colmap, "nerfstudio": read_nerfstudio, "zju": read_zju, "easymocap": read_easymocap,
           "actorshq": read_actorshq, "dynamic3dgs": read_dynamic3dgs, "dna": read_dna, "humman": read_humman, "trc": read_trc,
           "c3d": read_c3d, "bvh": read_bvh, "csv": read_csv, "npz": read_npz, "gltf": read_gltf, "ply": read_ply_export,
           "blender": read_blender, "ros": read_ros, "mcap": read_mcap}


def main():
    words, failed, datasets = sys.argv[1:], False, {}
    for form, folder, root in zip(words[::3], words[1::3], words[2::3]):
        FAULTS.clear()
        if root not in datasets:
            datasets[root] = Dataset(root)
        if os.path.exists(folder + "/export.json"):
            manifest = json.load(open(folder + "/export.json"))
            check(manifest["schema"] == "mvstudio.export/1" and manifest["format"] == form, "export.json")
        else:
            manifest = rig_manifest(datasets[root])
        compare = Comparison(datasets[root], manifest)
        extra = READERS[form](folder, compare)
        print(json.dumps({"format": form, "max_px": compare.max_px, "pixels": compare.pixels, "max_m": compare.max_m,
                          "joints": compare.joints, "faults": FAULTS[:20], **extra}))
        failed = failed or bool(FAULTS)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
