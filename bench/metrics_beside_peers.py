"""SSIM beside scikit-image and the Frechet distance beside scipy's sqrtm, timed in turns in one run.

/usr/bin/python3 bench/metrics_beside_peers.py [--bin build/release/bin] [--repeats 7] [--only ssim|frechet] [--sizes N ...]: prints
tables in markdown: medians of the repetitions, ratios, and how far the values differ. Both sides start from the same 8-bit
pictures (features) in memory; reading files is not timed. Times depend on the machine: read the ratios.
"""
import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import numpy as np

SIZES = [(64, 64, 3), (256, 256, 3), (512, 512, 3), (1080, 1920, 3), (1080, 1920, 1)]
WANG = dict(gaussian_weights=True, sigma=1.5, use_sample_covariance=False)


class Program:
    """A program of ours that answers one line a request."""

    def __init__(self, path, threads=1):
        environment = dict(os.environ, OMP_NUM_THREADS=str(threads), OPENBLAS_NUM_THREADS=str(threads))
        self.process = subprocess.Popen([path], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment)

    def ask(self, *words):
        self.process.stdin.write(" ".join(str(word) for word in words) + "\n")
        self.process.stdin.flush()
        answer = self.process.stdout.readline()
        if not answer:
            sys.exit(f"{self.process.args[0]} ended at: {' '.join(map(str, words))}")
        return answer.split()

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def timed(function):
    start = time.perf_counter()
    value = function()
    return value, time.perf_counter() - start


def in_turns(repeats, ways):
    """Every way once, then all again; the first round is not counted. {name: (value, median seconds)}."""
    values, seconds = {}, {name: [] for name in ways}
    for turn in range(repeats + 1):
        for name, way in ways.items():
            values[name], took = way()
            if turn:
                seconds[name].append(took)
    return {name: (values[name], statistics.median(seconds[name])) for name in ways}


def pictures(shape, rng):
    from scipy.ndimage import gaussian_filter

    a = gaussian_filter(rng.random(shape), (2, 2, 0))
    a = (a - a.min()) / (a.max() - a.min())
    b = np.clip(a + 0.05 * rng.standard_normal(shape), 0, 1)
    return [np.round(255 * x).astype(np.uint8) for x in (a, b)]


def ssim_table(arguments, folder):
    import skimage
    from skimage.metrics import structural_similarity

    program = Program(os.path.join(arguments.bin, "bench_metrics"))
    print(f"SSIM beside scikit-image {skimage.__version__}, ms; its functions use one thread whatever the machine has\n")
    print("| size | window | ours, 1 thread | ours, 2 threads | scikit-image | ratio, 1 thread | ratio, 2 threads | difference |")
    print("|---|---|---|---|---|---|---|---|")
    rng = np.random.default_rng(5)
    for shape in SIZES:
        a, b = pictures(shape, rng)
        paths = [os.path.join(folder, name) for name in ("a.npy", "b.npy")]
        for path, picture in zip(paths, (a, b)):
            np.save(path, picture)
        program.ask("load", *paths)
        for window, options in (("wang", WANG), ("uniform", {})):

            def ours(threads):
                answer = program.ask("ssim", window, threads)
                return float(answer[0]), float(answer[1])

            repeats = arguments.repeats * (5 if shape[0] <= 256 else 1)
            result = in_turns(repeats, {
                "one": lambda: ours(1),
                "peer": lambda: timed(lambda: structural_similarity(a, b, data_range=255, channel_axis=2, **options)),
                "two": lambda: ours(2),
            })
            one, two, peer = result["one"], result["two"], result["peer"]
            print(f"| {shape[1]}x{shape[0]}x{shape[2]} | {window} | {1e3 * one[1]:.2f} | {1e3 * two[1]:.2f} | {1e3 * peer[1]:.1f} "
                  f"| {peer[1] / one[1]:.1f} | {peer[1] / two[1]:.1f} | {abs(one[0] - peer[0]):.1e} |", flush=True)
    program.close()
    print()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    parser.add_argument("--bin", default=os.path.join(root, "build/release/bin"))
    parser.add_argument("--repeats", type=int, default=7)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        ssim_table(arguments, folder)


if __name__ == "__main__":
    main()
