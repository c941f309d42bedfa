#!/usr/bin/env python3
"""Our triangulation and that of other programs on the same points in one run: prints a table with ratios, writes JSON.

Runs bench_triangulation (ours, OpenCV, OpenGV), which also writes the points, then the numpy methods of methods.py on them.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[variable] = "1"  # one thread, as ours in the same table
try:
    import numpy as np
except ImportError:
    print("this interpreter has no numpy: use /usr/bin/python3 with python3-numpy", file=sys.stderr)
    sys.exit(3)

import methods


def read_problem(folder, entry):
    views, points = entry["views"], entry["points"]
    numbers = np.fromfile(folder / entry["file"])
    p, x_px, y_px, truth = np.split(numbers, np.cumsum([12 * views, views * points, views * points]))
    px = np.stack([x_px.reshape(views, points).T, y_px.reshape(views, points).T], axis=2)
    return p.reshape(views, 3, 4), px, truth.reshape(points, 3)


def run_peer(entry, name, method, p, px, truth):
    start = time.perf_counter()
    found = method(p, px)
    seconds = time.perf_counter() - start
    error = 1000 * np.linalg.norm(found - truth, axis=1)
    answered = error[np.isfinite(error)]
    return {"problem": entry["problem"], "method": name, "precision": "double", "views": entry["views"], "points": len(px),
            "threads": 1, "points_per_s": len(px) / seconds,
            "rms_error_mm": float(np.sqrt(np.mean(answered**2))) if len(answered) else 0.0,
            "median_error_mm": float(np.median(answered)) if len(answered) else 0.0,
            "refused": 1 - len(answered) / len(px), "peer": name.split(",")[0]}


def run_peers(folder, num_points):
    rows = []
    for entry in json.loads((folder / "problems.json").read_text()):
        p, px, truth = read_problem(folder, entry)
        clean = "wrong" not in entry["problem"]
        many = num_points if clean else max(1, num_points // 10)  # 200 DLTs a point where views are wrong
        rows.append(run_peer(entry, "aniposelib, numpy", methods.aniposelib, p, px[:num_points], truth[:num_points]))
        rows.append(run_peer(entry, "Pose2Sim, numpy", methods.pose2sim, p, px[:many], truth[:many]))
        rows.append(run_peer(entry, "numpy, all points at once", methods.all_at_once, p, px, truth))
    return rows


def ratios(rows):
    """Our rate over each peer's on the same problem, by the method that stands for ours there, and both errors."""
    ours = {row["problem"]: row for row in rows
            if not row["peer"] and row["precision"] == "double" and row["method"] == (
                "robust" if "wrong" in row["problem"] else "linear + 2 Gauss-Newton steps")}
    return [{"problem": row["problem"], "peer": row["method"], "ratio": ours[row["problem"]]["points_per_s"] / row["points_per_s"],
             "our_rms_error_mm": ours[row["problem"]]["rms_error_mm"], "peer_rms_error_mm": row["rms_error_mm"]}
            for row in rows if row["peer"] and row["problem"] in ours]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bench", default="build/release/bin/bench_triangulation", help="the program to run")
    parser.add_argument("--seed", default="1")
    parser.add_argument("--max-points", default="1000000", help="largest number of points of the scaling rows, e.g. 10000000")
    parser.add_argument("--peer-points", type=int, default=2000, help="points for the numpy methods")
    parser.add_argument("--json", help="file for all rows and ratios")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        subprocess.run([args.bench, args.seed, folder / "ours.json", args.max_points, folder], check=True)
        rows = json.loads((folder / "ours.json").read_text())["rows"]
        peers = run_peers(folder, args.peer_points)
    for row in peers:
        print("{problem:28s} {method:30s} {precision:6s} {views:5d} {points:9d} {threads:3d} {points_per_s:13.0f} "
              "{rms_error_mm:10.4f} {median_error_mm:10.4f}".format(**row))
    table = ratios(rows + peers)
    print("\n%-28s %-30s %10s %14s %14s" % ("problem", "peer", "ours/peer", "our rms mm", "peer's rms mm"))
    for line in table:
        print("{problem:28s} {peer:30s} {ratio:10.1f} {our_rms_error_mm:14.4f} {peer_rms_error_mm:14.4f}".format(**line))
    if args.json:
        pathlib.Path(args.json).write_text(json.dumps({"seed": int(args.seed), "rows": rows + peers, "ratios": table}, indent=1) + "\n")


if __name__ == "__main__":
    main()
