"""Joints as TRC, CSV and numpy files."""

import glob
import re

import numpy as np

from exports.common import Camera, JOINTS, check


UNITS_PER_M = {"mm": 1000, "m": 1}


def people_files(folder, extension, compare):
    """(person, path), one for each person of the chosen frames."""
    expected = sorted({p for f in compare.manifest["frames"] for p in compare.dataset.frames[f]})
    found = {int(re.search(r"_person(\d+)\.", p).group(1)): p for p in glob.glob(folder + "/*" + extension)}
    check(sorted(found) == expected, "people %s, expected %s" % (sorted(found), expected))
    return sorted(found.items())


def truth_of(compare, frame, person):
    return compare.dataset.frames.get(frame, {}).get(person) if frame in compare.manifest["frames"] else None


def check_continuous(compare, person, series):
    """`series`: (frame, (19, 3)) for every instant from the first to the last."""
    frames = compare.manifest["frames"]
    check([f for f, _ in series] == list(range(frames[0], frames[-1] + 1)), "frame numbers")
    for frame, X in series:
        if truth_of(compare, frame, person) is None:
            check(np.isnan(X).all(), "joints of nobody in frame %d" % frame)
        else:
            compare.joint_set(frame, person, X)


def read_trc(folder, compare):
    for person, path in people_files(folder, ".trc", compare):
        lines = open(path).read().split("\n")
        check(lines[0].split("\t")[0] == "PathFileType", "first line")
        header = dict(zip(lines[1].split("\t"), lines[2].split("\t")))
        check(header["Units"] in UNITS_PER_M and header["NumMarkers"] == "19", "header")
        names = lines[3].split("\t")[2::3]
        check(names[:19] == JOINTS, "markers")
        rows = [line.split("\t") for line in lines[5:] if line]
        check(len(rows) == int(header["NumFrames"]), "NumFrames")
        series = []
        for row in rows:
            row += [""] * (59 - len(row))
            v = np.array([float(x) if x else np.nan for x in row[2:59]]).reshape(19, 3) / UNITS_PER_M[header["Units"]]
            series.append((int(row[0]) - 1, v[:, [2, 0, 1]]))  # the file's y is up
        check_continuous(compare, person, series)
    return {}


def read_csv(folder, compare):
    joints = {}
    for line in open(folder + "/joints.csv").read().split("\n")[1:]:
        if line:
            frame, person, joint, x, y, z, _ = line.split(",")
            key = (int(frame), int(person))
            joints.setdefault(key, np.full((19, 3), np.nan))[JOINTS.index(joint)] = [float(x), float(y), float(z)]
    for (frame, person), X in joints.items():
        compare.joint_set(frame, person, X)
    return {}


def read_npz(folder, compare):
    data = np.load(folder + "/joints.npz")
    check(list(data["joint_names"]) == JOINTS, "joint names")
    check(list(data["frames"]) == compare.manifest["frames"], "frames")
    for t, frame in enumerate(data["frames"]):
        for p, person in enumerate(data["people"]):
            if person in compare.dataset.frames[int(frame)]:
                compare.joint_set(int(frame), int(person), data["joints"][t, p])
            else:
                check(np.isnan(data["joints"][t, p]).all(), "joints of nobody")
    for i, name in enumerate(data["camera_names"]):
        T = data["cam_from_world"][i]
        camera = Camera(data["K"][i], data["distCoef"][i], T[:3, :3], T[:3, 3], tuple(data["size_px"][i]))
        compare.camera(str(name), camera, compare.manifest["frames"])
    return {}
