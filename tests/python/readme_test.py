"""The Python of README.md runs as it is written, and what the modules' help shows does."""
import contextlib
import doctest
import io
import os
import pathlib
import re
import subprocess
import sys

import conftest
import mvstudio
import mvstudio._calibrate
import mvstudio._rig
import pytest

matplotlib = pytest.importorskip("matplotlib", reason="needs python3-matplotlib")
matplotlib.use("Agg")
ROOT = pathlib.Path(os.environ.get("MVSTUDIO_SOURCE", pathlib.Path(__file__).resolve().parents[2]))


def test_readme(rig, tmp_path, monkeypatch):
    section = re.search(r"^## From Python$(.*?)^## ", (ROOT / "README.md").read_text(encoding="utf-8"), re.M | re.S).group(1)
    code = "\n".join(line[4:] for line in section.splitlines() if line.startswith("    "))
    (tmp_path / "run/pose3d").mkdir(parents=True)
    rig.write(tmp_path / "run/calibration.json")
    head = "frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m\n"
    rows = "".join(f"{frame},0,nose,Ok,{frame / 10},0,1.5,4,0.4,0.002\n" for frame in range(5))
    (tmp_path / "run/pose3d/points.csv").write_text(head + rows, encoding="utf-8")
    (tmp_path / "run/pose3d/pose3d.json").write_text('{"frame_rate_hz": 50}', encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    names = {}
    with contextlib.redirect_stdout(io.StringIO()) as said:
        exec(compile(code, "README.md", "exec"), names)
    assert abs(names["x"] - names["points"]).max() < 1e-6 and (names["status"] == mvstudio.Status.Ok).all()
    assert abs(names["speed_m_s"] - 5).max() < 1e-9 and "cam_03" in said.getvalue()
    assert (tmp_path / "uncertainty.png").stat().st_size > 5000


def test_help():
    for module in (mvstudio._calibrate, mvstudio._rig):
        assert doctest.testmod(module, extraglobs={"mvstudio": mvstudio}).failed == 0


def in_a_fresh_process(script):
    package = os.path.dirname(os.path.dirname(mvstudio.__file__))
    done = subprocess.run([sys.executable, "-c", f"import sys; sys.path.insert(0, {package!r}); import mvstudio\n{script}"],
                          capture_output=True, text=True, check=True)
    return done.stdout


def test_import_loads_little():
    loaded = in_a_fresh_process("print(*sys.modules)").split()
    assert "mvstudio" in loaded and "mvstudio._core" not in loaded and "numpy" not in loaded


def test_everything_is_there_and_loads_no_libtorch():
    loaded = in_a_fresh_process("for name in mvstudio.__all__: getattr(mvstudio, name)\n"
                                "from mvstudio import *\nassert {*mvstudio.__all__} <= {*dir(mvstudio)} & {*globals()}\n"
                                "print(mvstudio.__version__, open('/proc/self/maps').read())")
    assert "mvstudio/_core" in loaded and not re.search(r"libtorch|matplotlib|pandas", loaded)
    with pytest.raises(AttributeError, match="no attribute 'rigs'"):
        mvstudio.rigs
