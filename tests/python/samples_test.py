"""Packs and datasets from Python: the bytes of the program's own files, read by h5py and PIL after docs/packs.md."""
import io
import json
import os
import pickle
import subprocess
import sys
import zlib

import h5py
import mvstudio
import numpy as np
import PIL.Image
import pytest
from mvstudio import stages

CROP = 48


@pytest.fixture(scope="module")
def made(dataset, tmp_path_factory):
    """A split, a pack of crops, one of the split's parts, and one of whole images."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "data").symlink_to(dataset)
    stages.dataset_split(dataset, holdout_cameras="00_03", holdout_frames="4-5", out=folder / "split.json")
    mvstudio.command("dataset pack", dataset, out=folder / "pack", crop=CROP, shard_samples=8)
    mvstudio.command("dataset pack", dataset, out=folder / "parts", crop=CROP, split=folder / "split.json")
    mvstudio.command("dataset pack", dataset, out=folder / "whole", full=True, codec="raw")
    return folder


@pytest.fixture
def pack(made):
    return mvstudio.Pack(made / "pack")


def read_by_h5py(folder):
    """Image, mask and tables of each sample, as docs/packs.md says."""
    for shard in sorted(folder.glob("shard-*.h5")):
        with h5py.File(shard) as file:
            samples = {name: column[()] for name, column in file["samples"].items()}
            poses = {name: column[()] for name, column in file["poses"].items()}
            names = [camera["name"] for camera in json.loads(file["rig"][()].tobytes())["cameras"]]
            for i in range(len(samples["frame"])):
                def piece(what, samples=samples, file=file, i=i):
                    offset, length = int(samples[f"{what}_offset"][i]), int(samples[f"{what}_bytes"][i])
                    stored = file["blob"][offset:offset + length].tobytes()
                    assert zlib.crc32(stored) == samples[f"{what}_crc32"][i]
                    return stored
                row = {name: column[i] for name, column in samples.items()}
                yield piece("image"), piece("mask"), names[row["camera"]], row, {k: v[row["pose"]] for k, v in poses.items()}


def test_pack_has_the_files_bytes(made, pack):
    stored = list(read_by_h5py(made / "pack"))
    assert len(stored) == len(pack) == 24 and len(list((made / "pack").glob("shard-*.h5"))) == 3
    for i, (image, mask, camera, row, pose) in enumerate(stored):
        sample = pack[i]
        assert pack.image_bytes(i) == image
        np.testing.assert_array_equal(sample.image, np.asarray(PIL.Image.open(io.BytesIO(image))))
        np.testing.assert_array_equal(sample.mask > 0, np.asarray(PIL.Image.open(io.BytesIO(mask))) > 0)
        assert (sample.camera, sample.frame, sample.person, sample.part) == (camera, row["frame"], row["person"], "")
        np.testing.assert_array_equal(sample.K, row["K"])
        np.testing.assert_allclose(sample.cam_from_world[:3], row["cam_from_world"], atol=1e-12)
        valid, seen = pose["valid"] > 0, row["joint_in_view"] > 0
        np.testing.assert_array_equal(sample.joints_in_world[valid], pose["joints_in_world"][valid])
        assert np.isnan(sample.joints_in_world[~valid]).all() and np.isnan(sample.joints_px[~seen]).all()
        np.testing.assert_array_equal(sample.joints_px[seen], row["joints_px"][seen])


def test_dataset_crops_are_those_of_the_pack(made, pack):
    data = mvstudio.Dataset(made / "data", crop=CROP)
    assert len(data) == len(pack) and data.cameras == pack.cameras and data.rig.to_json() == pack.rig.to_json()
    for ours, packed in zip(data, pack):
        np.testing.assert_array_equal(ours.image, packed.image)
        np.testing.assert_array_equal(ours.mask, packed.mask)
        np.testing.assert_allclose(ours.joints_px, packed.joints_px, atol=1e-9)
        assert (ours.camera, ours.frame, ours.person) == (packed.camera, packed.frame, packed.person)


def test_whole_images_are_the_datasets_files(made):
    whole = mvstudio.Dataset(made / "data", crop=0)
    for sample, packed in zip(whole, mvstudio.Pack(made / "whole")):
        path = made / f"data/hdImgs/{sample.camera}/{sample.camera}_{sample.frame:08d}.png"
        np.testing.assert_array_equal(sample.image, np.asarray(PIL.Image.open(path).convert("RGB")))
        np.testing.assert_array_equal(sample.image, packed.image)
        np.testing.assert_array_equal(sample.mask, packed.mask)
        seen = np.isfinite(sample.joints_px).all(axis=1)
        assert seen.sum() > 5
        np.testing.assert_allclose(whole.rig.project(sample.joints_in_world[seen], sample.camera), sample.joints_px[seen])


def test_a_pack_knows_how_it_was_made(pack):
    assert pack.about["codec"] == "png" and pack.about["plan"]["crop_px"] == CROP and pack.about["plan"]["split"] is None


def test_verify_counts_the_same(made, pack):
    metrics = mvstudio.command("dataset verify", made / "pack").metrics
    assert metrics["images"] == metrics["masks"] == len(pack)


def test_parts_are_those_of_the_split(made):
    split = json.loads((made / "split.json").read_text(encoding="utf-8"))
    for samples in (mvstudio.Pack(made / "parts"), mvstudio.Dataset(made / "data", crop=CROP, split=made / "split.json")):
        for part in ("train", "test"):
            some = samples.subset(part=part)
            assert set(some.frame) == set(split[part]["frames"]) and set(some.part) == {part}
            assert {samples.cameras[i] for i in some.camera_idx} == set(split[part]["cameras"])
            assert len(some) == len(split[part]["frames"]) * len(split[part]["cameras"])
        assert len(samples) == 12 + 2
        with pytest.raises(mvstudio.Error, match="parts: test, train"):
            samples.subset(part="validation")


def test_subsets_and_indices(pack):
    some = pack.subset(cameras=["00_01", 2], frames=range(1, 4))
    assert len(some) == 6 and set(some.camera_idx) == {1, 2} and set(some.frame) == {1, 2, 3} and "6 images" in repr(some)
    np.testing.assert_array_equal(pack.subset([5, 3]).frame, pack.frame[[5, 3]])
    np.testing.assert_array_equal(pack.subset(pack.frame == 2).K, pack.K[pack.frame == 2])
    np.testing.assert_array_equal(pack[-1].image, pack[len(pack) - 1].image)
    assert sum(1 for _ in some) == 6 and list(some.to_frame().columns) == ["camera", "frame", "person", "part", "has_mask"]
    with pytest.raises(IndexError):
        pack[24]
    with pytest.raises(AttributeError, match="no 'joints'"):
        pack.joints


def test_pickles_open_the_files_again(pack):
    some = pickle.loads(pickle.dumps(pack.subset(cameras=["00_02"])))
    assert len(some) == 6
    np.testing.assert_array_equal(some.image(3), pack.subset(cameras=["00_02"]).image(3))


def test_damage_is_said(made, tmp_path):
    damaged = tmp_path / "one.h5"
    with h5py.File(sorted((made / "whole").glob("shard-*.h5"))[0]) as file:
        offset = file["blob"].id.get_chunk_info(0).byte_offset
    data = bytearray(sorted((made / "whole").glob("shard-*.h5"))[0].read_bytes())
    data[offset + 100] ^= 1
    damaged.write_bytes(data)
    pack = mvstudio.Pack(damaged)
    with pytest.raises(mvstudio.Error, match="does not match its checksum") as caught:
        pack.image(0)
    assert caught.value.code == "INPUT-FORMAT"
    assert pack.image(1).shape == (120, 160, 3)


def test_mistakes(made):
    for mistake, words in [(lambda: mvstudio.Pack(made / "data"), "is no pack"),
                           (lambda: mvstudio.Pack(made / "nothing"), "no such file or folder"),
                           (lambda: mvstudio.Dataset(made / "data", crop=3), "`crop` 3: use 8 to 4096"),
                           (lambda: mvstudio.Dataset(made / "data", person=7), "no camera has person 7"),
                           (lambda: mvstudio.Dataset(made / "pack"), "is a pack; this command reads the dataset")]:
        with pytest.raises(mvstudio.Error, match=words):
            mistake()


@pytest.mark.parametrize("workers, how", [(0, None), (2, "fork"), (2, "spawn")])
def test_loader_gives_the_samples(pack, workers, how):
    import torch
    items = pack.torch()
    assert isinstance(items, torch.utils.data.Dataset) and len(items) == len(pack)
    loader = torch.utils.data.DataLoader(items, batch_size=5, num_workers=workers, multiprocessing_context=how)
    at = 0
    for batch in loader:
        for k in range(len(batch["frame"])):
            sample = pack[at]
            np.testing.assert_array_equal(batch["image"][k].numpy(), sample.image.transpose(2, 0, 1))
            np.testing.assert_array_equal(batch["mask"][k].numpy(), sample.mask)
            fx, fy, cx, cy = batch["intrinsics"][k].double().numpy()
            x = batch["joints_in_cam"][k].double().numpy()
            seen = np.isfinite(sample.joints_px).all(axis=1)
            assert batch["joint_valid"][k].numpy()[seen].all() and seen.sum() > 5
            px = np.stack([fx * x[seen, 0] / x[seen, 2] + cx, fy * x[seen, 1] / x[seen, 2] + cy], axis=1)
            np.testing.assert_allclose(px, sample.joints_px[seen], atol=1e-3)
            assert pack.cameras[batch["camera_idx"][k]] == sample.camera and batch["frame"][k] == sample.frame
            at += 1
    assert at == len(pack)


def test_masked_images_are_the_trainers(pack):
    item, sample = pack.torch(masked=True)[4], pack[4]
    np.testing.assert_array_equal(item["mask"].numpy(), sample.mask / np.float32(255))
    expected = sample.image.transpose(2, 0, 1).astype(np.float32) / 255 * (sample.mask > 0)
    np.testing.assert_array_equal(item["image"].numpy(), expected)
    assert pack.torch(transform=lambda it: int(it["frame"]))[4] == sample.frame


def test_torch_is_imported_when_asked_for(made):
    script = ("import sys; sys.path.insert(0, sys.argv[1]); import mvstudio; pack = mvstudio.Pack(sys.argv[2]); pack[0]\n"
              "assert 'torch' not in sys.modules; pack.torch(); assert 'torch' in sys.modules")
    package = os.path.dirname(os.path.dirname(mvstudio.__file__))
    subprocess.run([sys.executable, "-c", script, package, str(made / "pack")], check=True)
