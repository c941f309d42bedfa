"""SSIM and PSNR of scikit-image, an oracle for `mvstudio metrics`.

ssim_skimage.py MVSTUDIO FOLDER [--time]: makes 20 pairs of pictures in FOLDER/a and FOLDER/b, scores them with `MVSTUDIO metrics`
and with scikit-image, prints the largest differences and ends with 1 when one is above 1e-9. Ends with 77 without scikit-image.
"""
import json
import os
import subprocess
import sys

import numpy as np

try:
    from PIL import Image
    from scipy.ndimage import gaussian_filter
    from skimage.metrics import peak_signal_noise_ratio, structural_similarity
except ImportError as error:
    print("needs scikit-image and Pillow:", error)
    sys.exit(77)


def pair(rng, index):
    """A picture and a worse one: textures from smooth to noise, several kinds of damage, the last two flat and equal."""
    height, width = [(64, 48), (11, 40), (128, 200), (31, 33)][index % 4]
    a = gaussian_filter(rng.random((height, width, 3)), (index % 5, index % 5, 0))
    a = (a - a.min()) / (a.max() - a.min())
    kinds = [
        lambda x: x + 0.05 * rng.standard_normal(x.shape),
        lambda x: gaussian_filter(x, (1.5, 1.5, 0)),
        lambda x: np.roll(x, 2, axis=1),
        lambda x: 1 - x,
        lambda x: 0.6 * x + 0.1,
    ]
    b = kinds[index % len(kinds)](a)
    if index == 18:
        a, b = np.full_like(a, 0.6), np.full_like(a, 0.7)
    if index == 19:
        b = a
    return [np.round(255 * np.clip(x, 0, 1)).astype(np.uint8) for x in (a, b)]


def scores(a, b):
    wang = dict(gaussian_weights=True, sigma=1.5, use_sample_covariance=False)
    grey = [x.astype(float) @ [0.299, 0.587, 0.114] for x in (a, b)]
    with np.errstate(divide="ignore"):
        psnr = peak_signal_noise_ratio(a, b, data_range=255)
    return {
        "ssim": structural_similarity(a, b, data_range=255, channel_axis=2, **wang),
        "ssim_luma": structural_similarity(*grey, data_range=255, **wang),
        "ssim_skimage": structural_similarity(a, b, data_range=255, channel_axis=2),
        "psnr_db": None if np.isinf(psnr) else psnr,
    }


def main():
    program, folder = sys.argv[1:3]
    rng = np.random.default_rng(7)
    truth = {}
    for side in "ab":
        os.makedirs(os.path.join(folder, side), exist_ok=True)
    for index in range(20):
        pictures = pair(rng, index)
        name = f"{index:02d}"
        for side, picture in zip("ab", pictures):
            Image.fromarray(picture).save(os.path.join(folder, side, name + ".png"))
        truth[name] = scores(*pictures)
    run = subprocess.run([program, "metrics", folder + "/a", folder + "/b", "--per-picture", "--json"], capture_output=True, text=True)
    if run.returncode != 0:
        print(run.stdout, run.stderr)
        return 1
    worst = {}
    for row in json.loads(run.stdout)["metrics"]["pictures"]:
        for key, value in truth[row["name"]].items():
            if (value is None) != (row[key] is None):
                print(f"{row['name']} {key}: {row[key]}, scikit-image {value}")
                return 1
            if value is not None:
                worst[key] = max(worst.get(key, 0.0), abs(row[key] - value))
    print("largest differences over 20 pairs:", ", ".join(f"{key} {value:.1e}" for key, value in worst.items()))
    return 0 if len(worst) == 4 and max(worst.values()) <= 1e-9 else 1


if __name__ == "__main__":
    sys.exit(main())
