"""What loaders of Gaussian splatting take from COLMAP's layout and from images.

graphdeco-inria/gaussian-splatting: scene/dataset_readers.py takes PINHOLE and SIMPLE_PINHOLE, and keeps the focal lengths
alone; utils/graphics_utils.py projects about the image's centre; scene/cameras.py takes a fourth channel as the mask, and
train.py compares the rendering times that mask with the image as it is. nerfstudio-project/gsplat, examples/datasets/colmap.py:
the principal point of the file, three channels.
"""

import os

import numpy as np

from exports.common import Camera, check
from exports.png_file import read_png


def centred(camera):
    K = camera.K.copy()
    K[:2, 2] = (np.array(camera.size) - 1) / 2
    return Camera(K, camera.dist, camera.R, camera.t, camera.size)


def loader_px(camera, points):
    """Largest distance between the projections by the file's camera and by the loader's, over points in the image."""
    X = np.asarray(points, float).reshape(-1, 3)
    X = X[camera.in_cam(X)[:, 2] > 0] if len(X) else X
    return float(np.abs(camera.project(X) - centred(camera).project(X)).max()) if len(X) else 0.0


def check_alpha(path, mask_path, same_size):
    """An image with its mask as alpha: black outside; the dataset's own mask where nothing was resampled. Its opaque share."""
    if not check(path.endswith(".png") and os.path.isfile(path), path + " is no PNG"):
        return 0.0
    image = read_png(path)
    if not check(image.shape[2] == 4, path + " has no alpha"):
        return 0.0
    alpha = image[:, :, 3]
    check(not image[alpha == 0].any(), path + " is not black outside")
    if not os.path.isfile(mask_path):
        check(alpha.min() == 255, path + " is not opaque without a mask")
    elif same_size:
        check(np.array_equal(alpha, read_png(mask_path)[:, :, 0]), path + ": alpha is not the mask")
    return float((alpha == 255).mean())
