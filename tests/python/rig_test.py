"""Cameras as arrays, against NumPy, finite differences and themselves."""
import pickle

import conftest
import mvstudio
import numpy as np
import pytest

hypothesis = pytest.importorskip("hypothesis", reason="needs python3-hypothesis")
arrays = pytest.importorskip("hypothesis.extra.numpy", reason="needs python3-hypothesis")
some = hypothesis.strategies


@pytest.mark.parametrize("name", ["cam_01", "cam_02", "cam_03"])
def test_projects_as_the_formula(rig, points, name):
    np.testing.assert_allclose(rig.project(points, name), conftest.numpy_project(rig, points, name), atol=1e-9)


@pytest.mark.parametrize("name", ["cam_01", "cam_02", "cam_03"])
def test_unproject_inverts(rig, points, name):
    px = rig.project(points, name)
    rays = rig.unproject(px, name)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(rig.project(2.5 * rays, name, frame="cam"), px, atol=2e-9)
    in_world = rig.unproject(px, name, frame="world")
    offsets = points - rig.centers[rig.index(name)]
    np.testing.assert_allclose(np.cross(in_world, offsets), 0, atol=1e-9)


@pytest.mark.parametrize("name", ["cam_01", "cam_02", "cam_03"])
def test_jacobians_are_finite_differences(rig, points, name):
    px, by_point, by_params = rig.project(points[:20], name, jacobians=True)
    np.testing.assert_array_equal(px, rig.project(points[:20], name))
    for k in range(3):
        step = np.eye(3)[k] * 1e-6
        slope = (rig.project(points[:20] + step, name) - rig.project(points[:20] - step, name)) / 2e-6
        np.testing.assert_allclose(by_point[:, :, k], slope, rtol=1e-5, atol=1e-3)
    np.testing.assert_allclose(by_params[:, :, 2:4], np.broadcast_to(np.eye(2), (20, 2, 2)), atol=1e-12)  # cx, cy
    assert by_params.shape == (20, 2, len(rig.params(name))) and rig.param_names(name)[:2] == ["fx", "fy"]


def test_shapes_types_and_what_is_not_seen(rig, points):
    assert rig.project(points.reshape(4, 50, 3), 0).shape == (4, 50, 2)
    assert rig.project([0, 0, 1], 0).shape == (2,)
    np.testing.assert_array_equal(rig.project(points[::2], 1), rig.project(points, 1)[::2])
    np.testing.assert_array_equal(rig.project(np.asfortranarray(points), -1), rig.project(points, 3))
    away = rig.b_from_a("world", "cam_01") @ [0, 0, -2, 1]
    px = rig.project(np.array([away[:3], [np.nan, 0, 0], [0, 0, 0]]), "cam_01")
    np.testing.assert_array_equal(np.isnan(px).any(axis=1), [True, True, False])
    assert np.isnan(rig.unproject([[np.nan, 0], [np.inf, 3]], 0)).all()
    assert rig.project(np.empty((0, 3)), 0).shape == (0, 2)


@hypothesis.given(arrays.arrays(float, (7, 3), elements=some.floats(-1e9, 1e9) | some.just(np.nan) | some.just(np.inf)),
                  some.integers(1, 3))
@hypothesis.settings(deadline=None, max_examples=60)
def test_any_numbers_give_numbers_or_nan(points, threads):
    rig = mvstudio.Rig.from_json(conftest.rig_text())
    for camera in range(len(rig)):
        px = rig.project(points, camera, threads=threads)
        assert not np.isinf(px).any() and (np.isnan(px).any(axis=1) == np.isnan(px).all(axis=1)).all()
        rays = rig.unproject(px, camera)
        there = ~np.isnan(rays).any(axis=1)
        assert np.isnan(px[~np.isfinite(points).all(axis=1)]).all() and not (there & np.isnan(px).any(axis=1)).any()


def test_poses_cancel(rig):
    np.testing.assert_allclose(rig.b_from_a("cam_01", "cam_03"),
                               rig.cam_from_world("cam_01") @ np.linalg.inv(rig.cam_from_world("cam_03")), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(rig.centers - [0, 0, 1.2], axis=1), 3, atol=1e-9)


def test_uncertainty_is_the_spread_of_drawn_cameras(rig):
    draw = np.random.default_rng(1)
    name, range_m = "cam_01", 3.0
    px = np.array([[640.0, 360.0], [1200.0, 650.0]])
    points = range_m * rig.unproject(px, name)
    base, by_point, by_params = rig.project(points, name, frame="cam", jacobians=True)
    translation = rig.cam_from_world(name)[:3, 3]
    params = draw.multivariate_normal(np.zeros(len(rig.params(name))), rig.params_covariance(name), 20000)
    poses = draw.multivariate_normal(np.zeros(6), rig.pose_covariance(name), 20000)
    for i in range(2):
        moved = np.cross(poses[:, :3], points[i] - translation) + poses[:, 3:]
        shifts = params @ by_params[i].T + moved @ by_point[i].T
        worst = np.sqrt(np.linalg.eigvalsh(np.cov(shifts.T))[-1])
        assert rig.uncertainty_px(name, px, range_m=range_m)[i] == pytest.approx(worst, rel=0.03)
    assert rig.uncertainty_px(name, range_m=range_m).shape == (24, 32)


def test_without_covariance_is_said():
    rig = mvstudio.Rig.from_json(conftest.rig_text(covariance=False))
    assert rig.covariance is None and rig.params_covariance(0) is None and rig.pose_covariance(0) is None
    with pytest.raises(mvstudio.Error, match="states no covariance of camera 'cam_02'"):
        rig.uncertainty_px("cam_02", range_m=3)


def test_json_pickle_and_files_keep_every_bit(rig, tmp_path):
    rig.write(tmp_path / "calibration.json")
    for other in (mvstudio.Rig.from_json(rig.to_json()), pickle.loads(pickle.dumps(rig)), mvstudio.Rig(tmp_path / "calibration.json")):
        assert other.to_json() == rig.to_json() and other.names == rig.names
    part = rig.subset(["cam_03", 0])
    assert part.names == ["cam_03", "cam_01"] and len(part) == 2
    np.testing.assert_array_equal(part.params_covariance("cam_01"), rig.params_covariance("cam_01"))


def test_undistortion_map_is_the_lens(rig):
    where, K = rig.undistortion_map("cam_01", view="keep", width_px=64, height_px=48)
    ys, xs = np.mgrid[:48, :64]
    rays = np.stack([(xs - K[0, 2]) / K[0, 0], (ys - K[1, 2]) / K[1, 1], np.ones((48, 64))], axis=-1)
    np.testing.assert_allclose(where, rig.project(rays, "cam_01", frame="cam"), atol=1e-9)


def test_mistakes_are_one_error(rig, points, tmp_path):
    for mistake, words in [(lambda: rig.project(points[:, :2], 0), r"`points`: expected shape \(\.\.\., 3\), got \(200, 2\)"),
                           (lambda: rig.project(points, "cam_9"), "no camera 'cam_9'; it has cam_01, cam_02"),
                           (lambda: rig.project(points, 4), "none of the rig's 4 cameras"),
                           (lambda: rig.project(points, 0, frame="body"), "expected 'world' or 'cam'"),
                           (lambda: rig.uncertainty_px(0, range_m=-1), "`range_m`: expected a distance above 0")]:
        with pytest.raises(mvstudio.Error, match=words) as caught:
            mistake()
        assert isinstance(caught.value, ValueError) and isinstance(caught.value, RuntimeError)
        assert caught.value.code == "CLI-USAGE" and pickle.loads(pickle.dumps(caught.value)).code == "CLI-USAGE"
    with pytest.raises(mvstudio.Error) as caught:
        mvstudio.Rig(tmp_path / "nothing.json")
    assert caught.value.code == "INPUT-IO"


def test_results_outlive_the_rig(points):
    px = mvstudio.Rig.from_json(conftest.rig_text()).project(points, 0)
    assert px.flags.owndata and np.isfinite(px).all()


@pytest.mark.parametrize("name", ["cam_01", "cam_02", "cam_03"])
def test_cameras_as_arrays_are_the_rig(rig, points, name):
    """Of OpenCV's standard lens, its fisheye and a pinhole."""
    given = {n: {"size_px": rig.size_px(n), "K": rig.K(n), "distortion": rig.params(n)[4:], "cam_from_world": rig.cam_from_world(n)}
             for n in rig.names}
    given["cam_02"]["model"] = "kannala4"
    made = mvstudio.Rig.from_cameras(given)
    assert made.names == rig.names and made.model(name) == rig.model(name)
    np.testing.assert_allclose(made.cam_from_world(name), rig.cam_from_world(name), atol=1e-14)
    np.testing.assert_allclose(made.project(points, name), rig.project(points, name), atol=1e-9)


def test_any_rotation_is_kept():
    draw = np.random.default_rng(3)
    turns = [np.linalg.qr(draw.normal(size=(3, 3)))[0] for _ in range(40)]
    turns = [turn * np.sign(np.linalg.det(turn)) for turn in turns] + [np.diag(d) for d in ([1, -1, -1], [-1, 1, -1], [-1, -1, 1])]
    for turn in turns:
        pose = np.eye(4)
        pose[:3, :3] = turn
        rig = mvstudio.Rig.from_cameras({"a": {"size_px": (640, 480), "K": np.diag([500, 500, 1]), "cam_from_world": pose}})
        np.testing.assert_allclose(rig.cam_from_world("a"), pose, atol=1e-14)


@pytest.mark.parametrize("wrong, said", [
    ({"K": np.eye(4)}, r"`K` has shape \(4, 4\), expected \(3, 3\)"), ({"K": [[900, 2, 0], [0, 900, 0], [0, 0, 1]]}, "without skew"),
    ({"distortion": [0.1, 0.2, 0.3]}, "3 terms of `distortion` are no lens of OpenCV"),
    ({"distortion": [0.1], "model": "kannala4"}, "1 terms of `distortion` are no lens kannala4"),
    ({"cam_from_world": np.diag([1, 1, -1, 1])}, "does not begin with a rotation"), ({"dist": 3}, "there is no 'dist'"),
    ({"size_px": (0, 480)}, "size 0 px is out of range")])
def test_cameras_that_are_none(wrong, said):
    with pytest.raises(mvstudio.Error, match=said):
        mvstudio.Rig.from_cameras({"a": {"size_px": (640, 480), "K": np.diag([500, 500, 1]), **wrong}})
