"""glTF 2.0, binary: the rules of the specification that concern us, then cameras and joints."""

import glob
import json
import re
import struct

import numpy as np

from exports.common import Camera, JOINTS, check, quaternion_matrix


COMPONENTS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def gltf_accessors(doc, binary):
    """Arrays of all accessors; bounds, alignment and min/max are checked as the specification asks."""
    check(doc["asset"]["version"] == "2.0", "version")
    total = doc["buffers"][0]["byteLength"] if "buffers" in doc else 0
    check(total <= len(binary) < total + 4, "buffer length")
    arrays = []
    for a in doc.get("accessors", []):
        view = doc["bufferViews"][a["bufferView"]]
        kind = {5126: "<f4", 5123: "<u2"}[a["componentType"]]
        size = a["count"] * COMPONENTS[a["type"]] * np.dtype(kind).itemsize
        start = view["byteOffset"] + a.get("byteOffset", 0)
        check(start % np.dtype(kind).itemsize == 0, "alignment")
        check(size + a.get("byteOffset", 0) <= view["byteLength"] and view["byteOffset"] + view["byteLength"] <= total, "bounds")
        array = np.frombuffer(binary, kind, a["count"] * COMPONENTS[a["type"]], start).reshape(a["count"], -1)
        check(np.isfinite(array).all(), "not finite")
        if "min" in a:
            check(np.allclose(array.min(0), a["min"], 0, 0) and np.allclose(array.max(0), a["max"], 0, 0), "min, max")
        arrays.append(array)
    return arrays


def gltf_structure(doc, arrays):
    nodes = doc["nodes"]
    parents = [0] * len(nodes)
    for node in nodes:
        for child in node.get("children", []):
            parents[child] += 1
        if "mesh" in node:
            check(node["mesh"] < len(doc["meshes"]), "mesh")
        if "rotation" in node:
            check(abs(np.linalg.norm(node["rotation"]) - 1) < 1e-5, "rotation of unit length")
    check(all(p <= 1 for p in parents) and all(parents[r] == 0 for r in doc["scenes"][doc["scene"]]["nodes"]), "tree")
    for mesh in doc["meshes"]:
        for p in mesh["primitives"]:
            positions, indices = arrays[p["attributes"]["POSITION"]], arrays[p["indices"]]
            check("min" in doc["accessors"][p["attributes"]["POSITION"]], "POSITION without min")
            check(indices.max() < len(positions) and len(indices) % (2 if p.get("mode") == 1 else 3) == 0, "indices")
    for animation in doc.get("animations", []):
        targets = set()
        for c in animation["channels"]:
            s = animation["samplers"][c["sampler"]]
            times, values = arrays[s["input"]], arrays[s["output"]]
            key = (c["target"]["node"], c["target"]["path"])
            check(key not in targets and "matrix" not in nodes[key[0]], "target twice, or of a node with a matrix")
            targets.add(key)
            check(len(times) == len(values) and np.all(np.diff(times[:, 0]) > 0) and times[0] >= 0, "times")
            if key[1] == "rotation":
                check(np.abs(np.linalg.norm(values, axis=1) - 1).max() < 1e-5, "rotation keys")


def local_matrix(node):
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    m = np.eye(4)
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    m[:3, :3] = quaternion_matrix(w, x, y, z) * np.array(node.get("scale", [1, 1, 1]))
    m[:3, 3] = node.get("translation", [0, 0, 0])
    return m


def read_gltf(folder, compare):
    path, = glob.glob(folder + "/*.glb")
    data = open(path, "rb").read()
    magic, version, length, json_length, json_kind = struct.unpack_from("<4sIII4s", data)
    check((magic, version, length, json_kind) == (b"glTF", 2, len(data), b"JSON") and json_length % 4 == 0, "header")
    doc = json.loads(data[20:20 + json_length])
    binary_length, binary_kind = struct.unpack_from("<I4s", data, 20 + json_length)
    check(binary_kind == b"BIN\0" and 28 + json_length + binary_length == len(data), "chunks")
    arrays = gltf_accessors(doc, data[28 + json_length:])
    gltf_structure(doc, arrays)
    world = {}

    def descend(index, above):
        world[index] = above @ local_matrix(doc["nodes"][index])
        for child in doc["nodes"][index].get("children", []):
            descend(child, world[index])

    for root in doc["scenes"][doc["scene"]]["nodes"]:
        descend(root, np.eye(4))
    z_up = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])  # from the viewer's y up
    for index, node in enumerate(doc["nodes"]):
        if "camera" not in node:
            continue
        c2w = z_up @ world[index] @ np.diag([1, -1, -1, 1])
        R, x = c2w[:3, :3].T, node["extras"]
        p = x["lens_params"]
        camera = Camera([[p[0], 0, p[2]], [0, p[1], p[3]], [0, 0, 1]], (p[4:] + [0] * 5)[:5], R, -R @ c2w[:3, 3])
        compare.camera(node["name"], camera, compare.manifest["frames"])
        lens = doc["cameras"][node["camera"]]["perspective"]
        check(abs(np.tan(lens["yfov"] / 2) - x["height_px"] / 2 / p[1]) < 1e-12, "yfov")
        check(abs(np.tan(lens["yfov"] / 2) * lens["aspectRatio"] - x["width_px"] / 2 / p[0]) < 1e-12, "aspectRatio")
    tracks = {}
    for animation in doc.get("animations", []):
        for c in animation["channels"]:
            tracks[c["target"]["node"], c["target"]["path"]] = arrays[animation["samplers"][c["sampler"]]["output"]]
    parents = {child: i for i, node in enumerate(doc["nodes"]) for child in node.get("children", [])}
    frames = compare.manifest["frames"]
    joints = {}
    for index, node in enumerate(doc["nodes"]):
        match = re.match(r"person(\d+) (\w+)$", node.get("name", ""))
        if match and (index, "translation") in tracks:
            above = z_up @ world[parents[index]]
            X = tracks[index, "translation"].astype(float) @ above[:3, :3].T + above[:3, 3]
            X[tracks[index, "scale"][:, 0] == 0] = np.nan
            joints.setdefault(int(match.group(1)), {})[match.group(2)] = X
    for person, named in joints.items():
        for t, frame in enumerate(frames):
            X = np.stack([named[j][t] for j in JOINTS])
            if person in compare.dataset.frames[frame]:
                keep = compare.max_px
                compare.joint_set(frame, person, X, 1e-6)  # single precision about the people's middle
                compare.max_px = keep
    return {"nodes": len(doc["nodes"]), "animated": len(tracks)}
