"""Multi-view capture, from footage to scored avatars: calibrated cameras, points, people, data sets.

>>> import mvstudio
>>> rig = mvstudio.Rig("calibration.json")                       # doctest: +SKIP
>>> x, covariance, status = mvstudio.triangulate(px, rig)        # doctest: +SKIP
>>> mvstudio.plot.uncertainty(rig, "cam_01", range_m=3)          # doctest: +SKIP

Arrays are NumPy's: what is given may be anything that becomes an array of floats, what is returned is owned by NumPy. Metres,
radians and pixels unless a name says otherwise; frames and signs are those of docs/conventions.md.

What is named here is loaded when it is first used: the libraries of OpenCV, FFmpeg and others take a tenth of a second.
"""
import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mvstudio import metrics, plot, stages
    from mvstudio._body import Body, Gaussians, Pose, Render
    from mvstudio._calibrate import Calibration, Corners, calibrate
    from mvstudio._error import Error
    from mvstudio._program import command
    from mvstudio._report import Fields, Notice, Output, Report
    from mvstudio._rig import Rig
    from mvstudio._samples import Dataset, Pack, Sample
    from mvstudio._take import Take
    from mvstudio._triangulate import Points, Status, triangulate

    __version__: str

__all__ = ["Body", "Calibration", "Corners", "Dataset", "Error", "Fields", "Gaussians", "Notice", "Output", "Pack", "Points", "Pose",
           "Render", "Report", "Rig", "Sample", "Status", "Take", "calibrate", "command", "metrics", "plot", "stages", "triangulate"]
_HOLDS = {
    "_body": ("Body", "Gaussians", "Pose", "Render"),
    "_calibrate": ("Calibration", "Corners", "calibrate"),
    "_core": ("__version__",),
    "_error": ("Error",),
    "_program": ("command",),
    "_report": ("Fields", "Notice", "Output", "Report"),
    "_rig": ("Rig",),
    "_samples": ("Dataset", "Pack", "Sample"),
    "_take": ("Take",),
    "_triangulate": ("Points", "Status", "triangulate"),
}
_PLACES = {name: module for module, names in _HOLDS.items() for name in names}


def _imported(module: str) -> Any:
    """The module; an ImportError says what to install."""
    try:
        return importlib.import_module(f"mvstudio.{module}")
    except ImportError as error:
        reason = str(error)
        if "shared object" in reason:
            hint = "install the libraries of Debian 12 that mvstudio was built with: apt install ./python3-mvstudio_*.deb"
        elif error.name == "numpy":
            hint = "apt install python3-numpy, and make a virtual environment with python3 -m venv --system-site-packages"
        elif "'_core'" in reason:
            hint = "it is built for Debian's Python: /usr/bin/python3"
        else:
            raise
        raise ImportError(f"mvstudio: {reason} ({hint})", name=error.name, path=error.path) from None


def __getattr__(name: str) -> Any:
    if name in _PLACES:
        value = getattr(_imported(_PLACES[name]), name)
    elif name in ("metrics", "plot", "stages"):
        value = _imported(name)
    else:
        raise AttributeError(f"module 'mvstudio' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, "__version__"})
