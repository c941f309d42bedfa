"""Calibration of cameras from corners of a board."""
from __future__ import annotations

import os
import tempfile
from typing import Any, Mapping, NamedTuple, Sequence

import numpy as np

from mvstudio import stages
from mvstudio._error import Error
from mvstudio._report import Report
from mvstudio._rig import Rig


class Corners:
    """Corners of a board that were found in the cameras' images.

    Parameters
    ----------
    board : str
        As for ``mvstudio calibrate --board``: ``"chessboard:8x5:40mm"`` (inner corners).
    sizes_px : mapping of str to (int, int)
        Width and height of each camera's images.

    Examples
    --------
    >>> corners = mvstudio.Corners("chessboard:8x5:40mm", {"left": (640, 480), "right": (640, 480)})
    >>> corners.add("left", 0, [0, 1, 2], [[10.5, 20.5], [30.5, 20.5], [50.5, 20.5]])
    >>> len(corners)
    1
    """

    def __init__(self, board: str, sizes_px: Mapping[str, Sequence[int]]) -> None:
        self.board = board
        self.sizes_px = {name: (int(size[0]), int(size[1])) for name, size in sizes_px.items()}
        self._found: dict[tuple[str, int], tuple[np.ndarray, np.ndarray]] = {}

    def add(self, camera: str, frame: int, ids: Any, px: Any) -> None:
        """Adds what one image shows.

        Parameters
        ----------
        camera : str
        frame : int
            Equal frames of several cameras are one time step.
        ids : array_like, (n,), int
            Numbers of the corners, row by row of the board.
        px : array_like, (n, 2)
            Where they are; the centre of the top-left pixel is (0, 0).
        """
        if camera not in self.sizes_px:
            raise Error("CLI-USAGE", f"`camera` {camera!r}: there are {', '.join(self.sizes_px)}")
        numbers, points = np.asarray(ids, dtype=int), np.asarray(px, dtype=float)
        if numbers.ndim != 1 or points.shape != (len(numbers), 2):
            raise Error("CLI-USAGE", f"`px`: expected shape ({numbers.size}, 2), got {points.shape}")
        good = np.isfinite(points).all(axis=1)
        self._found[camera, int(frame)] = numbers[good], points[good]

    def __len__(self) -> int:
        return len(self._found)

    def write(self, path: Any) -> None:
        """Writes the corners as ``mvstudio calibrate --save-corners`` does (docs/corner-files.md)."""
        with open(path, "x", encoding="utf-8") as file:
            file.write(f"# board 0 {self.board}\n")
            for camera, (width, height) in self.sizes_px.items():
                file.write(f"# camera {width}x{height} {camera}\n")
            file.write("camera,frame,board,corner,x_px,y_px\n")
            for (camera, frame), (ids, px) in sorted(self._found.items(), key=lambda item: item[0]):
                for corner, (x, y) in zip(ids, px):
                    file.write(f"{camera},{frame},0,{corner},{float(x)!r},{float(y)!r}\n")


class Calibration(NamedTuple):
    """A calibrated rig, and what its calibration says of it."""

    rig: Rig
    report: Report


def calibrate(corners: Any = None, *, out: Any = None, **options: Any) -> Calibration:
    """Calibrates cameras.

    Parameters
    ----------
    corners : Corners, str, path or None
        Corners, or a file of them; None: footage, which `options` name.
    out : str, path or None
        Folder of calibration.json; None: nothing is kept but the result.
    **options
        Of `mvstudio.stages.calibrate`.

    Returns
    -------
    Calibration
        ``rig, report``.
    """
    with tempfile.TemporaryDirectory(prefix="mvstudio-") as folder:
        if isinstance(corners, Corners):
            options["corners"] = os.path.join(folder, "corners.csv")
            corners.write(options["corners"])
        elif corners is not None:
            options["corners"] = corners
        report = stages.calibrate(out=os.path.join(folder, "calib") if out is None else out, **options)
        return Calibration(Rig(report.path("calibration")), report)
