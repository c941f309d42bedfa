#!/usr/bin/env python3
"""Images a second that a PyTorch loader gets from packs, from a folder of JPEG crops, and from a dataset's whole JPEG images.

Usage: /usr/bin/python3 bench/loader_speed.py DATASET [--crop 128] [--workers 0,2] [--seconds 3] [--rounds 3]
DATASET: in Panoptic's layout, with masks. Packs and crops are made in a folder of its own and removed afterwards. One line for each
source and number of workers: median and range over the rounds, which take the sources in turns. The module is that of MVSTUDIO_PYTHON, else
build/release/python; the program that of MVSTUDIO_BIN.
"""
import argparse
import os
import pathlib
import statistics
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, os.environ.get("MVSTUDIO_PYTHON", str(ROOT / "build/release/python")))
os.environ.setdefault("MVSTUDIO_BIN", str(ROOT / "build/release/bin/mvstudio"))
import mvstudio  # noqa: E402
import numpy as np  # noqa: E402
import PIL.Image  # noqa: E402
import torch  # noqa: E402


class JpegFolder(torch.utils.data.Dataset):
    """What people write: crops as JPEG of quality 95, their masks as PNG, read by PIL."""

    def __init__(self, folder, samples):
        self.paths = []
        for i, sample in enumerate(samples):
            self.paths.append((folder / f"{i:06d}.jpg", folder / f"{i:06d}.png"))
            PIL.Image.fromarray(sample.image).save(self.paths[-1][0], quality=95)
            PIL.Image.fromarray(sample.mask).convert("1").save(self.paths[-1][1])

    def __len__(self):
        return len(self.paths)

    def __getitem__(self, i):
        image, mask = (np.array(PIL.Image.open(path)) for path in self.paths[i])
        return {"image": torch.from_numpy(image.transpose(2, 0, 1).copy()), "mask": torch.from_numpy(mask.astype(np.uint8) * 255)}


def images_per_s(items, workers, seconds):
    """Epochs in random order until the time is over; the start of the workers does not count."""
    loader = torch.utils.data.DataLoader(items, batch_size=16, shuffle=True, num_workers=workers, persistent_workers=workers > 0)
    for _ in loader:
        pass
    count, start = 0, time.perf_counter()
    while time.perf_counter() - start < seconds:
        for batch in loader:
            count += len(batch["image"])
    return count / (time.perf_counter() - start)


def sources(dataset, crop, folder):
    for codec in ("raw", "png", "jpeg:95"):
        path = folder / codec.replace(":", "")
        mvstudio.command("dataset pack", dataset, out=path, crop=crop, codec=codec)
        yield f"pack, {codec}", mvstudio.Pack(path).torch()
    (folder / "crops").mkdir()
    yield "folder of JPEG crops, PIL", JpegFolder(folder / "crops", mvstudio.Pack(folder / "raw"))
    yield "dataset's whole images, cropped", mvstudio.Dataset(dataset, crop=crop).torch()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset")
    parser.add_argument("--crop", type=int, default=128)
    parser.add_argument("--workers", default="0,2")
    parser.add_argument("--seconds", type=float, default=3)
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory(prefix="mvstudio-loader-") as name:
        listed = list(sources(pathlib.Path(given.dataset), given.crop, pathlib.Path(name)))
        counts = [int(text) for text in given.workers.split(",")]
        speeds = {(what, workers): [] for what, _ in listed for workers in counts}
        for _ in range(given.rounds):
            for what, items in listed:
                for workers in counts:
                    speeds[what, workers].append(images_per_s(items, workers, given.seconds))
    for (what, workers), values in speeds.items():
        print(f"{what}, {workers} workers: {statistics.median(values):.0f} images/s ({min(values):.0f} to {max(values):.0f})")


if __name__ == "__main__":
    main()
