"""Scores of images against NumPy."""
import mvstudio
import numpy as np
import pytest
from mvstudio import metrics


def gaussian_ssim(a, b, peak):
    """Wang's formula with whole windows, written out."""
    axis = np.exp(-((np.arange(11) - 5) ** 2) / (2 * 1.5**2))
    window = np.outer(axis, axis) / np.outer(axis, axis).sum()
    views = [np.lib.stride_tricks.sliding_window_view(x, (11, 11)) for x in (a, b)]
    mean_a, mean_b = ((v * window).sum((-1, -2)) for v in views)
    var_a, var_b = ((v**2 * window).sum((-1, -2)) - m**2 for v, m in zip(views, (mean_a, mean_b)))
    cov = (views[0] * views[1] * window).sum((-1, -2)) - mean_a * mean_b
    c1, c2 = (0.01 * peak) ** 2, (0.03 * peak) ** 2
    return np.mean((2 * mean_a * mean_b + c1) * (2 * cov + c2) / ((mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2)))


@pytest.fixture(scope="module")
def pair():
    draw = np.random.default_rng(3)
    a = draw.integers(0, 256, (40, 52, 3), dtype=np.uint8)
    return a, np.clip(a + draw.normal(0, 20, a.shape), 0, 255).astype(np.uint8)


def test_ssim_is_wangs(pair):
    a, b = pair
    expected = np.mean([gaussian_ssim(a[..., c].astype(float), b[..., c].astype(float), 255) for c in range(3)])
    assert metrics.ssim(a, b) == pytest.approx(expected, abs=1e-10)
    assert metrics.ssim(a / 255, b / 255) == pytest.approx(expected, abs=1e-10)
    assert metrics.ssim(a, a) == 1 and metrics.ssim(a[..., 0], b[..., 0], window="uniform7") < 1


def test_psnr_is_its_definition(pair):
    a, b = pair
    assert metrics.psnr(a, b) == pytest.approx(10 * np.log10(255**2 / np.mean((a.astype(float) - b) ** 2)), abs=1e-10)
    assert metrics.psnr(a, a) == np.inf
    squares = int(((a.astype(int) - b.astype(int)) ** 2).sum())
    assert metrics.psnr(a, b) == -10 * np.log10(squares / (255 * 255) / a.size), "8 bits: exact sums, as the program's"
    assert metrics.psnr(a[::2, ::3], b[::2, ::3]) == metrics.psnr(a[::2, ::3].copy(), b[::2, ::3].copy())


def test_mistakes(pair):
    a, b = pair
    with pytest.raises(mvstudio.Error, match="cannot be compared: their shapes differ"):
        metrics.ssim(a, b[:-1])
    with pytest.raises(mvstudio.Error, match="outside 0 to the range; `data_range` states it"):
        metrics.ssim(a.astype(float), b.astype(float))
    assert metrics.ssim(a.astype(float), b.astype(float), data_range=255) == metrics.ssim(a, b)
    with pytest.raises(mvstudio.Error, match="smaller than the window"):
        metrics.ssim(a[:9], b[:9])
    with pytest.raises(mvstudio.Error, match="hold NaN or infinity"):
        metrics.ssim(np.where(a > 9, a / 255, np.nan), b / 255)
    with pytest.raises(mvstudio.Error, match=r"`a`: expected shape \(h, w\)"):
        metrics.psnr(a.ravel(), b)
    with pytest.raises(mvstudio.Error, match="cannot be compared"):
        metrics.psnr(a, b[:-1])
    for no_array in (object(), "image.png", {"a": 1}):
        for score in (metrics.psnr, metrics.ssim):
            with pytest.raises(TypeError):
                score(no_array, b)
            with pytest.raises(TypeError):
                score(a, no_array)
    with pytest.raises(mvstudio.Error, match="expected gaussian11 or uniform7"):
        metrics.ssim(a, b, window="box")
