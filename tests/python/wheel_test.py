"""`pip install .` in virtual environments of Debian's Python, without a network; and what it says where something is missing."""
import os
import pathlib
import shutil
import subprocess
import sys
import sysconfig

import conftest
import pytest

ROOT = conftest.ROOT
BUILD = pathlib.Path(os.environ.get("MVSTUDIO_PYTHON", ROOT / "build/release/python")).parent


def run(*words, folder, **variables):
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "PIP_"))}
    environment |= {"PIP_NO_INDEX": "1", "PIP_DISABLE_PIP_VERSION_CHECK": "1", "PYTHONDONTWRITEBYTECODE": "1", "MVSTUDIO_BUILD": str(BUILD),
                    **variables}
    done = subprocess.run([*map(str, words)], cwd=folder, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          check=False)
    return done.returncode, done.stdout


def environment_of(folder, *flags):
    """The Python of a new virtual environment."""
    pytest.importorskip("ensurepip", reason="needs python3-venv")
    code, said = run(sys.executable, "-m", "venv", *flags, folder, folder=ROOT)
    assert code == 0, said
    return folder / "bin/python"


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """A virtual environment that sees Debian's packages, with mvstudio; an empty folder."""
    folder = tmp_path_factory.mktemp("wheel")
    (folder / "empty").mkdir()
    python = environment_of(folder / "venv", "--system-site-packages")
    code, said = run(python, "-m", "pip", "install", ROOT, folder=folder)
    assert code == 0 and "Successfully installed mvstudio" in said, said
    return python, folder / "empty"


def test_it_works_from_an_empty_folder(installed):
    python, empty = installed
    code, said = run(python, "-c", "import mvstudio, numpy as np\n"
                     f"rig = mvstudio.Rig.from_json({conftest.rig_text()!r})\n"
                     "px = np.stack([rig.project([[0.1, 0.2, 0.3]], name) for name in rig.names])\n"
                     "print(mvstudio.__file__, np.abs(mvstudio.triangulate(px, rig).x - [0.1, 0.2, 0.3]).max() < 1e-9)", folder=empty)
    assert code == 0 and said.split() == [str(python.parent.parent / "lib/python3.11/site-packages/mvstudio/__init__.py"), "True"], said


def test_it_has_types_and_its_files_are_known_to_pip(installed):
    python, empty = installed
    code, said = run(python, "-m", "pip", "show", "--files", "mvstudio", folder=empty)
    assert code == 0 and "Requires: numpy" in said, said
    packaged = {path.name for path in (BUILD / "python/mvstudio").iterdir() if path.is_file()}
    assert packaged <= {pathlib.PurePath(line.strip()).name for line in said.splitlines()}
    assert {"py.typed", "stages.pyi", "_core" + sysconfig.get_config_var("EXT_SUFFIX")} <= packaged


def test_a_command_without_the_program_is_an_error(installed):
    python, empty = installed
    code, said = run(python, "-c", "import mvstudio; mvstudio.command('version')", folder=empty, MVSTUDIO_BIN="", PATH="/nowhere")
    assert code == 1 and "there is no program `mvstudio` in PATH" in said.splitlines()[-1]


def test_without_a_build_it_says_how_to_build(installed):
    python, empty = installed
    code, said = run(python, "-m", "pip", "install", ROOT, folder=empty, MVSTUDIO_BUILD=str(empty))
    assert code == 1 and "holds no built module; build it first: cmake --preset release" in said


def test_a_build_for_another_python_is_refused(installed, tmp_path):
    python, empty = installed
    (tmp_path / "python/mvstudio").mkdir(parents=True)
    (tmp_path / "python/mvstudio/_core.cpython-399-x86_64-linux-gnu.so").write_bytes(b"")
    code, said = run(python, "-m", "pip", "install", ROOT, folder=empty, MVSTUDIO_BUILD=str(tmp_path))
    assert code == 1 and "is for another Python than this one" in said


def test_what_is_missing_is_named(installed, tmp_path):
    _, empty = installed
    bare = environment_of(tmp_path / "bare")
    code, said = run(bare, "-m", "pip", "install", "--no-deps", ROOT, folder=empty)
    assert code == 0, said
    code, said = run(bare, "-c", "import mvstudio; mvstudio.Rig", folder=empty)
    assert code == 1 and "No module named 'numpy' (apt install python3-numpy" in said.splitlines()[-1]
    copied = tmp_path / "copy/mvstudio"
    shutil.copytree(BUILD / "python/mvstudio", copied, ignore=shutil.ignore_patterns("*.so"))
    code, said = run(sys.executable, "-c", "import mvstudio; mvstudio.Rig", folder=copied.parent)
    assert code == 1 and "(it is built for Debian's Python: /usr/bin/python3)" in said.splitlines()[-1]
    (copied / ("_core" + sysconfig.get_config_var("EXT_SUFFIX"))).write_bytes((BUILD / "python/mvstudio" / (
        "_core" + sysconfig.get_config_var("EXT_SUFFIX"))).read_bytes().replace(b"libopencv_core.so", b"libopencv_lost.so"))
    code, said = run(sys.executable, "-c", "import mvstudio; mvstudio.Rig", folder=copied.parent)
    last = said.splitlines()[-1]
    assert code == 1 and "libopencv_lost.so" in last and "apt install ./python3-mvstudio_*.deb" in last


def test_outside_an_environment_debian_refuses():
    marker = pathlib.Path(sysconfig.get_path("stdlib")) / "EXTERNALLY-MANAGED"
    assert marker.is_file(), "docs/python.md says that Debian's pip refuses"
    code, said = run(sys.executable, "-m", "pip", "install", "--dry-run", ROOT, folder=ROOT)
    assert code == 1 and "externally-managed-environment" in said
