"""Points against truth, least squares by NumPy, and their own statistics."""
import conftest
import mvstudio
import numpy as np
import pytest

hypothesis = pytest.importorskip("hypothesis", reason="needs python3-hypothesis")
some = hypothesis.strategies


def seen(rig, points, sigma_px=0.0, seed=0):
    px = np.stack([rig.project(points, name) for name in rig.names])
    return px + np.random.default_rng(seed).normal(size=px.shape) * sigma_px


def test_exact_pixels_give_the_points(rig, points):
    x, covariance, status = found = mvstudio.triangulate(seen(rig, points), rig)
    assert found.ok.all() and (status == mvstudio.Status.Ok).all() and found.used.all()
    np.testing.assert_allclose(x, points, atol=1e-9)
    assert covariance.shape == (200, 3, 3) and (np.linalg.eigvalsh(covariance) > 0).all() and (found.rms_px < 1e-6).all()


def test_covariance_is_that_of_least_squares(rig, points):
    found = mvstudio.triangulate(seen(rig, points), rig, sigma_px=0.7, calibration_covariance=False, method="all-views")
    for i in range(5):
        rows = np.vstack([rig.project(points[i], name, jacobians=True)[1] for name in rig.names])
        np.testing.assert_allclose(found.covariance[i], 0.49 * np.linalg.inv(rows.T @ rows), rtol=1e-5)


def test_errors_are_inside_the_covariance(rig):
    points = np.random.default_rng(2).uniform(-0.6, 0.6, (4000, 3))
    found = mvstudio.triangulate(seen(rig, points, 0.5, 3), rig, sigma_px=0.5, calibration_covariance=False)
    error = (found.x - points)[found.ok]
    squared = np.einsum("ni,nij,nj->n", error, np.linalg.inv(found.covariance[found.ok]), error)
    assert found.ok.mean() > 0.99 and squared.mean() == pytest.approx(3, rel=0.05)


def test_the_calibration_adds_its_own(rig, points):
    px = seen(rig, points)
    without = mvstudio.triangulate(px, rig, calibration_covariance=False).covariance
    more = mvstudio.triangulate(px, rig).covariance - without
    assert (np.linalg.eigvalsh(more) > -1e-15).all() and (np.trace(more, axis1=1, axis2=2) > 0).all()


def test_an_outlier_is_left_out(rig, points):
    px = seen(rig, points, 0.3)
    px[1, :50] += [60, -40]
    found = mvstudio.triangulate(px, rig, sigma_px=0.3)
    assert found.ok.all() and not found.used[1, :50].any() and found.used[:, 50:].mean() > 0.99


def test_nan_scores_and_too_few_views(rig, points):
    px = seen(rig, points)
    scores = np.ones(px.shape[:2])
    px[0, 0] = np.nan
    scores[:3, 1] = 0.1
    px[:, 2] = np.nan
    found = mvstudio.triangulate(px, rig, scores=scores)
    assert list(found.used[:, 0]) == [False, True, True, True] and found.ok[0]
    assert found.status[1] == found.status[2] == mvstudio.Status.TooFewViews
    assert np.isnan(found.x[1:3]).all() and np.isnan(found.covariance[1:3]).all()


def test_threads_and_pieces_do_not_matter(rig, points):
    px = seen(rig, points, 0.4)
    one = mvstudio.triangulate(px, rig, threads=1)
    for other in (mvstudio.triangulate(px, rig, threads=3), mvstudio.triangulate(px.tolist(), rig)):
        np.testing.assert_array_equal(one.x, other.x)
        np.testing.assert_array_equal(one.covariance, other.covariance)


@hypothesis.given(some.integers(0, 2**32), some.floats(0, 1), some.integers(0, 12))
@hypothesis.settings(deadline=None, max_examples=40)
def test_any_detections_give_a_point_or_a_reason(seed, share_lost, number):
    rig = mvstudio.Rig.from_json(conftest.rig_text())
    draw = np.random.default_rng(seed)
    px = draw.uniform(-500, 2000, (4, number, 2))
    px[draw.random((4, number)) < share_lost] = np.nan
    found = mvstudio.triangulate(px, rig)
    np.testing.assert_array_equal(found.ok, np.isfinite(found.x).all(axis=1))
    assert all(mvstudio.Status(s) for s in found.status[~found.ok])


def test_mistakes(rig, points):
    px = seen(rig, points)
    for call, words in [(lambda: mvstudio.triangulate(px[:2], rig), r"expected shape \(4, n, 2\)"),
                        (lambda: mvstudio.triangulate(px, rig, scores=np.ones((4, 3))), "`scores`: expected shape"),
                        (lambda: mvstudio.triangulate(px, rig, sigma_px=0), "numbers above 0"),
                        (lambda: mvstudio.triangulate(px, rig, method="best"), "`method` best: expected robust")]:
        with pytest.raises(mvstudio.Error, match=words):
            call()


def test_progress_is_called_and_its_exception_ends_the_work(rig):
    px = seen(rig, np.random.default_rng(5).uniform(-0.6, 0.6, (20000, 3)), 0.4)
    heard = []
    mvstudio.triangulate(px, rig, progress=lambda *state: heard.append(state))
    assert heard and heard[-1][1] == heard[-1][2]

    def stop(*state):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        mvstudio.triangulate(px, rig, progress=stop)
