"""Scores between images."""
from __future__ import annotations

from typing import Any

import numpy as np

from mvstudio import _core


def _range(a: Any, b: Any, data_range: Any) -> float:
    if data_range is not None:
        return float(data_range)
    kinds = {np.asarray(a).dtype, np.asarray(b).dtype}
    return float(np.iinfo(kinds.pop()).max) if len(kinds) == 1 and next(iter(kinds)).kind == "u" else 1.0


def ssim(a: Any, b: Any, *, data_range: Any = None, window: str = "gaussian11", threads: int = 1) -> float:
    """Structural similarity, the mean over windows inside the image and over channels.

    Parameters
    ----------
    a, b : array_like, (h, w) or (h, w, channels)
    data_range : float or None
        None: 255 of 8 bits, 65535 of 16, else 1.
    window : str
        ``"gaussian11"``: 11 x 11, sigma 1.5, population covariance; ``"uniform7"``: 7 x 7, sample covariance, as scikit-image.
    threads : int

    Returns
    -------
    float
        At most 1.

    Notes
    -----
    Wang et al., "Image quality assessment: from error visibility to structural similarity", TIP 2004; K1 = 0.01, K2 = 0.03.
    """
    return _core.ssim(a, b, _range(a, b, data_range), window, threads)


def psnr(a: Any, b: Any, *, data_range: Any = None) -> float:
    """Peak signal-to-noise ratio over all channels, dB: -10 log10(mean squared error / range^2).

    Parameters
    ----------
    a, b : array_like, (h, w) or (h, w, channels)
    data_range : float or None
        As for `ssim`.

    Returns
    -------
    float
        Infinity for equal images.
    """
    return _core.psnr_db(a, b, _range(a, b, data_range))
