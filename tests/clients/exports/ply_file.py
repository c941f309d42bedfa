"""PLY files, binary and ASCII."""

import numpy as np

from exports.common import check


def read_ply(path):
    data = open(path, "rb").read()
    head, body = data.split(b"end_header\n", 1)
    kinds = {"float": "f4", "double": "f8", "uchar": "u1", "int": "i4"}
    elements = []
    for line in head.decode().split("\n"):
        w = line.split()
        if w[:1] == ["element"]:
            elements.append((w[1], int(w[2]), []))
        elif w[:1] == ["property"]:
            elements[-1][2].append((w[2], "<" + kinds[w[1]]))
    out = {}
    binary = b"binary_little_endian" in head
    rows = None if binary else body.decode().split("\n")
    for name, count, fields in elements:
        if binary:
            kind = np.dtype(fields)
            out[name] = np.frombuffer(body, kind, count)
            body = body[count * kind.itemsize:]
        else:
            table = [tuple(float(v) for v in row.split()) for row in rows[:count]]
            rows = rows[count:]
            out[name] = np.array(table, np.dtype(fields)) if count else np.zeros(0, np.dtype(fields))
    check(not (body if binary else [r for r in rows if r]), path + ": more than the header says")
    return out
