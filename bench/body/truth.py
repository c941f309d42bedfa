#!/usr/bin/python3
"""A fitted body beside the truth of a rendered person: surface, joints, twist of limbs.

truth.py DATASET BODY.npz... : DATASET as `person_a` and `turn_a` (truth/subject_rest.npz, motion.npz, vertices_*.npz), bodies as `mvstudio
avatar fit` writes them. Prints one row a body:

- to truth: distance of the fitted vertices from the true dressed surface, mean and 95 % quantile, mm; over every third frame of
  vertices_*.npz that the body has a pose of
- z: rms of the former over rms of the standard deviations that the fit gives its surface; clothes have details that no silhouette shows
- from truth: distance of points of the true surface that can be seen from outside, from the fitted one, mm
- joints: distance of the fitted skeleton's joints from the true ones (shoulders, elbows, wrists, hips, knees, ankles), mm
- twist, swing: rotation of upper arms, forearms, thighs and shins against the truth about the bone and across it, median, degrees.
  The rest poses of the two skeletons differ: the constant rotation between them is taken out of each bone.

Needs numpy and scipy.
"""
import glob
import os
import sys

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

JOINTS = {3: "LeftArm", 4: "LeftForeArm", 5: "LeftHand", 6: "LeftUpLeg", 7: "LeftLeg", 8: "LeftFoot", 9: "RightArm", 10: "RightForeArm",
          11: "RightHand", 12: "RightUpLeg", 13: "RightLeg", 14: "RightFoot"}  # of Panoptic's 19: the true bone whose head it is
LIMBS = {7: "LeftArm", 8: "LeftForeArm", 10: "LeftUpLeg", 11: "LeftLeg", 14: "RightArm", 15: "RightForeArm", 17: "RightUpLeg",
         18: "RightLeg"}  # role of a fitted bone: the true bone


class Truth:
    def __init__(self, folder):
        self.rest = np.load(os.path.join(folder, "truth", "subject_rest.npz"))
        motion = np.load(os.path.join(folder, "truth", "motion.npz"))
        self.bones = [str(name) for name in motion["bones"]]
        self.transforms, self.rest_head = motion["transforms"].astype(float), motion["rest_head"].astype(float)
        self.vertices = {int(path[-12:-4]): np.load(path) for path in sorted(glob.glob(os.path.join(folder, "truth", "vertices_*.npz")))}

    def head(self, frame, name):
        b = self.bones.index(name)
        return self.transforms[frame, b, :, :3] @ self.rest_head[b] + self.transforms[frame, b, :, 3]

    def surface(self, frame):
        """Points on all faces, 4 to 10 mm apart."""
        points = []
        for mesh in ("skin", "suit", "shoes", "hair"):
            vertices = self.vertices[frame][mesh].astype(float)
            sizes, corners = self.rest[mesh + "_face_size"], self.rest[mesh + "_face_v"]
            starts = np.concatenate([[0], np.cumsum(sizes.astype(int))[:-1]]).astype(int)
            quads = np.array([corners[s:s + 4] if n == 4 else np.append(corners[s:s + 3], corners[s]) for s, n in zip(starts, sizes)])
            points.append(sampled(vertices[quads]))
        return np.vstack(points)


def sampled(quads):
    """(F, 4, 3) corners: 4 x 4 points on each."""
    grid = [(i + 0.5) / 4 for i in range(4)]
    return np.vstack([(1 - s) * ((1 - t) * quads[:, 0] + t * quads[:, 1]) + s * ((1 - t) * quads[:, 3] + t * quads[:, 2])
                      for s in grid for t in grid])


class Body:
    def __init__(self, path):
        arrays = np.load(path)
        self.vertices, self.faces = arrays["vertices"].astype(float), arrays["faces"]
        self.parents, self.heads, self.tails = arrays["bone_parents"], arrays["bone_heads"], arrays["bone_tails"]
        self.roles = [int(role) for role in arrays["bone_roles"]]
        self.skin_bones, self.skin_weights = arrays["skin_bones"], arrays["skin_weights"].astype(float)
        self.coco19, self.coco19_bone = arrays["coco19"], arrays["coco19_bone"]
        poses = arrays["extra.poses"]
        self.sigma = arrays["extra.offset_sigma_m"][:, 0] if "extra.offset_sigma_m" in arrays else None
        self.poses = {int(row[0]): (row[1:4], row[4:].reshape(-1, 4)) for row in poses}

    def transforms(self, frame):
        """Rotation and translation of each bone, world from rest."""
        shift, quaternions = self.poses[frame]
        local = Rotation.from_quat(quaternions).as_matrix()
        turns, moves = [], []
        for b, parent in enumerate(self.parents):
            turn = local[b] if parent < 0 else turns[parent] @ local[b]
            head = self.heads[b] + shift if parent < 0 else turns[parent] @ self.heads[b] + moves[parent]
            turns.append(turn)
            moves.append(head - turn @ self.heads[b])
        return np.array(turns), np.array(moves)

    def posed(self, frame):
        turns, moves = self.transforms(frame)
        moved = np.einsum("vkij,vj->vki", turns[self.skin_bones], self.vertices) + moves[self.skin_bones]
        return np.einsum("vk,vki->vi", self.skin_weights, moved)

    def joints(self, frame):
        turns, moves = self.transforms(frame)
        return np.einsum("jab,jb->ja", turns[self.coco19_bone], self.coco19) + moves[self.coco19_bone]


def outside(points, vertices):
    """Which points are the first that is met along one of 64 directions: what clothes hide is not judged."""
    seen = np.zeros(len(points), bool)
    middle = vertices.mean(axis=0)
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(64, 3))
    for direction in directions / np.linalg.norm(directions, axis=1)[:, None]:
        side = np.linalg.svd(np.eye(3) - np.outer(direction, direction))[0][:, :2]
        cell = np.round((points - middle) @ side / 0.006).astype(int)
        depth = points @ direction
        order = np.argsort(-depth)
        first = np.unique((cell[:, 0] * 100003 + cell[:, 1])[order], return_index=True)[1]
        seen[order[first]] = True
    return seen


def constant_between(a, b):
    """The rotation C that brings a C closest to b (N, 3, 3)."""
    u, _, vt = np.linalg.svd(np.einsum("nki,nkj->ij", a, b))
    return u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt


def limb_errors(truth, body, axes, frames):
    twists, swings = [], []
    fitted = {frame: body.transforms(frame)[0] for frame in frames}
    for role, name in LIMBS.items():
        if role not in body.roles:
            continue
        b, t = body.roles.index(role), truth.bones.index(name)
        found = np.array([fitted[frame][b] for frame in frames])
        true = np.array([axes @ truth.transforms[frame, t, :, :3] for frame in frames])
        error = np.einsum("nij,nkj->nik", found, true @ constant_between(true, found))
        vector = Rotation.from_matrix(error).as_rotvec()
        along = found @ ((body.tails[b] - body.heads[b]) / np.linalg.norm(body.tails[b] - body.heads[b]))
        twist = np.einsum("ni,ni->n", vector, along)
        twists.append(np.abs(twist))
        swings.append(np.linalg.norm(vector - twist[:, None] * along, axis=1))
    return np.degrees(np.median(np.concatenate(twists))), np.degrees(np.median(np.concatenate(swings)))


def axes_of(truth, body):
    """World of the dataset from that of the truth: y down, or z up."""
    frame = sorted(body.poses)[0]
    true = np.array([truth.head(frame, name) for name in JOINTS.values()])
    found = body.joints(frame)[list(JOINTS)]
    choices = [np.eye(3), np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])]
    return min(choices, key=lambda axes: np.linalg.norm(true @ axes.T - found))


def measure(truth, path):
    body = Body(path)
    axes = axes_of(truth, body)
    to_truth, from_truth = [], []
    for frame in sorted(set(truth.vertices) & set(body.poses))[::3]:
        points = truth.surface(frame) @ axes.T
        vertices = body.posed(frame)
        faces = vertices[body.faces]
        mine = sampled(np.concatenate([faces, faces[:, 2:3]], axis=1))
        points = points[outside(points, vertices)]
        to_truth.append(cKDTree(points).query(vertices)[0])
        from_truth.append(cKDTree(mine).query(points)[0])
    frames = sorted(body.poses)
    joints = [np.linalg.norm(body.joints(f)[list(JOINTS)] - np.array([axes @ truth.head(f, n) for n in JOINTS.values()]), axis=1)
              for f in frames]
    twist, swing = limb_errors(truth, body, axes, frames)
    to_truth, from_truth = 1e3 * np.concatenate(to_truth), 1e3 * np.concatenate(from_truth)
    z = "" if body.sigma is None else f"{np.sqrt(np.mean(to_truth ** 2) / np.mean((1e3 * body.sigma) ** 2)):.1f}"
    print(f"| {os.path.basename(os.path.dirname(os.path.abspath(path)))} | {to_truth.mean():.1f} | {np.quantile(to_truth, 0.95):.1f} | {z} | "
          f"{from_truth.mean():.1f} | {np.quantile(from_truth, 0.95):.1f} | {1e3 * np.median(joints):.1f} | {twist:.1f} | {swing:.1f} | "
          f"{len(frames)} |", flush=True)


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    truth = Truth(sys.argv[1])
    print("| body | to truth, mm | 95 % | z | from truth, mm | 95 % | joints, mm | twist, degrees | swing | poses |\n|---|---|---|---|---|---|---|---|---|---|")
    for path in sys.argv[2:]:
        measure(truth, path)


if __name__ == "__main__":
    main()
