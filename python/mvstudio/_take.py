"""3D joints of people over time."""
from __future__ import annotations

import csv
import json
import os
import pathlib
import tempfile
from typing import Any, Iterator, Union

import numpy as np

from mvstudio import stages
from mvstudio._error import Error

Path = Union[str, "os.PathLike[str]"]


def _rows(path: pathlib.Path) -> Iterator[dict[str, str]]:
    try:
        with open(path, newline="", encoding="utf-8") as file:
            yield from csv.DictReader(file)
    except OSError as error:
        raise Error("INPUT-IO", f"{path}: {error.strerror}; expected a folder that triangulate wrote") from None


def _number(text: str) -> float:
    return float(text) if text else float("nan")


def _bones(about: dict[str, Any]) -> list[tuple[str, str]]:
    """Of a skeleton's definition (docs/formats.md): pairs of joints, or tables with such a pair."""
    bones = about.get("definition", {}).get("bones", [])
    pairs = [bone["joints"] if isinstance(bone, dict) else bone for bone in bones]
    return [(str(pair[0]), str(pair[1])) for pair in pairs]


class Take:
    """3D joints as ``triangulate`` writes them.

    Attributes
    ----------
    folder : str
    frames : ndarray, (f,), int
        Frame numbers, as in the footage.
    persons : list of int
    joints : list of str
    x : ndarray, (f, p, j, 3)
        Metres in world; NaN where there is no point.
    covariance : ndarray, (f, p, j, 3, 3)
        Square metres; NaN where there is none.
    sigma_m : ndarray, (f, p, j)
        Standard deviation along the worst axis, as points.csv states it.
    status : ndarray, (f, p, j), object
        ``"Ok"``, the reason why there is no point, or ``""`` where nobody looked for one.
    num_views : ndarray, (f, p, j), int
    frame_rate_hz : float
        NaN where nobody stated it.
    world : str
        What the world's axes are, in words.
    bones : list of (str, str)
        The joints between which the skeleton has a bone; empty where the take states none.

    Parameters
    ----------
    folder : str or path
        With points.csv, covariance.csv and pose3d.json.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = os.fspath(folder)
        place = pathlib.Path(folder)
        rows = list(_rows(place / "points.csv"))
        self.frames = np.array(sorted({int(row["frame"]) for row in rows}), dtype=int)
        self.persons = sorted({int(row["person"]) for row in rows})
        self.joints = list(dict.fromkeys(row["joint"] for row in rows))
        self._frame = {int(frame): i for i, frame in enumerate(self.frames)}
        self._person = {person: i for i, person in enumerate(self.persons)}
        self._joint = {joint: i for i, joint in enumerate(self.joints)}
        self._fill(rows)
        self._fill_covariance(place / "covariance.csv")
        try:
            about = json.loads((place / "pose3d.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            about = {}
        self.frame_rate_hz = float(about.get("frame_rate_hz") or "nan")
        self.world = str(about.get("world", ""))
        self.skeleton = str(about.get("skeleton", ""))
        self.bones = _bones(about)

    def _at(self, row: dict[str, str]) -> tuple[int, int, int]:
        return self._frame[int(row["frame"])], self._person[int(row["person"])], self._joint[row["joint"]]

    def _fill(self, rows: list[dict[str, str]]) -> None:
        shape = len(self.frames), len(self.persons), len(self.joints)
        self.x = np.full(shape + (3,), np.nan)
        self.sigma_m = np.full(shape, np.nan)
        self.status = np.full(shape, "", dtype=object)
        self.num_views = np.zeros(shape, dtype=int)
        for row in rows:
            at = self._at(row)
            self.x[at] = [_number(row[key]) for key in ("x_m", "y_m", "z_m")]
            self.sigma_m[at] = _number(row["sigma_m"])
            self.status[at] = row["status"]
            self.num_views[at] = int(row["num_views"] or 0)

    def _fill_covariance(self, path: pathlib.Path) -> None:
        self.covariance = np.full(self.x.shape + (3,), np.nan)
        if not path.is_file():
            return
        for row in _rows(path):
            xx, xy, xz, yy, yz, zz = (_number(row[key]) for key in ("xx", "xy", "xz", "yy", "yz", "zz"))
            self.covariance[self._at(row)] = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]

    def __len__(self) -> int:
        return len(self.frames)

    def __repr__(self) -> str:
        return f"Take of {len(self)} frames, {len(self.persons)} persons, {len(self.joints)} joints"

    def joint(self, name: str, person: int = 0) -> np.ndarray:
        """(f, 3) metres in world: a joint of one person over the frames.

        Parameters
        ----------
        name : str
        person : int
            As in `persons`.
        """
        if name not in self._joint:
            raise Error("CLI-USAGE", f"the take has no joint {name!r}; it has {', '.join(self.joints)}")
        if person not in self._person:
            raise Error("CLI-USAGE", f"the take has no person {person}; it has {self.persons}")
        return self.x[:, self._person[person], self._joint[name]]

    def to_frame(self) -> Any:
        """A pandas DataFrame: a row a joint, with frame, person, joint, x_m, y_m, z_m, sigma_m, num_views and status."""
        import pandas
        f, p, j = np.nonzero(self.status != "")
        return pandas.DataFrame({"frame": self.frames[f], "person": np.array(self.persons, dtype=int)[p],
                                 "joint": np.array(self.joints, dtype=object)[j], "x_m": self.x[f, p, j, 0],
                                 "y_m": self.x[f, p, j, 1], "z_m": self.x[f, p, j, 2], "sigma_m": self.sigma_m[f, p, j],
                                 "num_views": self.num_views[f, p, j], "status": self.status[f, p, j]})

    def angles(self, person: int = 0, **options: Any) -> dict[str, np.ndarray]:
        """Joint angles, as ``mvstudio markers angles`` computes them.

        Parameters
        ----------
        person : int
        **options
            Of `mvstudio.stages.markers_angles`: `filter`, `fill`, `frame_rate`, …

        Returns
        -------
        dict of str to ndarray
            The columns of the table of angles, a row for each frame and angle: ``frame`` and ``time_s``, the name ``angle``,
            ``value_deg`` and ``sigma_deg``, NaN where there is none, and ``status``, which says why (docs/joint-angles.md).
            ``pandas.DataFrame(take.angles())`` is that table.
        """
        with tempfile.TemporaryDirectory(prefix="mvstudio-") as folder:
            out = os.path.join(folder, "angles")
            stages.markers_angles(self.folder, out=out, **options)
            path = pathlib.Path(out) / f"person{person}.angles.csv"
            rows = list(_rows(path))
        texts = {key: np.array([row[key] for row in rows], dtype=object) for key in ("angle", "status")}
        numbers = {key: np.array([_number(row[key]) for row in rows]) for key in ("time_s", "value_deg", "sigma_deg")}
        frames = np.array([int(row["frame"]) for row in rows], dtype=int)
        return {"frame": frames, "time_s": numbers.pop("time_s"), "angle": texts["angle"], **numbers, "status": texts["status"]}
