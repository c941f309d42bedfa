"""Bodies that were fitted to people, and Gaussians on them."""
from __future__ import annotations

import os
import pathlib
from typing import Any, NamedTuple, Optional, Sequence

import numpy as np

from mvstudio import _core
from mvstudio._error import Error
from mvstudio._program import command


class Pose(NamedTuple):
    """A pose by joint angles; no bone is stretched.

    Attributes
    ----------
    shift : ndarray, (3,)
        Metres: the root bone's head lies at its rest place plus this, in world.
    rotations : ndarray, (b, 4)
        x, y, z, w of each bone about its head, relative to its parent, in the axes of the rest pose.
    """

    shift: np.ndarray
    rotations: np.ndarray


class Render(NamedTuple):
    """What a camera sees, on black.

    Attributes
    ----------
    image : ndarray, (h, w, 3), uint8
        RGB times coverage.
    cover : ndarray, (h, w), uint8
        255: the pixel is covered.
    """

    image: np.ndarray
    cover: np.ndarray


class Body:
    """A skinned, textured body that was fitted to a person.

    Frame ``body``: metres, z up, the person faces -y, x to the person's left.

    Attributes
    ----------
    vertices : ndarray, (v, 3), float32
        At rest, in body, metres.
    faces : ndarray, (f, 3), int
        Counter-clockwise seen from outside.
    face_part : ndarray, (f,), int
        1 to 24: the chart.
    face_uv : ndarray, (3 f, 2), float32
        Chart coordinates of each face's corners.
    bone_names : list of str
    bone_parents : ndarray, (b,), int
        -1 for the root; parents come first.
    bone_heads, bone_tails : ndarray, (b, 3)
        At rest, in body.
    skin_bones, skin_weights : ndarray, (v, 4)
        Which bones move a vertex, and how much.
    coco19 : ndarray, (19, 3)
        CMU Panoptic's joints at rest, in body.
    moves : bool
        Whether the surface changes with the pose beyond skinning.

    Parameters
    ----------
    path : str or path
        ``body.npz``, or a folder with it: of `avatar fit`, or a run of `avatar train`.
    """

    def __init__(self, path: Any) -> None:
        place = pathlib.Path(path)
        self.path = os.fspath(place / "body.npz" if place.is_dir() else place)
        self._held = _core.Body(self.path)
        self._arrays: dict[str, Any] = self._held.arrays()

    @classmethod
    def fit(cls, dataset: Any, *, out: Any, **options: Any) -> Body:
        """Fits a body to the images of a dataset: the command ``mvstudio avatar fit``, in a process of its own.

        Parameters
        ----------
        dataset : str or path
            Folder in Panoptic's layout, with masks.
        out : str or path
            Folder of the body.
        **options
            Of the command: ``holdout_cameras="cam_05"``, …; `overwrite`, `threads` and `seed`.
        """
        command("avatar fit", dataset, out=out, **options)
        return cls(out)

    def __getattr__(self, name: str) -> Any:
        arrays = self.__dict__.get("_arrays", {})
        if name not in arrays:
            raise AttributeError(f"{type(self).__name__} has no {name!r}")
        return arrays[name]

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._arrays})

    def __repr__(self) -> str:
        return f"Body of {len(self.vertices)} vertices, {len(self.bone_names)} bones, poses of {len(self.frames)} frames"

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return type(self), (self.path,)

    @property
    def textures(self) -> np.ndarray:
        """(24, s, s, 3) uint8: colours of the charts; (x, y) of chart k has u = (x + 0.5) / s, v = (y + 0.5) / s, part k + 1."""
        return self._held.textures()

    @property
    def frames(self) -> list[int]:
        """Frames of which the fit kept a pose, by joints and images."""
        return self._held.frames()

    def pose(self, frame: Optional[int] = None, *, joints: Any = None) -> Pose:
        """A pose that the fit kept, or the one of joints.

        Parameters
        ----------
        frame : int or None
            One of `frames`.
        joints : array_like, (19, 3), or None
            CMU Panoptic's, metres in world; NaN where there is none. Neck, shoulders and hips are needed.
        """
        if (frame is None) == (joints is None):
            raise Error("CLI-USAGE", "`pose` takes a frame or joints")
        if frame is not None:
            return Pose(*self._held.seen_pose(frame))
        return Pose(*self._held.pose_by_joints(np.asarray(joints, dtype=float)))

    def vertices_at(self, pose: Pose) -> np.ndarray:
        """(v, 3) float32, metres in world: the surface in a pose."""
        return self._held.vertices(pose.shift, pose.rotations)

    def joints_at(self, pose: Pose) -> np.ndarray:
        """(19, 3) metres in world: CMU Panoptic's joints in a pose."""
        return self._held.joints(pose.shift, pose.rotations)

    def render(self, pose: Pose, K: Any, cam_from_world: Any, size_px: Sequence[int], *, threads: int = 0) -> Render:
        """The body in its colours, as a pinhole camera sees it.

        Parameters
        ----------
        pose : Pose
        K : array_like, (3, 3)
            Px, without skew; the centre of the top-left pixel is (0, 0).
        cam_from_world : array_like, (4, 4)
            Metres.
        size_px : (int, int)
            Width and height.
        threads : int

        Returns
        -------
        Render
            ``image, cover``.
        """
        return Render(*self._held.render(None, pose.shift, pose.rotations, K, cam_from_world, size_px[0], size_px[1], threads))


class Gaussians:
    """Gaussians on a body, as ``avatar train --method gaussians`` learned them.

    Attributes
    ----------
    body : Body
        Of the run.
    about : dict
        ``size``: their number; ``size_px``: edge of the training images; ``step``, ``degree``, ``mip``, ``options``.

    Parameters
    ----------
    run : str or path
        The run's folder, with ``gaussians.npz`` and ``body.npz``.
    """

    def __init__(self, run: Any) -> None:
        self.run = os.fspath(run)
        self.body = Body(run)
        self._held = _core.Gaussians(os.path.join(self.run, "gaussians.npz"), self.body._held)
        self.about: dict[str, Any] = self._held.about()

    def __len__(self) -> int:
        return int(self.about["size"])

    def __repr__(self) -> str:
        return f"Gaussians: {len(self)} on a {self.body!r}"

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return type(self), (self.run,)

    def render(self, pose: Pose, K: Any, cam_from_world: Any, size_px: Sequence[int], *, threads: int = 0) -> Render:
        """The Gaussians, as a pinhole camera sees them; arguments and result are those of `Body.render`."""
        return Render(*self.body._held.render(self._held, pose.shift, pose.rotations, K, cam_from_world, size_px[0], size_px[1], threads))
