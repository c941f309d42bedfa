"""Cameras with their lenses, poses and uncertainty."""
from __future__ import annotations

import json
import os
from typing import Any, Iterable, Mapping, Union

import numpy as np

from mvstudio import _core
from mvstudio._cameras import camera_entry
from mvstudio._error import Error

Camera = Union[str, int]


def _paths(paths: Any) -> list[str]:
    if isinstance(paths, (str, os.PathLike)):
        return [os.fspath(paths)]
    return [os.fspath(path) for path in paths]


class Rig:
    """The calibrated cameras of a studio in one world frame.

    World is right-handed, in metres; cameras have x right, y down, z forward. The centre of the top-left pixel is (0, 0).
    A rig does not change; methods that change something return another.

    Parameters
    ----------
    paths : str, path or list of them
        A calibration of any format that ``mvstudio calib convert`` reads, a folder that holds one, or several files.
    from_ : str
        The format, as for `calib convert`; ``"auto"``: by the content.
    size : str
        ``"1920x1080"``, of files that do not give it.
    unit : str
        ``"m"``, ``"cm"``, ``"mm"`` or ``"in"``: of files that name none.
    lens : str
        ``"auto"``, ``"perspective"`` or ``"fisheye"``: of files that do not say it.
    frame_rate_hz : float
        Of the cameras, for time shifts in seconds; 0: unknown.
    invert, mirror : bool
        The file's poses go the other way round; its world is left-handed.
    allow_approximation_px : float
        How far a pixel may move where the nearest lens takes the place of one with skew.

    Examples
    --------
    >>> rig = mvstudio.Rig("calibration.json")                 # doctest: +SKIP
    >>> rig.project([[0.0, 0.0, 1.0]], "cam_01")               # doctest: +SKIP
    array([[ 961.2,  540.7]])

    Notes
    -----
    Lens models and conventions: docs/conventions.md and docs/calibration.md.
    """

    def __init__(self, paths: Any, *, from_: str = "auto", size: str = "", unit: str = "m", lens: str = "auto",
                 frame_rate_hz: float = 0.0, invert: bool = False, mirror: bool = False,
                 allow_approximation_px: float = 0.0) -> None:
        self._held = _core.Rig(_paths(paths), from_, size, unit, lens, frame_rate_hz, invert, mirror, allow_approximation_px)

    @classmethod
    def _of(cls, held: Any) -> Rig:
        rig = cls.__new__(cls)
        rig._held = held
        return rig

    @classmethod
    def from_cameras(cls, cameras: Mapping[str, Mapping[str, Any]]) -> Rig:
        """A rig of cameras that are at hand as arrays, as OpenCV has them.

        Parameters
        ----------
        cameras : mapping of str to mapping
            By name: ``size_px`` (width, height), ``K`` (3, 3), ``distortion`` (d,) in OpenCV's order, or none, and
            ``cam_from_world`` (4, 4), metres, or none: the world is this camera's frame. ``model`` names the lens where the number
            of distortion terms does not: 0 is a pinhole, 4, 5, 8 and 12 are OpenCV's standard lens. ``"kannala4"`` is its fisheye.

        Examples
        --------
        >>> K = [[900, 0, 640], [0, 900, 360], [0, 0, 1]]
        >>> rig = mvstudio.Rig.from_cameras({"left": {"size_px": (1280, 720), "K": K, "distortion": [-0.1, 0.02, 0, 0]}})
        >>> rig.model("left"), rig.project([[0.0, 0.0, 2.0]], "left").tolist()
        ('brown4', [[640.0, 360.0]])
        """
        entries = [camera_entry(name, dict(given)) for name, given in cameras.items()]
        return cls.from_json(json.dumps({"schema": "mvstudio.calibration/1", "unit": "m", "cameras": entries}))

    @classmethod
    def from_json(cls, text: str) -> Rig:
        """The rig in the text of a calibration.json."""
        return cls._of(_core.Rig.from_json(text))

    def to_json(self) -> str:
        """The text of a calibration.json, which keeps every bit."""
        return self._held.to_json()

    def write(self, path: Any) -> None:
        """Writes a calibration.json; a file that mvstudio did not write is never replaced."""
        self._held.write(os.fspath(path))

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return Rig.from_json, (self.to_json(),)

    def __len__(self) -> int:
        return len(self._held)

    def __repr__(self) -> str:
        return f"Rig of {len(self)} cameras: {', '.join(self.names)}"

    @property
    def names(self) -> list[str]:
        """The cameras' names, in order."""
        return self._held.names()

    @property
    def notes(self) -> list[tuple[str, str, str]]:
        """What the reader had to say of the file: code, text and hint of each."""
        return self._held.notes()

    @property
    def gauge(self) -> str:
        """What fixes the world frame, in words."""
        return self._held.gauge()

    def index(self, camera: Camera) -> int:
        """The index of a camera's name."""
        return self._held.index(camera)

    def size_px(self, camera: Camera) -> tuple[int, int]:
        """Width and height of a camera's images."""
        return self._held.size_px(camera)

    def model(self, camera: Camera) -> str:
        """The name of the lens model, such as ``"brown4"``."""
        return self._held.model(camera)

    def params(self, camera: Camera) -> np.ndarray:
        """(P,) fx, fy, cx, cy in px, then the distortion; `param_names` names them."""
        return self._held.params(camera)

    def param_names(self, camera: Camera) -> list[str]:
        """Names of `params`."""
        return self._held.param_names(camera)

    def K(self, camera: Camera) -> np.ndarray:
        """(3, 3) the matrix of focal lengths and principal point, px."""
        return self._held.K(camera)

    def b_from_a(self, b: Camera, a: Camera) -> np.ndarray:
        """(4, 4) the transform with ``x_in_b = b_from_a @ x_in_a``, metres; a and b are cameras or ``"world"``."""
        return self._held.b_from_a(b, a)

    def cam_from_world(self, camera: Camera) -> np.ndarray:
        """(4, 4) ``x_in_cam = cam_from_world @ x_in_world``, metres."""
        return self._held.b_from_a(camera, "world")

    @property
    def centers(self) -> np.ndarray:
        """(c, 3) the cameras' centres in world, metres."""
        return np.stack([self._held.b_from_a("world", i)[:3, 3] for i in range(len(self))])

    def subset(self, cameras: Iterable[Camera]) -> Rig:
        """The rig of these cameras, in this order, with what is stated of their covariance."""
        return Rig._of(self._held.subset(list(cameras)))

    def project(self, points: Any, camera: Camera, *, frame: str = "world", jacobians: bool = False, threads: int = 0) -> Any:
        """Pixels of points in a camera.

        Parameters
        ----------
        points : array_like, (..., 3)
            Metres.
        camera : str or int
            Name or index.
        frame : str
            Of the points: ``"world"`` or ``"cam"``.
        jacobians : bool
            Whether derivatives are returned as well.
        threads : int
            0: as many as the machine has.

        Returns
        -------
        px : ndarray, (..., 2)
            NaN where the camera has no pixel for the point: behind it, beyond the radius where the lens folds, not finite.
            A pixel may lie outside the image.
        d_px_d_points : ndarray, (..., 2, 3)
            With `jacobians`: px per metre.
        d_px_d_params : ndarray, (..., 2, P)
            With `jacobians`: with respect to `params`.
        """
        call = self._held.project_with_jacobians if jacobians else self._held.project
        return call(points, camera, _in_cam(frame), threads)

    def unproject(self, px: Any, camera: Camera, *, frame: str = "cam", threads: int = 0) -> np.ndarray:
        """Rays of pixels.

        Parameters
        ----------
        px : array_like, (..., 2)
        camera : str or int
        frame : str
            Of the rays: ``"cam"`` or ``"world"``; in world they begin at the camera's centre.
        threads : int

        Returns
        -------
        ndarray, (..., 3)
            Unit vectors; NaN where the lens has no ray. `project` leads back within 1e-9 px.
        """
        return self._held.unproject(px, camera, not _in_cam(frame), threads)

    @property
    def covariance(self) -> Any:
        """(N, N) covariance of all cameras together, or None where the calibration states none.

        For each camera its `params`, then rotation (rad) and translation (m) of the left perturbation of `cam_from_world`.
        """
        return self._held.joint_covariance()

    def params_covariance(self, camera: Camera) -> Any:
        """(P, P) covariance of `params`, or None where it is unknown."""
        return self._held.params_covariance(camera)

    def pose_covariance(self, camera: Camera) -> Any:
        """(6, 6) covariance of `cam_from_world`, rotation (rad) and translation (m), or None where it is unknown."""
        return self._held.pose_covariance(camera)

    def uncertainty_px(self, camera: Camera, px: Any = None, *, range_m: float, threads: int = 0) -> np.ndarray:
        """How far a point of world may lie from its pixel because of the calibration's own errors.

        Parameters
        ----------
        camera : str or int
        px : array_like, (..., 2), or None
            None: a grid of 32 x 24 pixels over the image.
        range_m : float
            Distance of the points from the camera, metres.
        threads : int

        Returns
        -------
        ndarray, (...)
            Standard deviation along the worst direction, px: J S J^T with the covariance S of the camera's lens and pose,
            relative to what fixes the world (`gauge`). NaN where the lens has no ray. The report of `calibrate` has figures
            that are relative to the boards instead (docs/calibration.md).
        """
        if px is None:
            width, height = self.size_px(camera)
            px = np.stack(np.meshgrid(np.linspace(0, width - 1, 32), np.linspace(0, height - 1, 24)), axis=-1)
        return self._held.uncertainty_px(px, camera, range_m, threads)

    def undistortion_map(self, camera: Camera, *, view: str = "inside", width_px: int = 0, height_px: int = 0,
                         max_fov_deg: float = 150.0, threads: int = 0) -> tuple[np.ndarray, np.ndarray]:
        """Where each pixel of an ideal pinhole at the camera's place lies in the camera's images.

        Parameters
        ----------
        camera : str or int
        view : str
            ``"inside"``: the largest view without black borders; ``"all"``: every pixel; ``"keep"``: the lens's own focal
            lengths and principal point; ``"centred"``: as inside, about the axis.
        width_px, height_px : int
            Of the pinhole's images; 0: those of the camera's.
        max_fov_deg : float
            Widest field of view of the pinhole.
        threads : int

        Returns
        -------
        map : ndarray, (h, w, 2)
            x and y, px; NaN without a source. ``cv2.remap(image, map.astype("f4"), None, cv2.INTER_LINEAR)`` undistorts.
        K : ndarray, (3, 3)
            Of the pinhole.
        """
        return self._held.undistortion_map(camera, view, width_px, height_px, max_fov_deg, threads)


def _in_cam(frame: str) -> bool:
    if frame not in ("world", "cam"):
        raise Error("CLI-USAGE", f"`frame` {frame!r}: expected 'world' or 'cam'")
    return frame == "cam"
