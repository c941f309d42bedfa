"""The types: the stubs are what the module has, and code that is typed strictly passes mypy."""
import os
import pathlib
import re
import subprocess
import sys

import conftest  # noqa: F401  (where mvstudio is)
import mvstudio
import pytest
from mvstudio import _core

ROOT = pathlib.Path(os.environ.get("MVSTUDIO_SOURCE", pathlib.Path(__file__).resolve().parents[2]))
PACKAGE = pathlib.Path(mvstudio.__file__).parent
EXAMPLES = '''
import pathlib

import mvstudio
import numpy as np

def length_m(take: mvstudio.Take, a: str, b: str) -> float:
    return float(np.nanmedian(np.linalg.norm(take.joint(a) - take.joint(b), axis=1)))

def sharpest(rig: mvstudio.Rig) -> str:
    return min(rig.names, key=lambda name: float(np.nanmax(rig.uncertainty_px(name, range_m=3.0))))

def calibrated(folder: pathlib.Path) -> mvstudio.Rig:
    found = mvstudio.calibrate(folder / "corners.csv", out=folder / "calib")
    if not found.report.ok:
        print([warning.code for warning in found.report.warnings])
    return found.rig

def triangulated(folder: pathlib.Path) -> list[str]:
    report = mvstudio.stages.triangulate(calib=folder / "calibration.json", pose2d={"left": folder / "left"}, min_views=2,
                                         out=folder / "pose3d", progress=lambda stage, done, total, note: None)
    return [output.path for output in report.outputs]

def shares(pack: mvstudio.Pack) -> dict[str, float]:
    return {sample.camera: float((sample.mask > 0).mean()) for sample in pack if sample.mask is not None}

def one_part(data: mvstudio.Dataset) -> mvstudio.Dataset:
    return data.subset(part="train")

def of_opencv(K: list[list[float]], terms: list[float]) -> mvstudio.Rig:
    return mvstudio.Rig.from_cameras({"left": {"size_px": (640, 480), "K": K, "distortion": terms}})

def heel_strikes(take: mvstudio.Take) -> int:
    return int((take.filtered(filter="butterworth:6Hz").events()["event"] == "heel_strike").sum())

written = mvstudio.stages.markers("pose3d", to=["trc", "c3d"], frames=range(10, 90), out="markers", progress=True).outputs
trained = mvstudio.command("avatar train", "dataset", out="avatar", holdout_cameras=["cam_05"], progress=print).metrics.steps
x, covariance, status = mvstudio.triangulate(np.zeros((2, 5, 2)), mvstudio.Rig("calibration.json"))
ax = mvstudio.plot.uncertainty(mvstudio.Rig("calibration.json"), "cam_01", range_m=2.5)
'''


# What these packages hold is not ours to check, and it takes minutes.
CONFIG = "[mypy]\nignore_missing_imports = True\n" + "".join(f"[mypy-{name}.*]\nfollow_imports = skip\nfollow_imports_for_stubs = True\n"
                                                            for name in ("torch", "pandas", "matplotlib"))


def run(folder, *words):
    environment = os.environ | {"MYPYPATH": str(PACKAGE.parent), "PYTHONPATH": str(PACKAGE.parent), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run([*words], cwd=folder, env=environment, capture_output=True, text=True, check=False)


def need_mypy():
    pytest.importorskip("mypy", reason="needs Debian's mypy")


def mypy(folder, *words):
    need_mypy()
    return run(folder, sys.executable, "-m", "mypy", "--config-file", str(folder / "mypy.ini"), "--cache-dir", str(folder / "cache"), *words)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("types")
    (folder / "mypy.ini").write_text(CONFIG, encoding="utf-8")
    return folder


def test_stubs_are_what_the_module_has(folder):
    need_mypy()
    classes = [name for name in ("Rig", "Samples", "Body", "Gaussians") if isinstance(getattr(_core, name), type)]
    # pybind11's classes have a metaclass of its own, which no stub can name.
    (folder / "allowed").write_text("".join(f"mvstudio._core.{name}\n" for name in classes), encoding="utf-8")
    done = run(folder, sys.executable, "-m", "mypy.stubtest", "mvstudio.stages", "mvstudio._core", "--concise", "--mypy-config-file",
               str(folder / "mypy.ini"), "--allowlist", str(folder / "allowed"))
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_wrong_stub_would_be_seen(folder):
    need_mypy()
    copied = folder / "wrong/mvstudio"
    copied.mkdir(parents=True)
    for path in PACKAGE.iterdir():
        if path.is_file():
            (copied / path.name).symlink_to(path)
    (copied / "stages.pyi").unlink()
    text = (PACKAGE / "stages.pyi").read_text(encoding="utf-8").replace("min_views: int", "least_views: int")
    (copied / "stages.pyi").write_text(text, encoding="utf-8")
    environment = os.environ | {"MYPYPATH": str(copied.parent), "PYTHONPATH": str(copied.parent)}
    done = subprocess.run([sys.executable, "-B", "-m", "mypy.stubtest", "mvstudio.stages", "--mypy-config-file", str(folder / "mypy.ini")],
                          cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 1 and "least_views" in done.stdout


def test_typed_code_passes_mypy_strict(folder):
    readme = re.search(r"^## From Python$(.*?)^## ", (ROOT / "README.md").read_text(encoding="utf-8"), re.M | re.S).group(1)
    code = "\n".join(line[4:] for line in readme.splitlines() if line.startswith("    "))
    (folder / "readme.py").write_text(code + "\n", encoding="utf-8")
    (folder / "examples.py").write_text(EXAMPLES, encoding="utf-8")
    done = mypy(folder, "--strict", "readme.py", "examples.py")
    assert done.returncode == 0, done.stdout + done.stderr
    (folder / "wrong.py").write_text("import mvstudio\nmvstudio.stages.triangulate(min_views='three')\n", encoding="utf-8")
    done = mypy(folder, "--strict", "wrong.py")
    assert done.returncode == 1 and 'has incompatible type "str"; expected "int"' in done.stdout


def test_the_modules_source_passes_mypy(folder):
    done = mypy(folder, "-p", "mvstudio")
    assert done.returncode == 0, done.stdout + done.stderr
