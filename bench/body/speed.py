#!/usr/bin/python3
"""Seconds of `mvstudio avatar fit` against cameras, silhouettes, pixels and vertices, beside held-out IoU: what each buys.

speed.py DATASET --out FOLDER --cameras A,B,C,D,E,F [--templates mannequin,PATH] [--holdout-frames 90-119] [--program FILE]

Changes one thing at a time from all cameras, 540 silhouettes, 512 px and the mannequin. Processor time is that of all threads, so that
other programs on the machine matter little. Writes FOLDER/speed.md, speed.json and, with matplotlib, speed.svg. Finished fits are kept.
"""
import argparse
import json
import os
import resource
import subprocess
import sys

USUAL = {"cameras": 0, "silhouettes": 540, "pixels": 512, "template": "mannequin"}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset")
    parser.add_argument("--out", required=True)
    parser.add_argument("--cameras", required=True)
    parser.add_argument("--templates", default="mannequin")
    parser.add_argument("--holdout-frames", default="")
    parser.add_argument("--program", default="build/release/bin/mvstudio")
    return parser.parse_args()


def trials(a):
    count = len(a.cameras.split(","))
    usual = dict(USUAL, cameras=count)
    for axis, values in (("cameras", [c for c in (1, 2, 3, 4, 6, 8) if c <= count]), ("silhouettes", (60, 120, 240, 540)),
                         ("pixels", (96, 128, 256, 512)), ("template", a.templates.split(","))):
        for value in values:
            yield axis, value, dict(usual, **{axis: value})


def fit(a, trial):
    name = "-".join(str(value) for value in trial.values()).replace("/", "_")
    words = [a.program, "avatar", "fit", a.dataset, "--out", os.path.join(a.out, name), "--overwrite", "--pose-by", "joints", "--json",
             "--train-cameras", ",".join(a.cameras.split(",")[:trial["cameras"]]), "--max-silhouettes", str(trial["silhouettes"]),
             "--max-px", str(trial["pixels"]), "--template", trial["template"]]
    if a.holdout_frames:
        words += ["--holdout-frames", a.holdout_frames]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run = subprocess.run(words, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if run.returncode not in (0, 6):
        sys.exit(f"{' '.join(words)}\nended with {run.returncode}: {run.stderr.strip() or run.stdout.strip()}")
    metrics = json.loads(run.stdout)["metrics"]
    return {"cpu_s": after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, "vertices": metrics["vertices"],
            "silhouettes": metrics["silhouettes"], "iou": metrics["held_out_iou"], "sigma_mm": (metrics["surface_sigma_mm"] or {}).get("median")}


def draw(rows, path):
    try:
        import matplotlib
        matplotlib.use("svg")
        from matplotlib import pyplot
    except ImportError:
        return
    axes_of = {"cameras": "cameras", "silhouettes": "silhouettes", "pixels": "pixels", "template": "vertices"}
    figure, plots = pyplot.subplots(1, 4, figsize=(13, 3.2), sharey=True)
    for plot, (axis, key) in zip(plots, axes_of.items()):
        points = sorted((row["vertices"] if axis == "template" else row["value"], row["cpu_s"]) for row in rows if row["axis"] == axis)
        plot.plot(*zip(*points), marker="o")
        plot.set_xlabel(key), plot.set_ylim(bottom=0), plot.grid(alpha=0.3)
    plots[0].set_ylabel("processor time, s")
    figure.tight_layout()
    figure.savefig(path)


def main():
    a = arguments()
    os.makedirs(a.out, exist_ok=True)
    kept = os.path.join(a.out, "speed.json")
    rows = json.load(open(kept, encoding="utf-8")) if os.path.exists(kept) else []
    for axis, value, trial in trials(a):
        if any(row["axis"] == axis and row["value"] == value for row in rows):
            continue
        same = next((row for row in rows if row["trial"] == trial), None)
        rows.append({"axis": axis, "value": value, "trial": trial, **({k: same[k] for k in same if k not in ("axis", "value", "trial")}
                                                                     if same else fit(a, trial))})
        with open(kept, "w", encoding="utf-8") as file:
            json.dump(rows, file, indent=1)
    lines = ["| | value | silhouettes | vertices | processor time, s | held-out IoU | surface sigma, mm |", "|---|---|---|---|---|---|---|"]
    for row in rows:
        sigma = "" if row["sigma_mm"] is None else f"{row['sigma_mm']:.1f}"
        iou = "" if row["iou"] is None else f"{row['iou']:.4f}"
        lines.append(f"| {row['axis']} | {os.path.basename(str(row['value']))} | {row['silhouettes']} | {row['vertices']} | {row['cpu_s']:.0f} | "
                     f"{iou} | {sigma} |")
    with open(os.path.join(a.out, "speed.md"), "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")
    print("\n".join(lines))
    draw(rows, os.path.join(a.out, "speed.svg"))


if __name__ == "__main__":
    main()
