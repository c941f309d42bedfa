"""Rigid transforms b_from_a as pairs (rotation (3, 3), translation (3,)); see docs/conventions.md."""

import numpy as np


def cross(w):
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def exp(w):
    """Rotation matrix of a rotation vector (rad)."""
    angle = np.linalg.norm(w)
    if angle < 1e-12:
        return np.eye(3) + cross(w)
    k = cross(np.asarray(w) / angle)
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def log(rotation):
    """Rotation vector (rad) of a rotation matrix, up to pi."""
    q = quaternion(rotation)
    sine = np.linalg.norm(q[:3])
    return 2 * q[:3] if sine < 1e-12 else 2 * np.arctan2(sine, q[3]) * q[:3] / sine


def quaternion(r):
    """x, y, z, w with w >= 0."""
    m = np.array([[r[0, 0] - r[1, 1] - r[2, 2], 0, 0, 0],
                  [r[0, 1] + r[1, 0], r[1, 1] - r[0, 0] - r[2, 2], 0, 0],
                  [r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], r[2, 2] - r[0, 0] - r[1, 1], 0],
                  [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], r[0, 0] + r[1, 1] + r[2, 2]]]) / 3
    _, vectors = np.linalg.eigh(m)
    q = vectors[:, -1]
    return q if q[3] >= 0 else -q


def from_quaternion(q):
    x, y, z, w = np.asarray(q, float) / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def compose(c_from_b, b_from_a):
    return c_from_b[0] @ b_from_a[0], c_from_b[0] @ b_from_a[1] + c_from_b[1]


def inverse(b_from_a):
    return b_from_a[0].T, -b_from_a[0].T @ b_from_a[1]


def apply(b_from_a, x_in_a):
    return np.asarray(x_in_a) @ b_from_a[0].T + b_from_a[1]


def look_at(eye, target, roll_rad=0.0, up=(0.0, 0.0, 1.0)):
    """cam_from_world of a camera at `eye` (world, z up) that looks at `target`; its image is upright but for the roll."""
    z = np.asarray(target, float) - eye
    z /= np.linalg.norm(z)
    x = np.cross(z, up)
    x /= np.linalg.norm(x)
    rotation = exp(np.array([0, 0, roll_rad])) @ np.stack([x, np.cross(z, x), z])
    return rotation, -rotation @ np.asarray(eye, float)


def facing(normal, roll_rad):
    """Rotation world_from_board of a board whose z axis (into the board) is -normal: its printed side looks along `normal`."""
    z = -np.asarray(normal, float) / np.linalg.norm(normal)
    helper = np.array([0.0, 0.0, 1.0]) if abs(z[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1) @ exp(np.array([0, 0, roll_rad]))


def blend(a, b, t):
    """Rotation between two rotations."""
    return a @ exp(t * log(a.T @ b))
