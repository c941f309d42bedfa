#!/usr/bin/python3
"""A fitted body beside the truth of a rendered person: joints and twist of limbs. `mvstudio avatar surface` measures its surface.

truth.py DATASET BODY.npz... : DATASET as `person_a`, `turn_a` and sessions of `mvstudio synth` (truth/motion.npz), bodies as `mvstudio
avatar fit` writes them. Prints one row a body:

- joints: distance of the fitted skeleton's joints from the true ones (shoulders, elbows, wrists, hips, knees, ankles), mm
- twist, swing: rotation of upper arms, forearms, thighs and shins against the truth about the bone and across it, median, degrees.
  The rest poses of the two skeletons differ: the constant rotation between them is taken out of each bone.

Needs numpy and scipy.
"""
import os
import sys

import numpy as np
from scipy.spatial.transform import Rotation

JOINTS = {3: "LeftArm", 4: "LeftForeArm", 5: "LeftHand", 6: "LeftUpLeg", 7: "LeftLeg", 8: "LeftFoot", 9: "RightArm", 10: "RightForeArm",
          11: "RightHand", 12: "RightUpLeg", 13: "RightLeg", 14: "RightFoot"}  # of Panoptic's 19: the true bone whose head it is
LIMBS = {7: "LeftArm", 8: "LeftForeArm", 10: "LeftUpLeg", 11: "LeftLeg", 14: "RightArm", 15: "RightForeArm", 17: "RightUpLeg",
         18: "RightLeg"}  # role of a fitted bone: the true bone
ROLES = {3: 7, 4: 8, 5: 9, 6: 10, 7: 11, 8: 12, 9: 14, 10: 15, 11: 16, 12: 17, 13: 18, 14: 19}  # the same as roles, where they are known


class Truth:
    def __init__(self, folder):
        motion = np.load(os.path.join(folder, "truth", "motion.npz"))
        self.bones = [str(name) for name in motion["bones"]]
        if "roles" in motion:
            roles = [int(role) for role in motion["roles"]]
            for joint, name in JOINTS.items():
                self.bones[roles.index(ROLES[joint])] = name
        self.transforms, self.rest_head = motion["transforms"].astype(float), motion["rest_head"].astype(float)

    def head(self, frame, name):
        b = self.bones.index(name)
        return self.transforms[frame, b, :, :3] @ self.rest_head[b] + self.transforms[frame, b, :, 3]


class Body:
    def __init__(self, path):
        arrays = np.load(path)
        self.parents, self.heads, self.tails = arrays["bone_parents"], arrays["bone_heads"], arrays["bone_tails"]
        self.roles = [int(role) for role in arrays["bone_roles"]]
        self.coco19, self.coco19_bone = arrays["coco19"], arrays["coco19_bone"]
        poses = arrays["extra.poses"]
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

    def joints(self, frame):
        turns, moves = self.transforms(frame)
        return np.einsum("jab,jb->ja", turns[self.coco19_bone], self.coco19) + moves[self.coco19_bone]


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
    frames = [f for f in sorted(body.poses) if f < len(truth.transforms)]
    joints = [np.linalg.norm(body.joints(f)[list(JOINTS)] - np.array([axes @ truth.head(f, n) for n in JOINTS.values()]), axis=1)
              for f in frames]
    twist, swing = limb_errors(truth, body, axes, frames)
    print(f"| {os.path.basename(os.path.dirname(os.path.abspath(path)))} | {1e3 * np.median(joints):.1f} | {twist:.1f} | {swing:.1f} | "
          f"{len(frames)} |", flush=True)


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    truth = Truth(sys.argv[1])
    print("| body | joints, mm | twist, degrees | swing | poses |\n|---|---|---|---|---|")
    for path in sys.argv[2:]:
        measure(truth, path)


if __name__ == "__main__":
    main()
