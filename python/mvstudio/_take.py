"""3D joints of people over time."""
from __future__ import annotations

import copy
import csv
import itertools
import json
import os
import pathlib
import tempfile
from typing import Any, Iterator, Sequence, Union

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


def _columns(path: pathlib.Path, numbers: Sequence[str], words: Sequence[str]) -> tuple[dict[str, np.ndarray], dict[str, list[str]]]:
    """Columns of a table, some rows at a time: floats, NaN where a field is empty; words as indices into the list of each column, which
    is in the order of appearance."""
    known: dict[str, dict[str, int]] = {name: {} for name in words}
    pieces: dict[str, list[np.ndarray]] = {name: [] for name in (*numbers, *words)}
    try:
        with open(path, newline="", encoding="utf-8") as file:
            reader = csv.reader(file)
            places = {name: k for k, name in enumerate(next(reader, []))}
            while rows := list(itertools.islice(reader, 2048)):
                columns = list(zip(*rows, strict=True))
                for name in numbers:
                    pieces[name].append(np.array([float(text) if text else np.nan for text in columns[places[name]]]))
                for name in words:
                    codes = known[name]
                    pieces[name].append(np.array([codes.setdefault(text, len(codes)) for text in columns[places[name]]], dtype=np.int32))
    except OSError as error:
        raise Error("INPUT-IO", f"{path}: {error.strerror}; expected a folder that triangulate wrote") from None
    except (ValueError, KeyError, IndexError) as error:
        raise Error("INPUT-FORMAT", f"{path}: is no table of triangulate: {error}") from None
    columns_of = {name: np.concatenate(found) if found else np.zeros(0, np.int32 if name in known else float) for name, found in pieces.items()}
    return columns_of, {name: list(codes) for name, codes in known.items()}


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
        self._fill(*_columns(place / "points.csv", ("frame", "person", "x_m", "y_m", "z_m", "num_views", "sigma_m"), ("joint", "status")))
        self._fill_covariance(place / "covariance.csv")
        try:
            about = json.loads((place / "pose3d.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            about = {}
        self.frame_rate_hz = float(about.get("frame_rate_hz") or "nan")
        self.world = str(about.get("world", ""))
        self.skeleton = str(about.get("skeleton", ""))
        self.bones = _bones(about)
        self._smoothing: dict[str, Any] = {}

    def _fill(self, column: dict[str, np.ndarray], words: dict[str, list[str]]) -> None:
        self.frames, frame = np.unique(column["frame"].astype(int), return_inverse=True)
        persons, person = np.unique(column["person"].astype(int), return_inverse=True)
        self.persons = [int(number) for number in persons]
        self.joints = words["joint"]
        self._person = {number: i for i, number in enumerate(self.persons)}
        self._joint = {name: i for i, name in enumerate(self.joints)}
        shape, at = (len(self.frames), len(self.persons), len(self.joints)), (frame, person, column["joint"])
        self.x = np.full(shape + (3,), np.nan)
        self.x[at] = np.stack([column[key] for key in ("x_m", "y_m", "z_m")], axis=1)
        self.sigma_m = np.full(shape, np.nan)
        self.sigma_m[at] = column["sigma_m"]
        self.status = np.full(shape, "", dtype=object)
        self.status[at] = np.array(words["status"], dtype=object)[column["status"]]
        self.num_views = np.zeros(shape, dtype=int)
        self.num_views[at] = np.nan_to_num(column["num_views"]).astype(int)

    def _fill_covariance(self, path: pathlib.Path) -> None:
        self.covariance = np.full(self.x.shape + (3,), np.nan)
        if not path.is_file():
            return
        column, words = _columns(path, ("frame", "person", "xx", "xy", "xz", "yy", "yz", "zz"), ("joint",))
        places = np.array([self._joint.get(name, -1) for name in words["joint"]], dtype=int)[column["joint"]]
        frame, person = column["frame"].astype(int), column["person"].astype(int)
        known = (places >= 0) & np.isin(frame, self.frames) & np.isin(person, self.persons)
        at = np.searchsorted(self.frames, frame[known]), np.searchsorted(self.persons, person[known]), places[known]
        rows = np.stack([column[key][known] for key in ("xx", "xy", "xz", "xy", "yy", "yz", "xz", "yz", "zz")], axis=1)
        self.covariance[at] = rows.reshape(-1, 3, 3)

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

    def filtered(self, **options: Any) -> Take:
        """The take with gaps filled and joints filtered, as ``mvstudio markers`` does it.

        Parameters
        ----------
        **options
            Of `mvstudio.stages.markers`: ``filter="butterworth:6Hz"``, ``fill=10``, `frame_rate`, …

        Returns
        -------
        Take
            With other `x` and `sigma_m`. `status` and `covariance` are still those of the measurement: a filled gap has a place and a
            status that is not ``"Ok"``. `angles` and `events` of it filter alike.
        """
        made = copy.copy(self)
        made._smoothing = {**self._smoothing, **options}
        made.x, made.sigma_m = np.full_like(self.x, np.nan), np.full_like(self.sigma_m, np.nan)
        with tempfile.TemporaryDirectory(prefix="mvstudio-") as folder:
            out = pathlib.Path(folder) / "markers"
            stages.markers(self.folder, to="csv", out=out, **made._smoothing)
            for person, p in self._person.items():
                path = out / f"person{person}.csv"
                if not path.exists():
                    continue
                column, words = _columns(path, ("frame", "x_m", "y_m", "z_m", "sigma_m"), ("joint",))
                frames = column["frame"].astype(int)
                known = np.isin(frames, self.frames)  # of gaps, the table has frames that the take has not
                joints = np.array([self._joint[name] for name in words["joint"]], dtype=int)[column["joint"]][known]
                at = np.searchsorted(self.frames, frames[known]), np.full(known.sum(), p), joints
                made.x[at] = np.stack([column[key][known] for key in ("x_m", "y_m", "z_m")], axis=1)
                made.sigma_m[at] = column["sigma_m"][known]
        return made

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
        rows = self._table(stages.markers_angles, person, "angles", options)
        texts = {key: np.array([row[key] for row in rows], dtype=object) for key in ("angle", "status")}
        numbers = {key: np.array([_number(row[key]) for row in rows]) for key in ("time_s", "value_deg", "sigma_deg")}
        frames = np.array([int(row["frame"]) for row in rows], dtype=int)
        return {"frame": frames, "time_s": numbers.pop("time_s"), "angle": texts["angle"], **numbers, "status": texts["status"]}

    def events(self, person: int = 0, **options: Any) -> dict[str, np.ndarray]:
        """Heel strikes and toe offs, as ``mvstudio markers events`` proposes them.

        Parameters
        ----------
        person : int
        **options
            Of `mvstudio.stages.markers_events`: `filter`, `fill`, `frame_rate`, …

        Returns
        -------
        dict of str to ndarray
            The columns of the table, a row for each event: ``frame`` and ``time_s``, ``side``, ``event``, ``confidence``, and
            ``velocity_frame``, NaN where the second opinion has none (docs/joint-angles.md). Empty where the person does not walk.
        """
        rows = self._table(stages.markers_events, person, "events", options)
        texts = {key: np.array([row[key] for row in rows], dtype=object) for key in ("side", "event", "confidence")}
        numbers = {key: np.array([_number(row[key]) for row in rows], dtype=float) for key in ("time_s", "velocity_frame")}
        frames = np.array([int(row["frame"]) for row in rows], dtype=int)
        return {"frame": frames, "time_s": numbers["time_s"], **texts, "velocity_frame": numbers["velocity_frame"]}

    def _table(self, stage: Any, person: int, what: str, options: dict[str, Any]) -> list[dict[str, str]]:
        """Rows of a table of one person that a stage writes."""
        if person not in self._person:
            raise Error("CLI-USAGE", f"the take has no person {person}; it has {self.persons}")
        with tempfile.TemporaryDirectory(prefix="mvstudio-") as folder:
            out = os.path.join(folder, what)
            stage(self.folder, out=out, **{**self._smoothing, **options})
            path = pathlib.Path(out) / f"person{person}.{what}.csv"
            return list(_rows(path)) if path.exists() else []
