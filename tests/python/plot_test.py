"""What is drawn, against NumPy: the data of images, arrows, lines and bands."""
import json
import subprocess
import sys

import conftest
import mvstudio
import numpy as np
import pytest
from mvstudio import plot

matplotlib = pytest.importorskip("matplotlib", reason="needs python3-matplotlib")
matplotlib.use("Agg")


@pytest.fixture(autouse=True)
def closed_figures():
    yield
    matplotlib.pyplot.close("all")


@pytest.fixture(scope="module")
def take_folder(tmp_path_factory):
    """Three joints on two bones, 20 frames; the last frame lacks the hand."""
    folder = tmp_path_factory.mktemp("take")
    points, covariances = ["frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m"], ["frame,person,joint,xx,xy,xz,yy,yz,zz"]
    for frame in range(20):
        for k, joint in enumerate(("neck", "elbow", "hand")):
            lost = frame == 19 and joint == "hand"
            points.append(f"{frame},0,{joint}," + ("TooFewViews,,,,1,," if lost else f"Ok,{0.1 * frame},{0.3 * k},{1 + 0.02 * k},4,0.5,0.01"))
            if not lost:
                covariances.append(f"{frame},0,{joint},{(1e-3 * (1 + k)) ** 2},0,0,4e-6,0,9e-6")
    (folder / "points.csv").write_text("\n".join(points) + "\n", encoding="utf-8")
    (folder / "covariance.csv").write_text("\n".join(covariances) + "\n", encoding="utf-8")
    bones = [["neck", "elbow"], {"joints": ["elbow", "hand"], "length_m": [0.1, 0.5]}]
    (folder / "pose3d.json").write_text(json.dumps({"frame_rate_hz": 50, "definition": {"bones": bones}}), encoding="utf-8")
    return folder


def drawn(ax, tmp_path):
    """The axes are those of a figure that can be written, and it is no white sheet."""
    ax.figure.savefig(tmp_path / "figure.png")
    pixels = matplotlib.pyplot.imread(tmp_path / "figure.png")
    assert pixels[..., :3].std() > 0.01
    return ax


@pytest.mark.parametrize("name", ["cam_01", "cam_02"])
def test_uncertainty_is_the_rigs(rig, name, tmp_path):
    ax = drawn(plot.uncertainty(rig, name, range_m=3, levels=4), tmp_path)
    (shown,) = ax.images
    np.testing.assert_array_equal(shown.get_array(), rig.uncertainty_px(name, range_m=3))
    left, right, bottom, top = shown.get_extent()
    assert (right - left) / 32 == pytest.approx(1279 / 31) and (bottom - top) / 24 == pytest.approx(719 / 23)
    assert (left + right) / 2 == pytest.approx(639.5) and ax.get_ylim() == (719.5, -0.5) and ax.get_xlim() == (-0.5, 1279.5)
    assert len(ax.figure.axes) == 2 and ax.figure.axes[1].get_ylabel() == "standard deviation, px"


def test_contours_lie_where_the_map_has_their_value(rig):
    level = float(np.median(rig.uncertainty_px("cam_01", range_m=3)))
    ax = plot.uncertainty(rig, "cam_01", range_m=3, levels=[level])
    points = np.concatenate([path.vertices for collection in ax.collections for path in collection.get_paths()])
    assert len(points) > 20
    np.testing.assert_allclose(rig.uncertainty_px("cam_01", points, range_m=3), level, rtol=0.02)


def test_a_run_folder_is_as_good_as_the_rig(rig, tmp_path):
    rig.write(tmp_path / "calibration.json")
    for given in (tmp_path, tmp_path / "calibration.json"):
        (shown,) = plot.uncertainty(given, 0, range_m=2).images
        np.testing.assert_array_equal(shown.get_array(), rig.uncertainty_px(0, range_m=2))


def test_residuals_are_arrows(tmp_path):
    rows = np.random.default_rng(1).normal([600, 300, 0.1, 0], [200, 100, 0.2, 0.2], (300, 4))
    path = tmp_path / "calibrate.result.json"
    path.write_text(json.dumps({"metrics": {"residuals": {"left": rows.tolist()}}}), encoding="utf-8")
    ax = drawn(plot.residuals(tmp_path, "left", magnify=50), tmp_path)
    (arrows,) = ax.collections
    np.testing.assert_allclose(arrows.get_offsets(), rows[:, :2])
    np.testing.assert_allclose(np.stack([arrows.U, arrows.V], axis=1), rows[:, 2:])
    assert arrows.scale == pytest.approx(1 / 50) and arrows.angles == arrows.scale_units == "xy"
    assert f"rms {np.sqrt((rows[:, 2:] ** 2).sum(axis=1).mean()):.3g} px" in ax.get_title()
    lengths = np.sort(np.hypot(rows[:, 2], rows[:, 3]))
    plot.residuals(path, 0, ax=matplotlib.pyplot.figure().add_subplot())
    longest = lengths[-15] / matplotlib.pyplot.gca().collections[0].scale
    assert longest == pytest.approx(0.05 * (rows[:, 0].max() + 1), rel=0.1)


def test_coverage_is_a_histogram(tmp_path):
    draw = np.random.default_rng(2)
    corners = mvstudio.Corners("chessboard:8x5:40mm", {"left": (640, 480), "right": (640, 480)})
    px = draw.uniform([-0.5, -0.5], [639.4, 479.4], (9, 40, 2))
    for frame in range(9):
        corners.add("left", frame, np.arange(40), px[frame])
    ax = drawn(plot.coverage(corners, "left"), tmp_path)
    counts, _, _ = np.histogram2d(*px.reshape(-1, 2)[:, ::-1].T, bins=[np.linspace(-0.5, 479.5, 9), np.linspace(-0.5, 639.5, 11)])
    np.testing.assert_array_equal(ax.images[0].get_array(), counts)
    assert [int(text.get_text()) for text in ax.texts] == counts.ravel().tolist()
    assert plot.coverage(corners, "right").images[0].get_array().sum() == 0


def test_rig_in_space(rig, tmp_path):
    ax = drawn(plot.rig(rig, size_m=0.5), tmp_path)
    assert len(ax.lines) == len(rig) and [text.get_text().strip() for text in ax.texts] == rig.names
    for i, line in enumerate(ax.lines):
        path = np.array(line.get_data_3d()).T
        np.testing.assert_allclose(path[::3], np.repeat(rig.centers[i][None], 4, axis=0))
        np.testing.assert_allclose(np.linalg.norm(path[1::3] - rig.centers[i], axis=1), 0.5)
        np.testing.assert_allclose(rig.project(path[1::3], i), [[0, 0], [1279, 0], [1279, 719], [0, 719]], atol=1e-6)
    limits = [np.ptp(limit) for limit in (ax.get_xlim(), ax.get_ylim(), ax.get_zlim())]
    np.testing.assert_allclose(limits, limits[0])


def test_take_has_its_bones(take_folder, tmp_path):
    take = mvstudio.Take(take_folder)
    assert take.bones == [("neck", "elbow"), ("elbow", "hand")]
    ax = drawn(plot.take(take, 7), tmp_path)
    (bones,), (joints,) = ax.lines, ax.collections
    x = take.x[7, 0]
    np.testing.assert_allclose(np.array(bones.get_data_3d()).T, np.array([x[0], x[1], [np.nan] * 3, x[1], x[2], [np.nan] * 3]))
    np.testing.assert_allclose(np.array(joints._offsets3d).T, x)
    assert plot.take(take_folder).get_title() == "frame 0" and plot.take(take, 19).lines  # the frame that lacks a joint


def test_joint_over_time_with_sigma(take_folder, tmp_path):
    take = mvstudio.Take(take_folder)
    ax = drawn(plot.joint(take, "hand", axes="xz", sigmas=2), tmp_path)
    for line, band, k, sigma in zip(ax.lines, ax.collections, (0, 2), (3e-3, 3e-3)):
        time, value = line.get_data()
        np.testing.assert_allclose(time, take.frames / 50)
        np.testing.assert_allclose(value, take.joint("hand")[:, k])
        corners = band.get_paths()[0].vertices
        inside = corners[np.isin(corners[:, 0], time[:19])]
        offset = np.abs(inside[:, 1] - np.interp(inside[:, 0], time[:19], value[:19]))
        np.testing.assert_allclose(offset, 2 * sigma, atol=1e-12)
    assert ax.get_xlabel() == "time, s" and len(plot.joint(take, "neck", sigmas=0).collections) == 0


def test_training_curves(tmp_path):
    rows = [(0, "init", 2.0, ""), (10, "init", 1.5, ""), (20, "train", 1.0, ""), (20, "validation", "", 0.7), (30, "train", 0.5, "")]
    text = "step,phase,total,ssim,wall_s\n" + "".join(f"{s},{p},{t},{v},1\n" for s, p, t, v in rows)
    (tmp_path / "history.csv").write_text(text, encoding="utf-8")
    ax = drawn(plot.training(tmp_path, ["total", "ssim"]), tmp_path)
    lines = {line.get_label(): np.array(line.get_data()).T.tolist() for line in ax.lines}
    assert lines == {"total, init": [[0, 2], [10, 1.5]], "total, train": [[20, 1], [30, 0.5]], "ssim, validation": [[20, 0.7]]}
    assert ax.get_yscale() == "linear"
    (tmp_path / "history.csv").write_text(text + "40,train,0.1,,1\n", encoding="utf-8")
    assert plot.training(tmp_path).get_yscale() == "log"
    (tmp_path / "gaussians.csv").write_text("degree,step,total,wall_s\n0,0,,1\n0,5,0.4,2\n", encoding="utf-8")
    (line,) = plot.training(tmp_path / "gaussians.csv").lines
    assert line.get_label() == "total" and np.array(line.get_data()).T.tolist() == [[5, 0.4]]


def test_mistakes(rig, take_folder, tmp_path):
    flat = matplotlib.pyplot.figure().add_subplot()
    for mistake, words in [(lambda: plot.rig(rig, ax=flat), "two dimensions"),
                           (lambda: plot.take(take_folder, 70), "has frames 0 to 19"),
                           (lambda: plot.take(take_folder, persons=[3]), "no person 3; there are"),
                           (lambda: plot.joint(take_folder, "nose"), "no joint 'nose'; it has neck, elbow"),
                           (lambda: plot.joint(take_folder, "neck", axes="xw"), "some of 'xyz'"),
                           (lambda: plot.training(tmp_path), "expected a run of"),
                           (lambda: plot.residuals(tmp_path, "left"), "`calibrate` leaves it in its folder"),
                           (lambda: plot.coverage(mvstudio.Corners("chessboard:8x5:40mm", {"a": (9, 9)}), "b"), "corners of a")]:
        with pytest.raises(mvstudio.Error, match=words):
            mistake()


def test_without_matplotlib_the_error_says_what_to_install():
    script = ("import sys; sys.path.insert(0, sys.argv[1]); sys.modules['matplotlib'] = None\n"
              "import mvstudio, json; rig = mvstudio.Rig.from_json(sys.argv[2])\n"
              "try:\n    mvstudio.plot.rig(rig)\nexcept mvstudio.Error as error:\n    print(error.code, error.hint)")
    folder = mvstudio.__file__.rsplit("/", 2)[0]
    done = subprocess.run([sys.executable, "-c", script, folder, conftest.rig_text()], capture_output=True, text=True, check=True)
    assert done.stdout == "MISSING-TOOL apt install python3-matplotlib, or pip install matplotlib\n"
