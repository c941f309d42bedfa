"""C3D, Intel byte order, floats."""

import struct

import numpy as np

from exports.common import JOINTS, check
from exports.joint_files import check_continuous, people_files


def c3d_parameters(data):
    at = 512 * (data[0] - 1)
    check(data[at + 3] == 84, "processor type")
    at += 4
    groups, values = {}, {}
    while at < len(data):
        length, ident = struct.unpack_from("bb", data, at)
        if length == 0:
            break
        name = data[at + 2:at + 2 + abs(length)].decode()
        after = at + 2 + abs(length)
        step, = struct.unpack_from("<h", data, after)
        if ident < 0:
            groups[-ident] = name
        else:
            kind, count = struct.unpack_from("bB", data, after + 2)
            dims = list(data[after + 4:after + 4 + count])
            size, raw = int(np.prod(dims)) if dims else 1, data[after + 4 + count:]
            if kind == -1:
                text = raw[:size].decode()
                value = [text[i:i + dims[0]].strip() for i in range(0, size, dims[0])] if len(dims) == 2 else text
            else:
                value = np.frombuffer(raw, {1: "<u1", 2: "<u2", 4: "<f4"}[kind], size)
            values[groups[ident] + ":" + name] = value
        if step == 0:
            break
        at = after + step
    return values


def read_c3d(folder, compare):
    for person, path in people_files(folder, ".c3d", compare):
        data = open(path, "rb").read()
        check(len(data) % 512 == 0 and data[1] == 0x50, "blocks")
        points, _, first, last, _ = struct.unpack_from("<5H", data, 2)
        scale, start, analog, rate = struct.unpack_from("<fHHf", data, 12)
        p = c3d_parameters(data)
        check(p["POINT:LABELS"] == JOINTS and points == 19 and analog == 0, "points")
        check(scale < 0 and p["POINT:SCALE"][0] == scale and p["POINT:UNITS"] == "mm", "scale, units")
        check(p["POINT:DATA_START"][0] == start and p["POINT:RATE"][0] == rate and rate > 0, "start, rate")
        field = p["TRIAL:ACTUAL_START_FIELD"]
        begin = int(field[0]) + 65536 * int(field[1])
        check(first == min(begin, 65535), "first frame")
        count = int(p["POINT:LONG_FRAMES"][0])
        values = np.frombuffer(data, "<f4", count * points * 4, 512 * (start - 1)).reshape(count, points, 4).astype(float)
        series = []
        for t in range(count):
            X = np.where(values[t, :, 3:] < 0, np.nan, values[t, :, :3] / 1000)
            series.append((begin - 1 + t, X))
        check_continuous(compare, person, series)
    return {}
