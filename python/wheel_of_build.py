"""Makes the wheel of `pip install .` from what the build made (PEP 517); pyproject.toml of the project names it.

MVSTUDIO_BUILD: the build folder, where it is not build/release. Only the standard library is used, so that pip needs no network.
"""
import base64
import csv
import hashlib
import io
import os
import pathlib
import re
import sysconfig
import tomllib
import zipfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
PRESET = "cmake --preset release && cmake --build --preset release --target mvstudio_python"


def package_folder():
    """The package that the build made for this Python; says what is missing."""
    folder = pathlib.Path(os.environ.get("MVSTUDIO_BUILD", ROOT / "build/release")) / "python/mvstudio"
    suffix = sysconfig.get_config_var("EXT_SUFFIX")
    there = sorted(path.name for path in folder.glob("_core.*.so"))
    if not there:
        raise SystemExit(f"mvstudio: {folder} holds no built module; build it first: {PRESET}")
    if f"_core{suffix}" not in there:
        raise SystemExit(f"mvstudio: {folder / there[0]} is for another Python than this one, which takes _core{suffix}; "
                         "make the virtual environment with /usr/bin/python3 -m venv --system-site-packages")
    return folder


def version():
    return re.search(r"project\(mvstudio VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")).group(1)


def metadata():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lines = ["Metadata-Version: 2.1", f"Name: {project['name']}", f"Version: {version()}", f"Summary: {project['description']}",
             f"License: {project['license']['text']}", f"Requires-Python: {project['requires-python']}"]
    lines += [f"Requires-Dist: {need}" for need in project["dependencies"]]
    for extra, needs in project["optional-dependencies"].items():
        lines += [f"Provides-Extra: {extra}"] + [f"Requires-Dist: {need} ; extra == '{extra}'" for need in needs]
    return "\n".join(lines) + "\n"


def tag():
    """Of this Python and this machine: the module is compiled."""
    python = "cp" + sysconfig.get_config_var("py_version_nodot")
    return f"{python}-{python}-{re.sub(r'[-.]', '_', sysconfig.get_platform())}"


def contents():
    """(path in the wheel, bytes) of all files but RECORD."""
    folder, info = package_folder(), f"mvstudio-{version()}.dist-info"
    for path in sorted(folder.iterdir()):
        if path.is_file() and not path.name.startswith("."):
            yield f"mvstudio/{path.name}", path.read_bytes()
    yield f"{info}/METADATA", metadata().encode()
    yield f"{info}/WHEEL", f"Wheel-Version: 1.0\nGenerator: mvstudio\nRoot-Is-Purelib: false\nTag: {tag()}\n".encode()
    yield f"{info}/LICENSE", (ROOT / "LICENSE").read_bytes()


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """PEP 517: writes the wheel, returns its name."""
    name, record = f"mvstudio-{version()}-{tag()}.whl", io.StringIO()
    rows = csv.writer(record, lineterminator="\n")
    with zipfile.ZipFile(pathlib.Path(wheel_directory) / name, "w", zipfile.ZIP_DEFLATED) as wheel:
        for path, data in contents():
            digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
            wheel.writestr(zipfile.ZipInfo(path, (1980, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)
            rows.writerow([path, f"sha256={digest}", len(data)])
        path = f"mvstudio-{version()}.dist-info/RECORD"
        rows.writerow([path, "", ""])
        wheel.writestr(path, record.getvalue())
    return name


def build_sdist(sdist_directory, config_settings=None):
    """PEP 517: there is none, as the sources are C++ for CMake."""
    raise SystemExit("mvstudio: there is no source distribution for pip; build with CMake, then pip wheel .")
