"""Dynamic 3D Gaussians: train_meta.json, seg, init_pt_cld.npz."""

import json
import struct
import zlib

import numpy as np

from exports.common import Camera, check, need_file


def read_png_grey(path):
    """8-bit grey, not interlaced."""
    data, at, body = open(path, "rb").read(), 8, b""
    while at < len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        if kind == b"IHDR":
            w, h, depth, colour, _, _, interlace = struct.unpack_from(">IIBBBBB", data, at + 8)
            check((depth, colour, interlace) in ((8, 0, 0), (1, 0, 0)), path + ": not a grey picture")
        elif kind == b"IDAT":
            body += data[at + 8:at + 8 + length]
        at += 12 + length
    raw = zlib.decompress(body)
    stride = (w * depth + 7) // 8
    rows, previous = [], np.zeros(stride, int)
    for y in range(h):
        filt = raw[y * (stride + 1)]
        line = np.frombuffer(raw, np.uint8, stride, y * (stride + 1) + 1).astype(int)
        if filt == 2:
            line = (line + previous) & 255
        elif filt:
            out = np.zeros(stride, int)
            for x in range(stride):
                left, up, corner = (out[x - 1] if x else 0), previous[x], (previous[x - 1] if x else 0)
                p = left + up - corner
                paeth = min((abs(p - left), 0, left), (abs(p - up), 1, up), (abs(p - corner), 2, corner))[2]
                out[x] = (line[x] + {1: left, 3: (left + up) // 2, 4: paeth}[filt]) & 255
            line = out
        rows.append(line)
        previous = line
    image = np.array(rows, np.uint8)
    return np.unpackbits(image, axis=1)[:, :w] if depth == 1 else image


def read_dynamic3dgs(folder, compare):
    frames, values = compare.manifest["frames"], set()
    train = json.load(open(folder + "/train_meta.json"))
    test = json.load(open(folder + "/test_meta.json"))
    check(len(train["fn"]) == len(frames), "frames")
    for meta in (train, test):
        w, h = meta["w"], meta["h"]
        for t, frame in enumerate(frames):
            for k, w2c, fn in zip(meta["k"][t], meta["w2c"][t], meta["fn"][t]):
                k, w2c = np.array(k), np.array(w2c)

                def project(X):
                    """setup_camera's matrix and the rasteriser's ndc2Pix."""
                    x = X @ w2c[:3, :3].T + w2c[:3, 3]
                    ndc_x = 2 * k[0, 0] / w * x[:, 0] / x[:, 2] - (w - 2 * k[0, 2]) / w
                    ndc_y = 2 * k[1, 1] / h * x[:, 1] / x[:, 2] - (h - 2 * k[1, 2]) / h
                    return np.stack([((ndc_x + 1) * w - 1) / 2, ((ndc_y + 1) * h - 1) / 2], 1)

                K = k - [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
                compare.camera(fn.split("/")[0], Camera(K, np.zeros(5), w2c[:3, :3], w2c[:3, 3]), [frame], project)
                if compare.manifest["pictures"]:
                    need_file(folder + "/ims/" + fn)
                seg = folder + "/seg/" + fn.replace(".jpg", ".png")
                if compare.manifest["masks"] and need_file(seg) and t == 0:
                    image = read_png_grey(seg)
                    check(image.shape == (h, w), seg + ": size")
                    values |= set(np.unique(image).tolist())
    check(values <= {0, 1}, "seg holds %s, its reader wants 0 and 1" % sorted(values))
    names = [{f.split("/")[0] for t in meta["fn"] for f in t} for meta in (train, test)]
    check(not names[0] & names[1], "train and test share cameras")
    points = np.load(folder + "/init_pt_cld.npz")["data"]
    check(points.ndim == 2 and points.shape[1] == 7, "init_pt_cld")
    if len(points):
        check(points[:, 3:6].min() >= 0 and points[:, 3:6].max() <= 1 and set(points[:, 6]) == {1.0}, "colours, seg")
        joints = np.concatenate([X for X, _ in compare.dataset.frames[frames[0]].values()])
        joints = joints[~np.isnan(joints[:, 0])]
        check(np.abs(points[:, :3].mean(0) - joints.mean(0)).max() < 0.5, "points are not where the people are")
    return {"points": len(points), "train": len(names[0]), "test": len(names[1])}
