"""BVH: the hierarchy played back."""

import numpy as np

from exports.common import JOINTS, check, rodrigues
from exports.joint_files import people_files, truth_of


def read_bvh(folder, compare):
    worst, squares, count = 0.0, 0.0, 0
    for person, path in people_files(folder, ".bvh", compare):
        words = open(path).read().split()
        nodes, stack, i = [], [], 1
        check(words[0] == "HIERARCHY", "HIERARCHY")
        while words[i] != "MOTION":
            if words[i] in ("ROOT", "JOINT"):
                nodes.append({"name": words[i + 1], "parent": stack[-1] if stack else None})
                stack.append(len(nodes) - 1)
                i += 3
            elif words[i] == "End":
                stack.append(None)
                i += 3
            elif words[i] == "OFFSET":
                if stack[-1] is not None:
                    nodes[stack[-1]]["offset"] = np.array(words[i + 1:i + 4], float)
                i += 4
            elif words[i] == "CHANNELS":
                nodes[stack[-1]]["channels"] = words[i + 2:i + 2 + int(words[i + 1])]
                i += 2 + int(words[i + 1])
            else:
                check(words[i] == "}", "brace")
                stack.pop()
                i += 1
        check(sorted(n["name"] for n in nodes) == sorted(JOINTS), "joints")
        frames, values = int(words[i + 2]), np.array(words[i + 6:], float)
        values = values.reshape(frames, -1)
        check(values.shape[1] == sum(len(n["channels"]) for n in nodes), "channels")
        for t in range(frames):
            at, place, turn = 0, {}, {}
            for n, node in enumerate(nodes):
                R, shift = np.eye(3), node["offset"].copy()
                for channel in node["channels"]:
                    v = values[t, at]
                    at += 1
                    if channel.endswith("position"):
                        shift["XYZ".index(channel[0])] += v
                    else:
                        R = R @ rodrigues(np.radians(v) * np.eye(3)["XYZ".index(channel[0])])
                parent = node["parent"]
                place[n] = shift if parent is None else place[parent] + turn[parent] @ shift
                turn[n] = R if parent is None else turn[parent] @ R
            truth = truth_of(compare, compare.manifest["frames"][0] + t, person)
            for n, node in enumerate(nodes):
                x, y, z = place[n] / 100
                if truth is not None and not np.isnan(truth[0][JOINTS.index(node["name"]), 0]):
                    e = float(np.linalg.norm([x, -z, y] - truth[0][JOINTS.index(node["name"])]))  # y up to z up
                    worst, squares, count = max(worst, e), squares + e * e, count + 1
    return {"bvh_rms_mm": 1000 * np.sqrt(squares / max(count, 1)), "bvh_max_mm": 1000 * worst}
