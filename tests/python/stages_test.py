"""Stages as functions: their names and defaults are the program's, and so are their results, to the bit."""
import filecmp
import inspect
import json
import os
import pathlib
import re
import subprocess
import sys

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
    with pytest.raises(TypeError, match=r"triangulate\(\) got an unexpected keyword argument 'min_view'; did you mean `min_views`"):
        stages.triangulate(min_view=3)
    with pytest.raises(TypeError, match="'zzz'; help"):
        stages.triangulate(zzz=3)
    with pytest.raises(TypeError, match=r"calib_show\(\): missing a required argument: 'inputs'; without a name it takes inputs"):
        stages.calib_show()
    with pytest.raises(mvstudio.Error, match="`min_views`: 'three' is no such value"):
        stages.triangulate(min_views="three")
    with pytest.raises(mvstudio.Error, match="expected poses, timestamps") as caught:
        stages.sync(from_="sound")
    assert "`from_` sound" in str(caught.value) and caught.value.code == "CLI-USAGE"
    with pytest.raises(mvstudio.Error) as caught:
        stages.calib_show(tmp_path / "nothing.toml")
    assert caught.value.code == "INPUT-IO"


@pytest.mark.parametrize("name", sorted(stages.commands()))
def test_places_of_the_command_need_no_name(name):
    text = (ROOT / "docs/cli.md").read_text(encoding="utf-8")
    section = text.split(f"\n### mvstudio {stages.commands()[name]}\n")
    if len(section) == 1:
        assert name == "markers"
        return
    positionals = re.search(r"^    Positionals:\n((?:      .*\n)+)", section[1].split("\n### ")[0], re.M)
    places = len(re.findall(r"^      \w", positionals.group(1), re.M)) if positionals else 0
    parameters = list(inspect.signature(getattr(stages, name)).parameters.values())[:places]
    assert all(parameter.kind is parameter.POSITIONAL_OR_KEYWORD for parameter in parameters)
    assert stages._places(name, inspect.signature(getattr(stages, name)).parameters) == [parameter.name for parameter in parameters]


def test_what_adds_to_what_is_there_needs_no_overwrite(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    program = pathlib.Path(ROOT / "cli/program/run_line.cc").read_text(encoding="utf-8")
    go_on = set(re.findall(r'"([a-z -]+)"', re.search(r"kReplacing\[\] = {(.*?)};", program, re.S).group(1)))
    assert {name for name, command in stages.commands().items() if command in go_on} == set(stages._GO_ON)
    trusting = "import sys; sys.path.insert(0, sys.argv[1]); from mvstudio import stages\n" \
               "stages.session_init(sys.argv[2], 'mm', cameras='2'); stages.session_trust(sys.argv[2])"
    for day in ("day1", "day2"):  # in processes of their own: what a process wrote it may write again
        done = subprocess.run([sys.executable, "-c", trusting, os.path.dirname(os.path.dirname(mvstudio.__file__)), str(tmp_path / day)],
                              capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    assert (tmp_path / "state/mvstudio/trusted").exists()


def test_a_text_may_be_a_list(tmp_path):
    """A list, a range or an array for what the program takes with commas."""
    find = stages._value  # as every stage does with its arguments
    assert find("text", ["trc", "c3d"]) == "trc,c3d" and find("text", range(3)) == "0,1,2" and find("text", np.arange(2)) == "0,1"
    assert find("text", "a,b") == "a,b" and find("list", ["a"]) == ["a"] and find("text", tmp_path) == tmp_path and find("text", None) is None


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
    kept, theirs = (json.loads((folder / name / "calibrate.result.json").read_text(encoding="utf-8")) for name in ("python", "program"))
    assert kept.keys() == theirs.keys() and kept["timing"]["wall_s"] > 0
    same = {key: value for key, value in kept.items() if key not in ("timing", "argv", "outputs")}
    assert differences(same, {key: theirs[key] for key in same}) == []
    assert [o["role"] for o in kept["outputs"]] == [o["role"] for o in theirs["outputs"]]
    assert kept["argv"] == ["mvstudio", "calibrate", "--corners", str(folder / "corners.csv"), "--out", str(folder / "python")]
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


def test_the_programs_report_shows_what_python_did(calibrated):
    _, folder, found = calibrated
    mvstudio.command("report", folder / "python")
    page = json.loads((folder / "python/report.json").read_text(encoding="utf-8"))
    assert "calibrate" in json.dumps(page) and f"{found.report.metrics.rms_px:.3f}"[:5] in (folder / "python/report.html").read_text(encoding="utf-8")
    argv = stages._argv(next(s for s in stages._LIST if s["name"] == "calib_convert"), {"inputs": ["a.yml", "b.yml"], "to": "ros", "out": folder,
                        "invert": True}, ["inputs"], {"overwrite": True, "threads": 2, "seed": 1})
    assert argv[:5] == ["mvstudio", "calib", "convert", "a.yml", "b.yml"] and argv[-3:] == ["--overwrite", "--threads", "2"]
    assert {"--to", "ros", "--invert"} <= set(argv)


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
    assert refused.returncode == 1 and "\nmvstudio.Error: " in refused.stderr and "`overwrite`" in refused.stderr
    assert subprocess.run([*fresh, "1"], check=False).returncode == 0


def test_report(calibrated):
    report = calibrated[2].report
    assert report.metrics.rms_px == report.metrics["rms_px"] and report.path("calibration").endswith("calibration.json")
    assert str(report) == report.text.rstrip("\n") and "calibrate" in repr(report) and "<pre>" in report._repr_html_()
    with pytest.raises(AttributeError, match="there is no 'rms_mm'"):
        report.metrics.rms_mm
    with pytest.raises(KeyError):
        report.path("video")
