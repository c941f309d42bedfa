#!/usr/bin/env python3
"""Textured avatars against their baselines on held-out cameras and motion, as in Table 1 of Shysheya et al., CVPR 2019.

run.py DATASET --out FOLDER --holdout-cameras A,B --holdout-frames 90-119 --cameras 6=A,B,C,D,E,F --cameras 3=A,B,C
       [--methods girths,fitted,gaussians,template,tna+template,direct+template,v2v+template,hf+template,tna,direct,v2v,tna+pretrained]
       [--seeds 1,2,3]
       [--train "--size 96"] [--train-networks "--steps 400 --batch 2"] [--train-bones "--init-steps 100"] [--train-gaussians FLAGS]
       [--fit FLAGS] [--pretrained FOLDER] [--limit-minutes M] [--program FILE]

Trains every (set of cameras, method, seed) with the same flags, scores it and writes FOLDER/table.md and table.json: the table of `mvstudio
avatar compare`, which refuses runs of different protocols, and the costs of training. Finished runs are kept and interrupted ones
resumed: run it again to go on. With --limit-minutes no further run is begun after that time.

A method alone sees the bones (`--prior none`), with +pretrained it begins with the network of `avatar pretrain` in --pretrained, with
+template it sees the fitted body. One body is fitted for each set of cameras; the labels of an initialisation are its as well. Without a network, and without seeds, for nothing in them is
random: `girths` is the mannequin with fitted girths, `template` the fitted body in textures as a network begins with, `fitted` the body itself.
`gaussians` are Gaussians on the fitted body. --train-bones: flags of the networks without template alone. Memory is the peak of training and
of scoring, images a second are those of scoring: by the clock, so they say little on a busy machine.
"""
import argparse
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time

NAMES = {"girths": "template with fitted girths", "template": "fitted body, textures of TNA", "fitted": "fitted body"}
for method, text in (("tna", "TNA"), ("direct", "Direct"), ("v2v", "V2V-lite"), ("hf", "HF")):
    NAMES[method], NAMES[method + "+template"], NAMES[method + "+pretrained"] = text, text + " on fitted", text + ", pretrained"
NAMES["gaussians"] = "Gaussians on fitted"
WITHOUT_NETWORK = ("girths", "template", "fitted")


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset")
    parser.add_argument("--out", required=True)
    parser.add_argument("--holdout-cameras", required=True)
    parser.add_argument("--holdout-frames", required=True)
    parser.add_argument("--cameras", action="append", required=True, help="NAME=CAMERA,CAMERA,… to train on")
    parser.add_argument("--methods", default="tna,direct,v2v,template,tna+template,direct+template")
    parser.add_argument("--seeds", default="1,2,3")
    parser.add_argument("--train", default="--size 96", help="flags of every training, each with its value")
    parser.add_argument("--train-networks", default="--steps 400 --batch 2", help="further flags of networks")
    parser.add_argument("--train-bones", default="", help="further flags of those that see the bones alone")
    parser.add_argument("--train-gaussians", default="", help="further flags of Gaussians")
    parser.add_argument("--fit", default="", help="flags of `avatar fit`")
    parser.add_argument("--pretrained", help="folder of `avatar pretrain`")
    parser.add_argument("--features", default="auto")
    parser.add_argument("--limit-minutes", type=float, default=1e9)
    parser.add_argument("--program", default="build/release/bin/mvstudio")
    return parser.parse_args()


def call(program, words):
    """The result object of a command; ends the whole run when it fails."""
    return call_measured(program, words)[0]


def call_measured(program, words):
    """Result object, and peak memory in MB."""
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as errors:
        process = subprocess.Popen([program, *words, "--json"], stdout=output, stderr=errors)
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        output.seek(0), errors.seek(0)
        text, error_text = output.read(), errors.read()
    if process.returncode not in (0, 6):
        sys.exit(f"{program} {' '.join(words)}\nended with {process.returncode}: {error_text.strip() or text.strip()}")
    return json.loads(text), usage.ru_maxrss / 1024


def flags(a, variant, body):
    """Flags of a training: later ones replace earlier ones."""
    method, _, start = variant.partition("+")
    words = f"--method {method} --prior none --body {body} {a.train} {a.train_networks} {a.train_bones}".split()
    if method == "gaussians":
        words = f"--method gaussians --body {body} {a.train} {a.train_gaussians}".split()
    elif start == "pretrained":
        words += ["--init-from", a.pretrained, "--init-steps", "0"]
    elif start == "template":
        words = f"--method {method} --prior template --body {body} {a.train} {a.train_networks}".split()
    elif variant in WITHOUT_NETWORK:
        words = f"--prior template {a.train} --steps 0 --init-steps 0".split()
        words += ["--fit", "girths"] if variant == "girths" else ["--body", body]
    chosen = dict(zip(words[::2], words[1::2]))
    return [word for pair in chosen.items() for word in pair]


def split_flags(a, cameras):
    return ["--train-cameras", cameras, "--holdout-cameras", a.holdout_cameras, "--holdout-frames", a.holdout_frames]


def fitted(a, name, cameras):
    """The folder of the body fitted to these cameras."""
    folder = os.path.join(a.out, name + "-body")
    if not os.path.exists(os.path.join(folder, "avatar_fit.result.json")):
        call(a.program, ["avatar", "fit", a.dataset, "--out", folder, "--overwrite", *split_flags(a, cameras), *a.fit.split()])
    return folder


def trained(a, folder, cameras, method, seed, body):
    """Metrics of the training, and its peak memory: begins it, resumes it, or reads what is finished (memory unknown)."""
    result = os.path.join(folder, "avatar_train.result.json")
    if os.path.exists(os.path.join(folder, "checkpoint.safetensors")):
        if not os.path.exists(result):
            return call_measured(a.program, ["avatar", "resume", folder])
    if os.path.exists(result):
        with open(result) as file:
            return json.load(file), None
    return call_measured(a.program, ["avatar", "train", a.dataset, "--out", folder, "--overwrite", "--seed", str(seed),
                                     *split_flags(a, cameras), *flags(a, method, body)])


def one(a, folder, cameras, method, seed, body):
    """Trains (or resumes) and scores one avatar; what is finished is read from its folder."""
    scored = os.path.join(folder, "scores.json")
    if os.path.exists(scored) and os.path.exists(os.path.join(folder, "protocol.json")):
        with open(scored) as file:
            return json.load(file)
    begin = time.time()
    training, train_mb = trained(a, folder, cameras, method, seed, body)
    training = training["metrics"]
    scores, eval_mb = call_measured(a.program, ["avatar", "eval", folder, "--overwrite", "--features", a.features])
    metrics = scores["metrics"]
    holdout = metrics["baselines"]["body_alone"] if method == "fitted" else metrics["holdout"]
    result = {"ssim": holdout["ssim"], "psnr_db": holdout["psnr_db"], "mask_iou": holdout["mask_iou"], "fd": holdout["fd"]["value"],
              "fd_features": holdout["fd"]["features"], "n": holdout["n"], "steps": training["steps"],
              "train_s": training["wall_s"], "parameters": training["num_parameters"], "ssim_person": holdout["masked"]["ssim"],
              "kid": holdout["fd"].get("kid"), "kid_se": holdout["fd"].get("kid_se"), "train_mb": train_mb, "eval_mb": eval_mb,
              "pictures_per_s": 1 / metrics["seconds_per_frame"] if metrics["seconds_per_frame"] else None,
              "nearest_pose_ssim": metrics["baselines"]["nearest_pose"]["ssim"],
              "mean_image_ssim": metrics["baselines"]["mean_image"]["ssim"], "flicker": holdout.get("flicker")}
    with open(scored + ".tmp", "w") as file:
        json.dump(result, file, indent=1)
    os.replace(scored + ".tmp", scored)
    print(f"{folder}: SSIM {result['ssim']:.4f}, {time.time() - begin:.0f} s", flush=True)
    return result


def spread(values):
    if all(isinstance(value, int) and value == values[0] for value in values):
        return f"{values[0]:,}"
    mean = statistics.mean(values)
    return f"{mean:.4g} ± {(max(values) - min(values)) / 2:.2g}" if len(values) > 1 else f"{mean:.4g}"


def comparison(a, folders):
    """Table of `avatar compare` over all runs: rows are methods and sets of cameras."""
    words = [f"{NAMES[method]}, {cameras} cameras={folder}" for (cameras, method), list_ in folders.items() for folder in list_
             if method != "fitted"]  # its run has TNA's textures
    out = os.path.join(a.out, "compare.md")
    call(a.program, ["avatar", "compare", *words, "--out", out])
    with open(out) as file:
        return file.read()


COLUMNS = (("ssim", "SSIM"), ("ssim_person", "SSIM of the person's pixels"), ("psnr_db", "PSNR, dB"), ("mask_iou", "IoU"), ("fd", "FD"),
           ("kid", "KID"), ("flicker", "flicker"), ("steps", "steps"), ("parameters", "parameters"), ("train_s", "training, s"),
           ("train_mb", "training, MB"), ("pictures_per_s", "images a second"), ("eval_mb", "scoring, MB"))


def table(a, results):
    lines = [f"`{a.dataset}`, held out {a.holdout_cameras} and frames {a.holdout_frames}; `{a.train}`; seeds {a.seeds}; "
             f"{platform.machine()}, {os.cpu_count()} cores. Held-out cameras and motion; mean ± half the range over seeds.", "",
             "| training cameras | method | " + " | ".join(title for _, title in COLUMNS) + " |", "|---|---|" + "---:|" * len(COLUMNS)]
    for (cameras, method), runs in results.items():
        cells = ["" if any(r.get(key) is None for r in runs) else spread([r[key] for r in runs]) for key, _ in COLUMNS]
        lines.append(f"| {cameras} | {NAMES[method]} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def verdict(results):
    """Is TNA's SSIM higher than each baseline's of the same input for every pair of seeds?"""
    lines = []
    for cameras in dict.fromkeys(key[0] for key in results):
        for own_name, others in (("tna", ("direct", "v2v")), ("tna+pretrained", ("direct+pretrained", "v2v+pretrained", "tna", "direct", "v2v")),
                                 ("tna+template", ("direct+template", "v2v+template", "fitted")), ("direct+template", ("fitted",)),
                                 ("v2v+template", ("fitted",)), ("gaussians", ("fitted", "tna+template", "direct+template")), ("fitted", ("girths",))):
            own = [r["ssim"] for r in results.get((cameras, own_name), [])]
            for method in others:
                other = [r["ssim"] for r in results.get((cameras, method), [])]
                if own and other:
                    gap = statistics.mean(own) - statistics.mean(other)
                    random = [name for name in (own_name, method) if name not in WITHOUT_NETWORK]
                    seeds = min((len(results[cameras, name]) for name in random), default=2)
                    spread_of_seeds = "one seed, so no spread is known" if seeds < 2 else \
                        ("outside" if min(own) > max(other) or max(own) < min(other) else "NOT outside") + " the spread of seeds"
                    lines.append(f"{cameras} cameras: {NAMES[own_name]} - {NAMES[method]} = {gap:+.4f}, {spread_of_seeds}")
    return lines


def main():
    a = arguments()
    begin = time.time()
    results, folders = {}, {}
    for seed in a.seeds.split(","):  # a whole table for the first seed comes first
        for cameras in a.cameras:
            name, _, members = cameras.partition("=")
            for method in a.methods.split(","):
                if method in WITHOUT_NETWORK and seed != a.seeds.split(",")[0]:
                    continue
                folder = os.path.join(a.out, f"{name}-{method}-{seed}")
                known = os.path.exists(os.path.join(folder, "scores.json"))
                if not known and time.time() - begin > 60 * a.limit_minutes:
                    continue
                body = fitted(a, name, members)
                results.setdefault((name, method), []).append(one(a, folder, members, method, seed, body))
                folders.setdefault((name, method), []).append(folder)
    text = comparison(a, folders) + "\n" + table(a, results) + "\n" + "\n".join(verdict(results)) + "\n"
    with open(os.path.join(a.out, "table.md"), "w") as file:
        file.write(text)
    with open(os.path.join(a.out, "table.json"), "w") as file:
        json.dump([{"cameras": c, "method": m, "runs": r} for (c, m), r in results.items()], file, indent=1)
    print(text)


if __name__ == "__main__":
    main()
