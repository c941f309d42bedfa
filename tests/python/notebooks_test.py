"""Every cell of every notebook runs, in an empty folder."""
import os
import pathlib
import subprocess
import sys

import conftest  # noqa: F401  (where mvstudio is)
import mvstudio
import pytest

ROOT = pathlib.Path(os.environ.get("MVSTUDIO_SOURCE", pathlib.Path(__file__).resolve().parents[2]))
NAMES = sorted(path.stem for path in (ROOT / "python/notebooks").glob("*.ipynb"))


def notebooks(*words, **more):
    environment = os.environ | {"MVSTUDIO_PYTHON": str(pathlib.Path(mvstudio.__file__).parents[1])} | more
    return subprocess.run([sys.executable, "-B", str(ROOT / "scripts/notebooks"), *words], env=environment, capture_output=True, text=True,
                          check=False)


@pytest.mark.parametrize("name", NAMES)
def test_every_cell_runs(name):
    done = notebooks("--check", name)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout == f"{name}: every cell ran\n"


def test_what_is_missing_is_said():
    assert "no python/notebooks/nothing.ipynb" in notebooks("--check", "nothing").stderr
    done = notebooks("--check", "calibrate", MVSTUDIO_BIN="/nowhere/mvstudio")
    assert done.returncode == 1 and "no /nowhere/mvstudio: build it" in done.stderr
