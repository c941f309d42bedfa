"""Numbers of results, for the checks of cases.py: each returns (what it is, a function of the place of {T}, least, most)."""
import json
import math
import pathlib
import struct
import zlib


def _at(value, path):
    for key in path.split("."):
        value = len(value) if key == "#" else value[int(key)] if isinstance(value, list) else value[key]
    return value


def metric(folder, path, least, most):
    """A number of the result's metrics; `#` counts a list."""
    def value(place):
        result = next(pathlib.Path(place(folder)).glob("*.result.json"))
        return _at(json.loads(result.read_text())["metrics"], path)
    return (path, value, least, most)


def _cameras(folder):
    document = json.loads((pathlib.Path(folder) / "calibration.json").read_text())
    return {camera["name"]: camera for camera in document["cameras"]}, {"m": 1000, "cm": 10, "mm": 1}[document["unit"]]


def focal(folder, name, least, most):
    return (f"fx of {name}, px", lambda place: _cameras(place(folder))[0][name]["intrinsics"]["fx"], least, most)


def _centre(camera):
    """-R^T t of a unit quaternion x, y, z, w: t turned by its conjugate."""
    x, y, z, w = camera["cam_from_world"]["rotation_xyzw"]
    t = camera["cam_from_world"]["translation"]
    q = (-x, -y, -z)
    cross = lambda a, b: (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    c = [2 * v for v in cross(q, t)]
    d = cross(q, c)
    return [-(t[i] + w * c[i] + d[i]) for i in range(3)]


def distance(folder, a, b, least, most):
    def value(place):
        cameras, mm = _cameras(place(folder))
        return mm * math.dist(_centre(cameras[a]), _centre(cameras[b]))
    return (f"distance of {a} and {b}, mm", value, least, most)


def _alpha(path):
    """The alpha channel of an 8-bit RGBA PNG, undoing the five filters of the PNG standard (ISO/IEC 15948, 9.2)."""
    data = path.read_bytes()
    width, height, depth, kind = struct.unpack(">IIBB", data[16:26])
    if (depth, kind) != (8, 6):
        raise AssertionError(f"{path}: {depth} bits, colour type {kind}, not RGBA")
    at, packed = 8, b""
    while at < len(data):
        size, tag = struct.unpack(">I4s", data[at:at + 8])
        packed += data[at + 8:at + 8 + size] if tag == b"IDAT" else b""
        at += size + 12
    raw, before, alpha = zlib.decompress(packed), bytes(4 * width), []
    for row in range(height):
        line = bytearray(raw[row * (4 * width + 1) + 1:(row + 1) * (4 * width + 1)])
        _unfilter(raw[row * (4 * width + 1)], line, before)
        alpha += line[3::4]
        before = line
    return alpha


def _paeth(a, b, c):
    p = a + b - c
    return min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]


def _unfilter(kind, line, above):
    for i in range(len(line)):
        a, b, c = (line[i - 4] if i > 3 else 0), above[i], (above[i - 4] if i > 3 else 0)
        line[i] = (line[i] + (0, a, b, (a + b) // 2, _paeth(a, b, c))[kind]) & 255


def opaque(folder, least, most):
    """The opaque part of all RGBA images below a folder."""
    def value(place):
        alphas = [a for path in sorted(pathlib.Path(place(folder)).rglob("*.png")) for a in _alpha(path)]
        return sum(alphas) / 255 / len(alphas)
    return ("opaque part", value, least, most)
