#!/usr/bin/env python3
"""A real session of four cameras and one person, from videos to avatars: learned from three cameras, and from one video.

run.py --data POSE2SIM --out FOLDER --pretrained RUN --lift-from DATASET … [--size 96] [--program FILE] [--only STEP,STEP]

Every step is a command that a user would type. A finished step is kept with its result in FOLDER/steps and not done again, so a run that
was interrupted goes on where it stopped. Writes FOLDER/table.md; `mvstudio report FOLDER` shows the pictures.

POSE2SIM holds calibration/ and balancing/ of Pose2Sim's demo session. RUN is a trained avatar of somebody else, the start of the fits to
one video; its picture size must be --size. DATASET holds the poses that lifting learns from (`--lift-from` once each).
"""
import argparse
import json
import os
import subprocess
import sys
import time

CAMERAS = ["cam_01", "cam_02", "cam_03", "cam_04"]
SINGLE = "cam_01"  # the one video
HELD_FRAMES = "80-99"


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--pretrained", required=True)
    parser.add_argument("--lift-from", action="append", required=True)
    parser.add_argument("--size", type=int, default=96, help="px, of the fits to one video and of every score")
    parser.add_argument("--three-size", type=int, default=128, help="px, of the avatar of three cameras")
    parser.add_argument("--steps", type=int, default=600, help="training steps of the avatar of three cameras")
    parser.add_argument("--fit-steps", type=int, default=300, help="of each fit to one video")
    parser.add_argument("--lift-steps", type=int, default=3000)
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--program", default="build/release/bin/mvstudio")
    parser.add_argument("--only", default="", help="steps to do, by name; all unless given")
    return parser.parse_args()


def videos(a, cameras):
    return [word for c in cameras for word in ("--video", f"{c}={a.data}/balancing/videos/{c.replace('_', '')}.mp4")]


def poses(out):
    return [word for c in CAMERAS for word in ("--pose2d", f"{c}={out}/pose2d/{c}")]


def steps(a):
    """(name, words) in order."""
    out, others = a.out, ",".join(c for c in CAMERAS if c != SINGLE)
    rig, size = f"{out}/refined/calibration.json", ["--size", str(a.size)]
    one = ["--train-cameras", SINGLE, "--holdout-cameras", others, "--holdout-frames", HELD_FRAMES]
    fit = size + ["--steps", str(a.fit_steps), "--save-every", "100", "--overwrite"]
    return [
        ("calibration", ["calib", "convert", f"{a.data}/calibration/Calib_qualisys.toml", "--to", "mvstudio", "--out", f"{out}/calibration.json"]),
        ("pose2d", ["pose2d", "--calib", f"{out}/calibration.json", "--backend", "movenet", *videos(a, CAMERAS), "--out", f"{out}/pose2d",
                    "--overwrite"]),
        ("refine", ["calib", "refine", "--from-keypoints", "--calib", f"{out}/calibration.json", "--skeleton", "coco17", *poses(out), "--out",
                    f"{out}/refined"]),
        ("triangulate", ["triangulate", "--calib", rig, "--skeleton", "coco17", *poses(out), "--refine", "--trc",
                         f"{a.data}/balancing/pose-3d/S00_P00_T01_BalancingTrial_0-100.trc", "--out", f"{out}/pose3d"]),
        ("dataset", ["dataset", "build", "--calib", rig, "--pose3d", f"{out}/pose3d", *videos(a, CAMERAS), "--out", f"{out}/dataset",
                     "--overwrite"]),
        ("verify", ["dataset", "verify", f"{out}/dataset"]),
        ("three-train", ["avatar", "train", f"{out}/dataset", "--holdout-cameras", "cam_02", "--holdout-frames", HELD_FRAMES, "--size",
                         str(a.three_size), "--steps", str(a.steps), "--overwrite", "--out", f"{out}/three/avatar"]),
        ("three-eval", ["avatar", "eval", f"{out}/three/avatar", "--score-size", str(a.size)]),
        ("lift-train", ["avatar", "lift", "train", *a.lift_from, "--steps", str(a.lift_steps), "--out", f"{out}/lifter.safetensors"]),
        ("lift-apply", ["avatar", "lift", "apply", f"{out}/pose2d/{SINGLE}", "--skeleton", "coco17", "--lifter", f"{out}/lifter.safetensors",
                        "--calib", rig, "--camera", SINGLE, "--smooth", "3", "--truth", f"{out}/pose3d", "--out", f"{out}/lifted/pose3d"]),
        ("lift-dataset", ["dataset", "build", "--calib", rig, "--pose3d", f"{out}/lifted/pose3d", *videos(a, [SINGLE]), "--out",
                          f"{out}/lifted/dataset", "--overwrite"]),
        ("single-train", ["avatar", "train", f"{out}/dataset", "--init-from", a.pretrained, *one, *fit, "--out", f"{out}/single/avatar"]),
        ("single-eval", ["avatar", "eval", f"{out}/single/avatar"]),
        ("scratch-train", ["avatar", "train", f"{out}/dataset", *one, *fit, "--out", f"{out}/scratch/avatar"]),
        ("scratch-eval", ["avatar", "eval", f"{out}/scratch/avatar"]),
        ("lifted-train", ["avatar", "train", f"{out}/lifted/dataset", "--init-from", a.pretrained, "--holdout-frames", HELD_FRAMES, *fit,
                          "--out", f"{out}/lifted/avatar"]),
        ("lifted-eval", ["avatar", "eval", f"{out}/lifted/avatar", "--dataset", f"{out}/dataset", "--cameras", others]),
    ]


def do(a, name, words):
    """The kept result of a step, or the result of doing it now. Ends the run when a command fails."""
    kept = os.path.join(a.out, "steps", name + ".step.json")
    if os.path.exists(kept):
        with open(kept) as file:
            return json.load(file)
    begin = time.time()
    extra = ["--threads", str(a.threads)] if a.threads else []
    if "--overwrite" not in words and words[:2] != ["dataset", "verify"]:  # of a step that was interrupted
        extra.append("--overwrite")
    run = subprocess.run([a.program, *words, *extra, "--json"], stdout=subprocess.PIPE, text=True)
    if run.returncode not in (0, 6):
        sys.exit(f"{name}: {a.program} {' '.join(words)}\nended with {run.returncode}: {run.stdout.strip()[-2000:]}")
    result = json.loads(run.stdout)
    os.makedirs(os.path.dirname(kept), exist_ok=True)
    with open(kept + ".tmp", "w") as file:
        json.dump(result, file, indent=1)
    os.replace(kept + ".tmp", kept)
    print(f"{name}: {time.time() - begin:.0f} s", flush=True)
    return result


def row(name, score):
    return f"| {name} | {score['ssim']:.3f} | {score['psnr_db']:.1f} | {score['mask_iou']:.3f} |"


def table(results):
    lines = ["| step | seconds |", "|---|---|"]
    lines += [f"| {name} | {r['timing']['wall_s']:.0f} |" for name, r in results.items()]
    lines += ["", "| held-out cameras, frames " + HELD_FRAMES + " | SSIM | PSNR, dB | mask IoU |", "|---|---|---|---|"]
    titles = {"three": "three cameras", "single": "one video, fitted", "scratch": "one video, from scratch", "lifted": "one video, lifted joints"}
    for key, title in titles.items():
        if key + "-eval" not in results:
            continue
        metrics = results[key + "-eval"]["metrics"]
        lines.append(row(title, metrics["holdout"]))
        lines += [row(f"{title}: {c['name']}", c) for c in metrics["per_camera"]]
        lines += [row(f"{title}: baseline {n}", b) for n, b in metrics["baselines"].items()]
    if "lift-apply" in results:
        truth = results["lift-apply"]["metrics"]["truth"]
        lines += ["", "lifted against triangulated, mm: " + ", ".join(f"{k} {v:.1f}" for k, v in truth.items() if k.endswith("_mm"))]
    return "\n".join(lines) + "\n"


def main():
    a = arguments()
    only = set(filter(None, a.only.split(",")))
    unknown = only - {name for name, _ in steps(a)}
    if unknown:
        sys.exit(f"--only: no step is called {', '.join(sorted(unknown))}")
    results = {}
    for name, words in steps(a):
        if not only or name in only or os.path.exists(os.path.join(a.out, "steps", name + ".step.json")):
            results[name] = do(a, name, words)
    with open(os.path.join(a.out, "table.md"), "w") as file:
        file.write(table(results))
    print(table(results))


if __name__ == "__main__":
    main()
