"""Pictures of what mvstudio computes, drawn by matplotlib, which is imported when the first of them is asked for.

Each function takes the module's own objects, or the folder or file that the program wrote. It draws into `ax`, or into a new figure
where that is None, and returns the Axes. What may be given:

calibration
    A `Rig`, what `calibrate` returned, the `Report` of a stage that wrote a calibration, a calibration file, or a folder with one.
result
    What `calibrate` returned, a `Report` of `stages.calibrate`, ``calibrate.result.json``, or a folder with it.
take
    A `Take`, or a folder of `triangulate`.
"""
from __future__ import annotations

import csv
import json
import os
import pathlib
from typing import Any, Iterable, Optional, Sequence

import numpy as np

from mvstudio._calibrate import Calibration, Corners
from mvstudio._error import Error
from mvstudio._report import Report
from mvstudio._rig import Camera, Rig
from mvstudio._take import Take

__all__ = ["coverage", "joint", "residuals", "rig", "take", "training", "uncertainty"]
COLUMNS, ROWS = 10, 8  # cells of a coverage, as in the program's report


def _axes(ax: Any, projection: Optional[str] = None) -> Any:
    try:
        from matplotlib import pyplot
    except ImportError as error:
        raise Error("MISSING-TOOL", f"mvstudio.plot needs matplotlib: {error}",
                    "apt install python3-matplotlib, or pip install matplotlib") from None
    if ax is None:
        return pyplot.figure(constrained_layout=projection is None).add_subplot(projection=projection)
    if projection == "3d" and not hasattr(ax, "set_zlim"):
        raise Error("CLI-USAGE", "`ax`: these Axes have two dimensions", 'make them with add_subplot(projection="3d")')
    return ax


def _rig_of(calibration: Any) -> Rig:
    if isinstance(calibration, Rig):
        return calibration
    if isinstance(calibration, Calibration):
        return calibration.rig
    return Rig(calibration.path("calibration") if isinstance(calibration, Report) else calibration)


def _take_of(source: Any) -> Take:
    return source if isinstance(source, Take) else Take(source)


def _metrics_of(result: Any) -> Any:
    """The metrics of a calibration."""
    if isinstance(result, Calibration):
        result = result.report
    if isinstance(result, Report):
        return result.metrics
    path = pathlib.Path(result)
    if path.is_dir():
        path = path / "calibrate.result.json"
    try:
        return json.loads(path.read_text(encoding="utf-8"))["metrics"]
    except OSError as error:
        raise Error("INPUT-IO", f"{path}: {error.strerror}",
                    "`calibrate` leaves it in its folder; or give what calibrate() returned") from None
    except (ValueError, KeyError, TypeError):
        raise Error("INPUT-FORMAT", f"{path}: is no result of `mvstudio calibrate`") from None


def _of_camera(table: Any, camera: Camera, what: str) -> tuple[str, Any]:
    """An entry of a dict by camera, by name or by index."""
    names = list(table)
    name = names[camera] if isinstance(camera, int) and -len(names) <= camera < len(names) else str(camera)
    if name not in table:
        raise Error("CLI-USAGE", f"`camera` {camera!r}: there are {what} of {', '.join(names) or 'no camera'}")
    return name, table[name]


def _image_frame(ax: Any, width: float, height: float) -> None:
    """Pixels as in an image: y down, the centre of the top-left pixel at (0, 0)."""
    ax.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), xlabel="x, px", ylabel="y, px", aspect="equal")


def _equal_scales(ax: Any, points: np.ndarray) -> None:
    """A metre has one length along x, y and z."""
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) == 0:
        return
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2, max(0.05, 0.5 * float((high - low).max()))
    ax.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half),
           zlim=(middle[2] - half, middle[2] + half))
    ax.set_box_aspect((1, 1, 1), zoom=0.85)  # room for the label of z
    for letter, axis in zip("xyz", (ax.xaxis, ax.yaxis, ax.zaxis)):
        axis.get_major_locator().set_params(nbins=5)
        axis.set_tick_params(labelsize=8, pad=0)
        axis.set_label_text(f"{letter}, m")


def uncertainty(calibration: Any, camera: Camera, *, range_m: float, levels: Any = 6, ax: Any = None) -> Any:
    """Where in an image the calibration is uncertain: a map with contours, px, and its scale.

    Parameters
    ----------
    calibration : Rig, Calibration, Report, str or path
    camera : str or int
    range_m : float
        Distance of the points from the camera, metres.
    levels : int or array_like
        Contours: how many, at round values, or at which px.
    ax : Axes or None

    Returns
    -------
    Axes
        Its image holds `Rig.uncertainty_px` on a grid of 32 x 24 pixels.
    """
    ax, cameras = _axes(ax), _rig_of(calibration)
    width, height = cameras.size_px(camera)
    name = cameras.names[cameras.index(camera)]
    x, y = np.linspace(0, width - 1, 32), np.linspace(0, height - 1, 24)
    values = cameras.uncertainty_px(camera, np.stack(np.meshgrid(x, y), axis=-1), range_m=range_m)
    half_x, half_y = (x[1] - x[0]) / 2, (y[1] - y[0]) / 2
    shown = ax.imshow(values, extent=(-half_x, x[-1] + half_x, y[-1] + half_y, -half_y), interpolation="bilinear", cmap="viridis")
    if np.nanmax(values) > np.nanmin(values):
        ax.clabel(ax.contour(x, y, values, levels=levels, colors="white", linewidths=0.8), fmt="%g px", fontsize=8)
    _image_frame(ax, width, height)
    ax.figure.colorbar(shown, ax=ax, label="standard deviation, px", shrink=min(1.0, 1.1 * height / width))
    ax.set_title(f"{name}: uncertainty of a point at {range_m:g} m")
    return ax


def residuals(result: Any, camera: Camera, *, magnify: float = 0.0, ax: Any = None) -> Any:
    """Residuals of a calibration as arrows from the corners, observed minus projected.

    Parameters
    ----------
    result : Calibration, Report, str or path
    camera : str or int
    magnify : float
        How many times longer than the residuals the arrows are; 0: so that long ones are a twentieth of the image.
    ax : Axes or None

    Returns
    -------
    Axes
        Its quiver holds the residuals, px: those that the report has, at most 2000 of a camera.
    """
    ax, metrics = _axes(ax), _metrics_of(result)
    name, rows = _of_camera(metrics.get("residuals", {}), camera, "residuals")
    values = np.array(rows, dtype=float).reshape(-1, 4)
    if len(values) == 0:
        raise Error("INPUT-FORMAT", f"camera {name} has no corner that the calibration kept")
    lengths = np.hypot(values[:, 2], values[:, 3])
    width, height = _size_of(result, name, values)
    if magnify <= 0:
        magnify = 0.05 * width / max(float(np.quantile(lengths, 0.95)), 1e-9)
    arrows = ax.quiver(*values.T, angles="xy", scale_units="xy", scale=1 / magnify, width=0.002, color="tab:red")
    unit = float(f"{np.median(lengths):.1g}") or 1.0
    ax.quiverkey(arrows, 0.97, -0.11, unit, f"{unit:g} px", labelpos="W", coordinates="axes")
    _image_frame(ax, width, height)
    ax.set_title(f"{name}: {len(values)} residuals, rms {np.sqrt(np.mean(lengths**2)):.3g} px")
    return ax


def _size_of(result: Any, camera: str, values: np.ndarray) -> tuple[float, float]:
    """Width and height of the camera's images; where no calibration is beside the result, of what holds all corners."""
    folder = pathlib.Path(result) if isinstance(result, (str, os.PathLike)) else None
    if folder is not None and folder.is_file():
        folder = folder.parent
    if folder is not None and not (folder / "calibration.json").is_file():
        return float(values[:, 0].max()) + 1, float(values[:, 1].max()) + 1
    return _rig_of(result if folder is None else folder).size_px(camera)


def coverage(source: Any, camera: Camera, *, ax: Any = None) -> Any:
    """How many corners of boards each part of an image holds.

    Parameters
    ----------
    source : Corners, Calibration, Report, str or path
        Corners; or the result of a calibration, whose kept corners are counted.
    camera : str or int
    ax : Axes or None

    Returns
    -------
    Axes
        Its image holds the counts: 8 rows of 10 cells.
    """
    ax = _axes(ax)
    if isinstance(source, Corners):
        name, size = _of_camera(source.sizes_px, camera, "corners")
        cells = _cells_of(source, name, size)
    else:
        named = {entry["name"]: entry for entry in _metrics_of(source).get("cameras", [])}
        name, entry = _of_camera(named, camera, "counts")
        cells = np.array(entry["coverage_cells"], dtype=int)
    shown = ax.imshow(cells, cmap="Blues", vmin=0)
    for (row, column), count in np.ndenumerate(cells):
        ax.text(column, row, str(count), ha="center", va="center", fontsize=7, color="white" if 2 * count > cells.max() else "black")
    ax.set(xticks=[], yticks=[], title=f"{name}: {cells.sum()} corners in {np.mean(cells > 0):.0%} of the cells")
    ax.figure.colorbar(shown, ax=ax, label="corners in a cell", shrink=0.8)
    return ax


def _cells_of(corners: Corners, camera: str, size: Sequence[int]) -> np.ndarray:
    cells = np.zeros((ROWS, COLUMNS), dtype=int)
    for (name, _), (_, px) in corners._found.items():
        if name == camera:
            column, row = ((px + 0.5) * [COLUMNS, ROWS] / np.asarray(size)).astype(int).T
            np.add.at(cells, (row.clip(0, ROWS - 1), column.clip(0, COLUMNS - 1)), 1)
    return cells


def rig(calibration: Any, *, size_m: float = 0.0, ax: Any = None) -> Any:
    """The cameras in space: from each centre to the corners of its image.

    Parameters
    ----------
    calibration : Rig, Calibration, Report, str or path
    size_m : float
        Length of those edges, metres; 0: an eighth of the rig's extent.
    ax : Axes of three dimensions or None

    Returns
    -------
    Axes
        Its lines are the cameras', in their order.
    """
    ax, cameras = _axes(ax, "3d"), _rig_of(calibration)
    centers = cameras.centers
    size_m = size_m if size_m > 0 else 0.125 * float(np.ptp(centers, axis=0).max()) or 0.2
    drawn = [centers]
    for i, name in enumerate(cameras.names):
        width, height = cameras.size_px(i)
        corners = np.array([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1]], dtype=float)
        ends = centers[i] + size_m * cameras.unproject(corners, i, frame="world")
        path = [point for k in range(4) for point in (centers[i], ends[k], ends[(k + 1) % 4])]  # NaN where the lens has no ray
        ax.plot(*np.array(path).T, color=f"C{i % 10}", linewidth=1)
        ax.text(*centers[i], "  " + name, fontsize=8, verticalalignment="top")
        drawn.append(ends)
    _equal_scales(ax, np.concatenate(drawn))
    ax.set_title(f"{len(cameras)} cameras")
    return ax


def take(source: Any, frame: Optional[int] = None, *, persons: Optional[Iterable[int]] = None, ax: Any = None) -> Any:
    """The joints of one time step in space, with the bones between them.

    Parameters
    ----------
    source : Take, str or path
    frame : int or None
        The frame's number; None: the one with most joints.
    persons : list of int or None
    ax : Axes of three dimensions or None

    Returns
    -------
    Axes
        One scatter and one line for each person. The line has the bones in their order, NaN between them.
    """
    ax, joints = _axes(ax, "3d"), _take_of(source)
    if len(joints) == 0:
        raise Error("INPUT-FORMAT", f"{joints.folder}: holds no frame")
    if frame is None:
        frame = int(joints.frames[np.argmax(np.isfinite(joints.x[..., 0]).sum(axis=(1, 2)))])
    if frame not in joints.frames:
        raise Error("CLI-FRAMES", f"`frame` {frame}: the take has frames {joints.frames[0]} to {joints.frames[-1]}")
    at = int(np.flatnonzero(joints.frames == frame)[0])
    places = {joint: i for i, joint in enumerate(joints.joints)}
    bones = [(places[a], places[b]) for a, b in joints.bones if a in places and b in places]
    for person in joints.persons if persons is None else persons:
        if person not in joints.persons:
            raise Error("CLI-USAGE", f"`persons`: there is no person {person}; there are {joints.persons}")
        x, color = joints.x[at, joints.persons.index(person)], f"C{joints.persons.index(person) % 10}"
        ax.scatter(*x.T, color=color, s=12, depthshade=False)
        path = np.array([row for a, b in bones for row in (x[a], x[b], np.full(3, np.nan))]).reshape(-1, 3)
        ax.plot(*path.T, color=color, label=f"person {person}")
    _equal_scales(ax, joints.x[at].reshape(-1, 3))
    ax.set_title(f"frame {frame}")
    return ax


def joint(source: Any, name: str, *, person: int = 0, axes: str = "xyz", sigmas: float = 1.0, ax: Any = None) -> Any:
    """The coordinates of a joint over time, with their standard deviation.

    Parameters
    ----------
    source : Take, str or path
    name : str
        The joint's.
    person : int
    axes : str
        Which of world's ``"xyz"``.
    sigmas : float
        Half the width of the bands, in standard deviations; 0: none.
    ax : Axes or None

    Returns
    -------
    Axes
        A line, metres, and a band for each of `axes`, over seconds where the take states its frame rate, else over frames.
    """
    if not axes or set(axes) - set("xyz"):
        raise Error("CLI-USAGE", f"`axes` {axes!r}: expected some of 'xyz'")
    ax, joints = _axes(ax), _take_of(source)
    x = joints.joint(name, person)
    place = joints.persons.index(person), joints.joints.index(name)
    deviation = np.sqrt(np.diagonal(joints.covariance[:, place[0], place[1]], axis1=1, axis2=2))
    timed = np.isfinite(joints.frame_rate_hz)
    time = joints.frames / joints.frame_rate_hz if timed else joints.frames
    for letter in axes:
        k = "xyz".index(letter)
        line, = ax.plot(time, x[:, k], label=letter)
        if sigmas > 0:
            half = sigmas * deviation[:, k]
            ax.fill_between(time, x[:, k] - half, x[:, k] + half, color=line.get_color(), alpha=0.3, linewidth=0)
    ax.set(xlabel="time, s" if timed else "frame", ylabel="m, in world", title=f"{name}, person {person}")
    ax.legend()
    return ax


def training(run: Any, columns: Sequence[str] = ("total",), *, ax: Any = None) -> Any:
    """How a training went: losses over its steps, on a logarithmic scale where they fall to a tenth.

    Parameters
    ----------
    run : str or path
        A run of `avatar train`, or its ``history.csv``.
    columns : list of str
        Of the history; each of its phases is a line of its own.
    ax : Axes or None

    Returns
    -------
    Axes
    """
    ax, path = _axes(ax), pathlib.Path(run)
    path = path / "history.csv" if path.is_dir() else path
    try:
        with open(path, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    except OSError as error:
        raise Error("INPUT-IO", f"{path}: {error.strerror}", "expected a run of `mvstudio avatar train`") from None
    if not rows or "step" not in rows[0]:
        raise Error("INPUT-FORMAT", f"{path}: is no history of a training, or holds no step")
    phases = dict.fromkeys(_phase(row) for row in rows)
    for column in columns:
        if column not in rows[0]:
            raise Error("CLI-USAGE", f"`columns`: {path} has no {column!r}; it has {', '.join(rows[0])}")
        for phase in phases:
            points = [(int(row["step"]), float(row[column])) for row in rows if _phase(row) == phase and row[column]]
            if points:
                ax.plot(*np.array(points).T, label=f"{column}, {phase}" if len(phases) > 1 else column,
                        marker="." if len(points) < 20 else "")
    values = [value for line in ax.lines for value in line.get_ydata()]
    wide = bool(values) and min(values) > 0 and max(values) > 10 * min(values)
    ax.set(xlabel="step", ylabel="loss", yscale="log" if wide else "linear", title="training")
    ax.legend()
    return ax


def _phase(row: dict[str, str]) -> str:
    return row.get("phase") or f"degree {row.get('degree', 0)}"
