#!/usr/bin/env python3
"""How much of a cloth subject's motion beyond skinning the pose explains: a bound for surfaces that move with the pose.

The true vertices of each garment, with the bones taken out, are regressed on the principal components of the bones' turns.
Printed: rms of what is left (mm), on the frames trained on, on thirds of the take left out, and on the new motion after it.

Usage: cloth_by_pose.py SESSION --take-frames N [--every 3]. SESSION is of `mvstudio synth --subject cloth`.
"""

import argparse
import pathlib

import numpy as np


def turns(transforms, parents):
    """(N, 9 (B - 1)) entries of the local rotations less identity."""
    rotations = transforms[..., :3]
    local = [np.swapaxes(rotations[:, p], 1, 2) @ rotations[:, b] - np.eye(3) for b, p in enumerate(parents) if b > 0]
    return np.concatenate([x.reshape(len(transforms), 9) for x in local], 1)


def unposed(truth, rest, transforms, mesh, frame):
    """(3V) what the true vertices lie off rest, with the frame's bones taken out."""
    affine = np.einsum("vb,bij->vij", rest[mesh + "_weights"].astype(float), transforms[frame])
    vertices = np.load(truth / f"vertices_{frame:08d}.npz")[mesh]
    at_rest = np.linalg.solve(affine[:, :, :3], (vertices - affine[:, :, 3])[..., None])[..., 0]
    return (at_rest - rest[mesh + "_v"]).ravel()


def left_over(values, offsets, train, test, components):
    """rms (mm) that a ridge regression on `components` principal components leaves."""
    mean = values[train].mean(0)
    _, deviations, axes = np.linalg.svd(values[train] - mean, full_matrices=False)
    scale = np.maximum(deviations[:components] / np.sqrt(len(train)), 0.05)
    project = lambda rows: np.c_[(values[rows] - mean) @ (axes[:components].T / scale), np.ones(len(rows))]
    x = project(train)
    ridge = np.diag([0.01 * len(train)] * components + [0])
    weights = np.linalg.solve(x.T @ x + ridge, x.T @ offsets[train])
    error = offsets[test] - project(test) @ weights
    return 1e3 * np.sqrt(3 * np.mean(error**2))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("session", type=pathlib.Path)
    parser.add_argument("--take-frames", type=int, required=True)
    parser.add_argument("--every", type=int, default=3)
    args = parser.parse_args()
    truth = args.session / "truth"
    rest, motion = np.load(truth / "subject_rest.npz"), np.load(truth / "motion.npz")
    transforms = motion["transforms"]
    frames = np.arange(0, len(transforms), args.every)
    train, new = np.flatnonzero(frames < args.take_frames), np.flatnonzero(frames >= args.take_frames)
    values = turns(transforms, motion["parent"])[frames]
    print("garment  components  trained on  left out               new motion")
    for mesh in ("skirt", "shirt"):
        offsets = np.array([unposed(truth, rest, transforms, mesh, frame) for frame in frames])
        for components in (0, 1, 3, 6, 12):
            score = lambda a, b: left_over(values, offsets, a, b, components)
            blocks = " ".join(f"{score(np.setdiff1d(train, b), b):6.1f}" for b in np.array_split(train, 3))
            last = f"{score(train, new):11.1f}" if len(new) else ""
            print(f"{mesh:8}{components:11}{score(train, train):12.1f}  {blocks}{last}", flush=True)


if __name__ == "__main__":
    main()
