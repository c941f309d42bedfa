"""Stages as functions: their names and defaults are the program's, and so are their results, to the bit."""
import filecmp
import inspect
import json
import os
import pathlib
import re
import subprocess

import conftest
import mvstudio
import numpy as np
import pytest
from mvstudio import stages

ROOT = pathlib.Path(os.environ.get("MVSTUDIO_SOURCE", pathlib.Path(__file__).resolve().parents[2]))
PROGRAM = os.environ.get("MVSTUDIO_BIN", str(ROOT / "build/release/bin/mvstudio"))
# Flags of the program alone, and arguments that are no flags there.
PROGRAM_ONLY = {"help", "help-all", "version", "json", "threads", "seed", "overwrite", "progress", "log-level", "quiet", "device",
                "redact"}


def flags_in_docs():
    """Command -> names of its flags, as docs/cli.md lists them."""
    sections = re.split(r"^### mvstudio ", (ROOT / "docs/cli.md").read_text(encoding="utf-8"), flags=re.M)[1:]
    found = {}
    for section in sections:
        command, text = section.split("\n", 1)
        lines = re.findall(r"^      (-[^ ]+(?:, ?-[^ ]+)*)", text, flags=re.M)
        found[command.strip()] = {flag for line in lines for flag in re.findall(r"--([a-z0-9-]+)", line)}
    return found


@pytest.mark.parametrize("name", sorted(set(stages.commands()) - {"markers"}))  # with its subcommands, docs/cli.md leaves it out
def test_options_are_those_of_the_documentation(name):
    documented = flags_in_docs()[stages.commands()[name]] - PROGRAM_ONLY
    options = {flag for option in stages.options(name) for flag in option["flag"].split(",")}
    required = {parameter.name for parameter in inspect.signature(getattr(stages, name)).parameters.values()
                if parameter.default is parameter.empty}
    documented = {flag[3:] if flag.startswith("no-") and flag not in options else flag for flag in documented}
    assert documented - options == set()
    assert len(options - documented) <= 2, "arguments that are no flags are the command's places"
    assert required <= {option["name"] for option in stages.options(name)}


def test_signatures_and_help():
    parameters = inspect.signature(stages.triangulate).parameters
    assert parameters["min_views"].default == 2 and parameters["method"].default == "auto"
    assert parameters["overwrite"].default is False and parameters["pose2d"].kind is inspect.Parameter.KEYWORD_ONLY
    assert "min_score : float\n    0..1; detections with a lower score are left out" in inspect.getdoc(stages.triangulate)
    assert "--" not in inspect.getdoc(stages.calibrate).replace("---", "") and "option '" not in inspect.getdoc(stages.calibrate)


def test_mistakes(tmp_path):
    with pytest.raises(TypeError, match="unexpected keyword"):
        stages.triangulate(min_view=3)
    with pytest.raises(mvstudio.Error, match="`min_views`: 'three' is no such value"):
        stages.triangulate(min_views="three")
    with pytest.raises(mvstudio.Error, match="expected poses, timestamps") as caught:
        stages.sync(from_="sound")
    assert "`from_` sound" in str(caught.value) and caught.value.code == "CLI-USAGE"
    with pytest.raises(mvstudio.Error) as caught:
        stages.calib_show(tmp_path / "nothing.toml")
    assert caught.value.code == "INPUT-IO"


def corners(rig):
    """A board of 8 x 5 corners that is waved about, with the noise of a detector."""
    draw = np.random.default_rng(7)
    found = mvstudio.Corners("chessboard:8x5:80mm", {name: rig.size_px(name) for name in rig.names})
    grid = np.stack(np.meshgrid(np.arange(8), np.arange(5)), axis=-1).reshape(-1, 2) * 0.08
    for frame in range(20):
        angle = 0.9 * frame
        turn, lean = np.array([np.cos(angle), np.sin(angle), 0]), draw.normal(size=3) * 0.3
        z = np.array([0, 0, 1]) + lean
        z /= np.linalg.norm(z)
        x = np.cross(z, turn)
        x /= np.linalg.norm(x)
        board = draw.uniform(-0.5, 0.5, 3) + grid[:, :1] * x + grid[:, 1:] * np.cross(z, x)
        for name in rig.names:
            px = rig.project(board, name) + draw.normal(size=(40, 2)) * 0.15
            width, height = rig.size_px(name)
            inside = ((px > 5) & (px < [width - 6, height - 6])).all(axis=1)
            if inside.all():
                found.add(name, frame, np.arange(40), px)
    return found


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory):
    rig = mvstudio.Rig.from_json(conftest.rig_text(models=("brown5", "pinhole")))
    folder = tmp_path_factory.mktemp("calibrated")
    corners(rig).write(folder / "corners.csv")
    return rig, folder, mvstudio.calibrate(folder / "corners.csv", out=folder / "python")


def run(*words):
    ended = subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True, check=False)
    assert ended.returncode in (0, 4), ended.stdout + ended.stderr
    return json.loads(ended.stdout)


def differences(a, b, path="metrics"):
    """Where two JSON values differ, but for seconds."""
    if isinstance(a, dict) and isinstance(b, dict):
        return [found for key in {**a, **b} for found in differences(a.get(key), b.get(key), f"{path}.{key}")]
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        return [found for i, pair in enumerate(zip(a, b)) for found in differences(*pair, f"{path}[{i}]")]
    return [] if a == b or path.endswith(("wall_s", "solve_s")) else [path]


def test_calibration_is_the_programs_to_the_bit(calibrated):
    truth, folder, found = calibrated
    said = run("calibrate", "--corners", folder / "corners.csv", "--out", folder / "program", "--json")
    assert filecmp.cmp(folder / "python/calibration.json", folder / "program/calibration.json", shallow=False)
    assert differences(found.report.metrics, said["metrics"]) == []
    assert found.rig.params(0)[0] == pytest.approx(truth.params(0)[0], rel=0.01)


def wand(rig, path):
    draw = np.random.default_rng(3)
    with open(path, "w", encoding="utf-8") as file:
        file.write("camera,frame,person,joint,x_px,y_px,score\n")
        for frame in range(50):
            ends = draw.uniform(-0.4, 0.4, 3) + np.array([[0, 0, 0], [0.2, 0, 0.1]])
            for name in rig.names:
                for joint, px in zip(("grip", "top"), rig.project(ends, name) + draw.normal(size=(2, 2)) * 0.3):
                    file.write(f"{name},{frame},0,{joint},{px[0]!r},{px[1]!r},1\n")


def test_joints_are_the_programs_to_the_bit(calibrated):
    truth, folder, found = calibrated
    truth.write(folder / "truth.json")
    wand(truth, folder / "wand.csv")
    report = stages.triangulate(calib=folder / "truth.json", points2d=folder / "wand.csv", out=folder / "take")
    run("triangulate", "--calib", folder / "truth.json", "--points2d", folder / "wand.csv", "--out", folder / "program3d", "--json")
    for name in ("points.csv", "covariance.csv"):
        assert filecmp.cmp(folder / "take" / name, folder / "program3d" / name, shallow=False)
    take = mvstudio.Take(folder / "take")
    assert len(take) == 50 and sorted(take.joints) == ["grip", "top"] and report.exit in (0, 4)
    lengths = np.linalg.norm(take.joint("top") - take.joint("grip"), axis=1)
    assert np.nanmedian(lengths) == pytest.approx(np.hypot(0.2, 0.1), abs=2e-3)
    assert np.isfinite(take.covariance[take.status == "Ok"]).all()
    with pytest.raises(mvstudio.Error, match="no joint 'nose'; it has"):
        take.joint("nose")


def test_results_are_kept_unless_asked(calibrated):
    _, folder, found = calibrated
    rig = mvstudio.Rig(folder / "python/calibration.json")
    assert rig.to_json() == found.rig.to_json()
    stages.calib_convert(folder / "python/calibration.json", folder / "rig.toml", to="toml")
    assert mvstudio.Rig(folder / "rig.toml").names == rig.names
    fresh = [__import__("sys").executable, "-c", "import sys; sys.path.insert(0, sys.argv[1]); from mvstudio import stages\n"
             "stages.calib_convert(*sys.argv[2:4], to='toml', overwrite=sys.argv[4] == '1')",
             os.path.dirname(os.path.dirname(mvstudio.__file__)), str(folder / "python/calibration.json"), str(folder / "rig.toml")]
    refused = subprocess.run([*fresh, "0"], capture_output=True, text=True, check=False)
    assert refused.returncode == 1 and "mvstudio._error.Error" in refused.stderr and "`overwrite`" in refused.stderr
    assert subprocess.run([*fresh, "1"], check=False).returncode == 0


def test_report(calibrated):
    report = calibrated[2].report
    assert report.metrics.rms_px == report.metrics["rms_px"] and report.path("calibration").endswith("calibration.json")
    assert str(report) == report.text and "calibrate" in repr(report) and "<pre>" in report._repr_html_()
    with pytest.raises(AttributeError, match="there is no 'rms_mm'"):
        report.metrics.rms_mm
    with pytest.raises(KeyError):
        report.path("video")
