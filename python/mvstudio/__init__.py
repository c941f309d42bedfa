"""Multi-view capture, from footage to scored avatars: calibrated cameras, points, people, data sets.

>>> import mvstudio
>>> rig = mvstudio.Rig("calibration.json")                       # doctest: +SKIP
>>> x, covariance, status = mvstudio.triangulate(px, rig)        # doctest: +SKIP
>>> mvstudio.plot.uncertainty(rig, "cam_01", range_m=3)          # doctest: +SKIP

Arrays are NumPy's: what is given may be anything that becomes an array of floats, what is returned is owned by NumPy. Metres,
radians and pixels unless a name says otherwise; frames and signs are those of docs/conventions.md.
"""
from mvstudio import _core, metrics, plot, stages
from mvstudio._body import Body, Gaussians, Pose, Render
from mvstudio._calibrate import Calibration, Corners, calibrate
from mvstudio._error import Error
from mvstudio._program import command
from mvstudio._report import Fields, Notice, Output, Report
from mvstudio._rig import Rig
from mvstudio._samples import Dataset, Pack, Sample
from mvstudio._take import Take
from mvstudio._triangulate import Points, Status, triangulate

__version__: str = _core.__version__
__all__ = ["Body", "Calibration", "Corners", "Dataset", "Error", "Fields", "Gaussians", "Notice", "Output", "Pack", "Points", "Pose",
           "Render", "Report", "Rig", "Sample", "Status", "Take", "calibrate", "command", "metrics", "plot", "stages", "triangulate"]
