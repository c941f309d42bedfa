#!/usr/bin/env python3
"""Opens exports with the readers' own code, from checkouts of their public repositories, and compares the cameras and masks with the
export's own by export_readers.py.

Usage: foreign_readers.py READERS EXPORTS DATASET

READERS holds a folder per reader, named after its repository: neuralbody, humannerf, EasyVolcap, humanrf, Dynamic3DGaussians,
DNA-Rendering. EXPORTS holds a folder per format. What the readers import for other purposes (training, CUDA) is replaced by empty
modules. Prints a JSON object for each reader: what was opened, the largest difference in pixels and the faults, or why it was
skipped. Needs numpy, OpenCV, h5py, Pillow and torch of Debian. Exits 1 when there is a fault.
"""

import collections
import importlib
import importlib.util
import json
import os
import re
import sys
import tempfile
import types
import warnings

import numpy as np
from PIL import Image

from exports.common import FAULTS, Camera, Comparison, Dataset, check


def empty_module(name, **members):
    """An empty module that gives something harmless for every name."""
    module = types.ModuleType(name)
    module.__getattr__ = lambda key: type(key, (), {})
    module.__path__ = []
    for key, value in members.items():
        setattr(module, key, value)
    sys.modules[name] = module
    parent, _, child = name.rpartition(".")
    if parent in sys.modules:
        setattr(sys.modules[parent], child, module)
    return module


def load(path, name):
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def imread(path):
    return np.array(Image.open(path))


def entries(compare):
    return list(enumerate(compare.manifest["cameras"]))


def check_mask(compare, name, frame, got, what):
    """`got`: true inside the person, in the export's pixels."""
    path, same_pixels = compare.mask(name, frame)
    if same_pixels and os.path.exists(path):
        check(np.array_equal(got, imread(path) > 127), "%s: mask of %s, frame %d" % (what, name, frame))


def neuralbody(checkout, folder, compare):
    cfg = types.SimpleNamespace(training_view=[], begin_ith_frame=0, frame_interval=1, num_train_frame=len(compare.manifest["frames"]),
                                test_novel_pose=False, N_rand=16)
    cfg.training_view = [i for i, _ in entries(compare)]
    for name in ("lib", "lib.utils", "lib.utils.if_nerf", "plyfile", "lib.utils.base_utils"):
        empty_module(name)
    empty_module("imageio", imread=imread)
    empty_module("lib.config", cfg=cfg)
    reader = load(checkout + "/lib/datasets/light_stage/multi_view_dataset.py", "neuralbody_reader")
    data = reader.Dataset(folder, "person", folder + "/annots.npy", "train")
    for index, (path, c) in enumerate(zip(data.ims, data.cam_inds)):
        name, frame = compare.manifest["cameras"][c]["name"], int(os.path.basename(path)[:-4])
        imread(os.path.join(folder, path))
        mask = data.get_mask(index)  # 100 along the outline
        truth, same_pixels = compare.mask(name, frame)
        inside = imread(truth) > 127
        check(not same_pixels or np.array_equal((mask == 1)[mask != 100], inside[mask != 100]), "mask of " + path)
        cams = data.cams
        compare.camera(name, Camera(cams["K"][c], cams["D"][c], cams["R"][c], np.array(cams["T"][c]) / 1000), [frame])
    return len(data.ims)


def humannerf(checkout, folder, compare):
    empty_module("third_parties"), empty_module("third_parties.smpl"), empty_module("third_parties.smpl.smpl_numpy"), empty_module("tqdm"), empty_module("yaml"), empty_module("termcolor")
    empty_module("absl", app=None, flags=types.SimpleNamespace(FLAGS=None, DEFINE_string=lambda *a: None))
    sys.path.insert(0, checkout)
    reader = load(checkout + "/tools/prepare_zju_mocap/prepare_dataset.py", "humannerf_reader")
    annots = np.load(folder + "/annots.npy", allow_pickle=True).item()
    for frame, ims in zip(compare.manifest["frames"], annots["ims"]):
        for i, entry in entries(compare):
            path = np.array(ims["ims"])[i]
            reader.load_image(os.path.join(folder, path))
            check_mask(compare, entry["name"], frame, reader.get_mask(folder, path) > 0, "HumanNeRF")
    return len(annots["ims"]) * len(entries(compare))


def easyvolcap(checkout, folder, compare):
    """Its camera file's reader; its search for images and masks, which needs a whole installation, runs as lines of its source."""
    empty_module("pkg_resources"), empty_module("easyvolcap"), empty_module("easyvolcap.utils"), empty_module("easyvolcap.utils.data_utils")
    empty_module("easyvolcap.utils.console_utils", __all__=["dotdict", "join", "exists", "dirname"], join=os.path.join,
         exists=os.path.exists, dirname=os.path.dirname,
         dotdict=type("dotdict", (dict,), {"__getattr__": dict.__getitem__, "__setattr__": dict.__setitem__}))
    reader = load(checkout + "/easyvolcap/utils/easy_utils.py", "easyvolcap_reader")
    cameras = reader.read_camera(folder + "/intri.yml", folder + "/extri.yml")
    source = open(checkout + "/easyvolcap/dataloaders/datasets/volumetric_video_dataset.py").read()
    default = re.search(r"masks_dir: str = '(\w+)'", source).group(1)
    frames, opened = compare.manifest["frames"], 0
    for _, entry in entries(compare):
        c = cameras[entry["name"]]
        compare.camera(entry["name"], Camera(c.K, c.D, c.R, c.T), frames)
        for path in sorted(os.listdir(os.path.join(folder, "images", entry["name"]))):
            mask = os.path.join(folder, default, entry["name"], path.replace(".jpg", ".png"))
            if check(os.path.exists(mask), mask + " is missing"):
                check_mask(compare, entry["name"], int(path[:-4]), imread(mask) > 127, "EasyVolcap")
            opened += 1
    return opened


def humanrf(checkout, folder, compare):
    sys.path.insert(0, checkout)
    volumetric = importlib.import_module("actorshq.dataset.volumetric_dataset")
    scale, = [f for f in os.listdir(folder) if os.path.isdir(folder + "/" + f)]
    import pathlib
    data = volumetric.VolumetricDataset(pathlib.Path(folder) / scale)
    cameras, frames = data.get_available_cameras_and_frames()
    check(len(cameras) == len(compare.manifest["cameras"]) and frames == compare.manifest["frames"], "cameras and frames")
    for i in cameras:
        name = data.cameras[i].name
        to_px = data.cameras[i].projection_matrix_world2pixel()

        def project(X):
            x = np.asarray(X) @ to_px[:3, :3].T + to_px[:3, 3]
            return x[..., :2] / x[..., 2:] - 0.5  # counts from the corner
        k = data.cameras[i].intrinsic_matrix()
        k[:2, 2] -= 0.5
        compare.camera(name, Camera(k, [0] * 5, np.eye(3), np.zeros(3)), frames, project)
        for frame in frames:
            size = (data.cameras[i].height, data.cameras[i].width)
            check(data.get_rgb(i, frame).shape[:2] == size, "size of %s" % name)
            check_mask(compare, name, frame, data.get_mask(i, frame)[..., 0] > 0.5, "HumanRF")
    return len(cameras) * len(frames)


def dynamic3dgs(checkout, folder, compare):
    import torch
    settings = collections.namedtuple("Settings", "image_height image_width tanfovx tanfovy bg scale_modifier viewmatrix projmatrix "
                                                  "sh_degree campos prefiltered")
    empty_module("diff_gaussian_rasterization", GaussianRasterizationSettings=settings), empty_module("open3d"), empty_module("tqdm"), empty_module("external")
    torch.Tensor.cuda = lambda self, *a, **k: self
    make = torch.tensor
    torch.tensor = lambda *a, **k: make(*a, **{key: v for key, v in k.items() if key != "device"})
    sys.path.insert(0, checkout)
    reader = load(checkout + "/train.py", "dynamic3dgs_reader")
    meta, opened = json.load(open(folder + "/train_meta.json")), 0
    here = os.getcwd()
    os.makedirs(tempfile.gettempdir() + "/data", exist_ok=True)
    os.chdir(tempfile.gettempdir())
    os.path.islink("data/seq") or os.symlink(folder, "data/seq")
    for t, frame in enumerate(compare.manifest["frames"]):
        for c, item in enumerate(reader.get_dataset(t, meta, "seq")):
            name = compare.manifest["cameras"][meta["cam_id"][t][c]]["name"]
            full = item["cam"].projmatrix[0].double().numpy()
            w, h = item["cam"].image_width, item["cam"].image_height

            def project(X):
                x = np.concatenate([np.asarray(X), np.ones((len(X), 1))], 1) @ full
                return ((x[:, :2] / x[:, 3:] + 1) * (w, h) - 1) / 2  # its rasteriser's ndc2Pix
            k = np.array(meta["k"][t][c])
            k[:2, 2] -= 0.5
            compare.camera(name, Camera(k, [0] * 5, np.eye(3), np.zeros(3)), [frame], project)
            check(tuple(item["im"].shape[1:]) == (h, w), "size of " + name)
            check(set(np.unique(item["seg"].numpy())) <= {0, 1}, "seg of %s holds more than 0 and 1" % name)
            check_mask(compare, name, frame, item["seg"][0].numpy() > 0.5, "Dynamic 3D Gaussians")
            opened += 1
    os.chdir(here)
    return opened


def dna_rendering(checkout, folder, compare):
    empty_module("tqdm")
    reader = load(checkout + "/scripts/3DGS/SMCReader.py", "smc_reader")
    name, = os.listdir(folder + "/main")
    main = reader.SMCReader(folder + "/main/" + name)
    annots = reader.SMCReader(folder + "/annotations/" + name.replace(".smc", "_annots.smc"))
    check(main.get_Camera_5mp_info()["num_frame"] == len(compare.manifest["frames"]), "num_frame")
    for i, entry in entries(compare):
        c = annots.get_Calibration(i)
        pose = np.linalg.inv(c["RT"])
        compare.camera(entry["name"], Camera(c["K"], c["D"], pose[:3, :3], pose[:3, 3]), compare.manifest["frames"])
        for k, frame in enumerate(compare.manifest["frames"]):
            check(main.get_img("Camera_5mp", i, "color", k).shape[:2] == tuple(entry["size_px"][::-1]), "image size")
            check_mask(compare, entry["name"], frame, annots.get_mask(i, k) > 127, "SMCReader")
    return len(entries(compare)) * len(compare.manifest["frames"])


READERS = {"neuralbody": ("zju", neuralbody), "humannerf": ("zju", humannerf), "EasyVolcap": ("easymocap", easyvolcap),
           "humanrf": ("actorshq", humanrf), "Dynamic3DGaussians": ("dynamic3dgs", dynamic3dgs),
           "DNA-Rendering": ("dna", dna_rendering)}
TOLERANCE_PX = {"Dynamic3DGaussians": 1e-3}  # single precision


def main():
    warnings.simplefilter("ignore")
    readers, exports, root = sys.argv[1:4]
    failed, dataset = False, Dataset(root)
    for name, (form, reader) in READERS.items():
        FAULTS.clear()
        checkout, folder = os.path.join(readers, name), os.path.abspath(os.path.join(exports, form))
        if not os.path.isdir(checkout):
            print(json.dumps({"reader": name, "skipped": "no checkout in " + readers}))
            continue
        compare = Comparison(dataset, json.load(open(folder + "/export.json")))
        opened = 0
        try:
            opened = reader(os.path.abspath(checkout), folder, compare)
        except Exception as error:  # the readers' own
            check(False, "%s: %s" % (type(error).__name__, error))
        check(compare.max_px <= TOLERANCE_PX.get(name, 1e-6), "a camera is off")
        print(json.dumps({"reader": name, "format": form, "opened": opened, "max_px": compare.max_px, "pixels": compare.pixels,
                          "faults": FAULTS[:5]}), flush=True)
        failed = failed or bool(FAULTS)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
