"""A rig by OpenCV: calibrateCamera for each camera, stereoCalibrate with these lenses from camera to camera along the pairs that
share most boards. Judged as `mvstudio calibrate --holdout every:4` judges: every fourth time step takes no part; there the board's
pose comes from every second corner of all cameras, and the error is that of the others, RMS in px.
"""
import collections
import os
import pathlib
import re
import resource
import subprocess
import time

import numpy as np

NAME = "OpenCV, calibrateCamera and stereoCalibrate"
EVERY = 4


def program():
    """mvstudio: that which called this, or MVSTUDIO_BIN."""
    parent = os.readlink(f"/proc/{os.getppid()}/exe")
    return os.environ.get("MVSTUDIO_BIN") or (parent if "mvstudio" in os.path.basename(parent) else "mvstudio")


def corners_of(arguments):
    """{(camera, frame): {corner: px}}, sizes by camera, points of the board (corners, 3) in metres."""
    path = pathlib.Path(arguments["out"]) / "corners.csv"
    subprocess.run([program(), "calibrate", "--session", arguments["session"], "--out", path.with_suffix(""), "--cache", "off",
                    "--save-corners", path], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    views, sizes, board = collections.defaultdict(dict), {}, None
    for line in path.read_text().splitlines():
        words = line.split()
        if line.startswith("# camera "):
            sizes[words[3]] = tuple(map(int, words[2].split("x")))
        elif line.startswith("# board "):
            board = board_points(words[3])
        elif not line.startswith("#") and not line.startswith("camera,"):
            camera, frame, _, corner, x, y = line.split(",")[:6]
            views[camera, int(frame)][int(corner)] = (float(x), float(y))
    return views, sizes, board


def board_points(text):
    kind, columns, rows, length, unit = re.match(r"(charuco|chessboard):(\d+)x(\d+):([\d.]+)(mm|cm|m)", text).groups()
    less = 1 if kind == "charuco" else 0  # its numbers count squares
    columns, rows = int(columns) - less, int(rows) - less
    grid = [(c, r, 0) for r in range(rows) for c in range(columns)]
    return np.array(grid, np.float32) * float(length) * {"mm": 1e-3, "cm": 1e-2, "m": 1}[unit]


def calibrate(cv2, views, sizes, board):
    """{camera: (k, d, r, t)}, cam_from_world; of the cameras that hang together."""
    lenses, frames = {}, {}
    for camera, size in sizes.items():
        frames[camera] = [f for (c, f) in sorted(views) if c == camera and f % EVERY != EVERY - 1 and len(views[c, f]) >= 8]
        numbers = [sorted(views[camera, f]) for f in frames[camera]]
        pixels = [np.array([views[camera, f][i] for i in some], np.float32) for f, some in zip(frames[camera], numbers)]
        _, k, d, _, _ = cv2.calibrateCamera([board[some] for some in numbers], pixels, size, None, None)
        lenses[camera] = k, d
    rig = {next(iter(sizes)): (np.eye(3), np.zeros(3))}
    while len(rig) < len(sizes):
        shared = {(a, b): [(f, sorted(set(views[a, f]) & set(views[b, f]))) for f in frames[a] if f in frames[b]]
                  for a in rig for b in sizes if b not in rig}
        shared = {pair: [(f, some) for f, some in steps if len(some) >= 8] for pair, steps in shared.items()}
        (a, b), steps = max(shared.items(), key=lambda entry: len(entry[1]))
        if not steps:
            raise ValueError("some cameras share no board with the others")
        pixels = [[np.array([views[c, f][i] for i in some], np.float32) for f, some in steps] for c in (a, b)]
        r, t = cv2.stereoCalibrate([board[some] for _, some in steps], *pixels, *lenses[a], *lenses[b], sizes[a],
                                   flags=cv2.CALIB_FIX_INTRINSIC)[5:7]
        rig[b] = r @ rig[a][0], r @ rig[a][1] + t.ravel()
    return {camera: (*lenses[camera], *rig[camera]) for camera in sizes}


def judge(cv2, least_squares, rig, views, board):
    def residuals(pose, seen):
        turn = cv2.Rodrigues(pose[:3])[0]
        out = []
        for camera, numbers, px in seen:
            k, d, r, t = rig[camera]
            points = board[numbers] @ turn.T + pose[3:]
            out.append(cv2.projectPoints(points, cv2.Rodrigues(r)[0], t, k, d)[0].reshape(-1, 2) - px)
        return np.concatenate(out)

    squares = []
    for frame in sorted({f for _, f in views if f % EVERY == EVERY - 1}):
        seen = [(c, sorted(views[c, f]), np.array([views[c, f][i] for i in sorted(views[c, f])]))
                for (c, f) in sorted(views) if f == frame and c in rig and len(views[c, f]) >= 8]
        if not seen:
            continue
        camera, numbers, px = max(seen, key=lambda one: len(one[1]))
        k, d, r, t = rig[camera]
        _, turn, shift = cv2.solvePnP(board[numbers], px, k, d)
        start = np.concatenate([cv2.Rodrigues(r.T @ cv2.Rodrigues(turn)[0])[0].ravel(), r.T @ (shift.ravel() - t)])
        half = [(c, numbers[::2], px[::2]) for c, numbers, px in seen]
        rest = [(c, numbers[1::2], px[1::2]) for c, numbers, px in seen]
        pose = least_squares(lambda x: residuals(x, half).ravel(), start, loss="soft_l1").x
        found = (residuals(pose, rest) ** 2).sum(1)
        squares.append(found[found <= 25])  # beyond 5 px: counted apart by mvstudio
    return float(np.sqrt(np.concatenate(squares).mean()))


def way(arguments):
    try:
        import cv2
    except ImportError:
        return {"name": NAME, "why_not": "this Python has no cv2 (python3-opencv)"}
    try:
        from scipy.optimize import least_squares
    except ImportError:
        return {"name": NAME, "why_not": "this Python has no scipy (python3-scipy)"}
    cv2.setNumThreads(int(arguments.get("threads", "1")) or 1)
    views, sizes, board = corners_of(arguments)
    begin_s, begin_cpu = time.perf_counter(), time.process_time()
    try:
        rig = calibrate(cv2, views, sizes, board)
    except cv2.error as error:
        return {"name": NAME, "why_not": str(error).splitlines()[0]}
    seconds, cpu = time.perf_counter() - begin_s, time.process_time() - begin_cpu
    return {"name": NAME + " (corners given)", "command": "bench/peers/opencv_rig.py", "seconds": seconds, "processor_seconds": cpu,
            "error": judge(cv2, least_squares, rig, views, board), "peak_rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}
