"""SSIM beside scikit-image and the Frechet distance beside scipy's sqrtm, timed in turns in one run.

/usr/bin/python3 bench/metrics_beside_peers.py [--bin build/release/bin] [--repeats 7] [--only ssim|frechet] [--samples N ...]:
prints tables in markdown. Both sides start from the same 8-bit pictures (float64 features) in memory; reading files is not timed.
Times are medians; ratios at equal threads are of CPU time, which other programs disturb least. Times depend on the machine: read
the ratios.
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
    """(value, seconds, CPU seconds)"""
    cpu, start = time.process_time(), time.perf_counter()
    value = function()
    return value, time.perf_counter() - start, time.process_time() - cpu


def in_turns(repeats, ways):
    """Every way once, then all again; the first round is not counted. {name: (value, median seconds, median CPU seconds)}."""
    values, taken = {}, {name: [] for name in ways}
    for turn in range(repeats + 1):
        for name, way in ways.items():
            values[name], *took = way()
            if turn:
                taken[name].append(took)
    return {name: (values[name], *(statistics.median(column) for column in zip(*taken[name]))) for name in ways}


def pictures(shape, rng):
    from scipy.ndimage import gaussian_filter

    a = gaussian_filter(rng.random(shape), (2, 2, 0))
    a = (a - a.min()) / (a.max() - a.min())
    b = np.clip(a + 0.05 * rng.standard_normal(shape), 0, 1)
    return [np.round(255 * x).astype(np.uint8) for x in (a, b)]


def save(folder, arrays):
    paths = [os.path.join(folder, name) for name in ("a.npy", "b.npy")]
    for path, array in zip(paths, arrays):
        np.save(path, array)
    return paths


def ssim_table(arguments, folder):
    import skimage
    from skimage.metrics import structural_similarity

    program = Program(os.path.join(arguments.bin, "bench_metrics"))
    print(f"SSIM beside scikit-image {skimage.__version__}, ms; it has no threads of its own\n")
    print("| size | window | 1 thread | 2 threads | scikit-image | ratio at 1 thread | ratio at 2 against its 1 | difference |")
    print("|---|---|---|---|---|---|---|---|")
    rng = np.random.default_rng(5)
    for shape in SIZES:
        a, b = pictures(shape, rng)
        program.ask("load", *save(folder, (a, b)))
        for window, options in (("wang", WANG), ("uniform", {})):
            ours = lambda threads: tuple(map(float, program.ask("ssim", window, threads)))
            repeats = arguments.repeats * (10 if shape[0] <= 256 else 1)
            result = in_turns(repeats, {
                "one": lambda: ours(1),
                "peer": lambda: timed(lambda: structural_similarity(a, b, data_range=255, channel_axis=2, **options)),
                "two": lambda: ours(2),
            })
            one, two, peer = result["one"], result["two"], result["peer"]
            print(f"| {shape[1]}x{shape[0]}x{shape[2]} | {window} | {1e3 * one[1]:.2f} | {1e3 * two[1]:.2f} | {1e3 * peer[1]:.1f} "
                  f"| {peer[2] / one[2]:.1f} | {peer[1] / two[1]:.1f} | {abs(one[0] - peer[0]):.0e} |", flush=True)
    program.close()
    print()


def features(n, d, rng):
    """Correlated and cut at zero, as a network's pooled activations."""
    return np.maximum(rng.standard_normal((n, 64)) @ rng.standard_normal((64, d)) / 8 + 0.3 * rng.standard_normal((n, d)) + 0.2, 0)


def by_sqrtm(a, b):
    """As pytorch-fid and its descendants compute it."""
    from scipy.linalg import sqrtm

    s1, s2 = np.cov(a, rowvar=False), np.cov(b, rowvar=False)
    root = sqrtm(s1 @ s2)
    difference = a.mean(0) - b.mean(0)
    return difference @ difference + np.trace(s1) + np.trace(s2) - 2 * np.trace(root.real)


def frechet_table(arguments, folder):
    import scipy

    program = Program(os.path.join(arguments.bin, "bench_avatar_distance"))
    print(f"Frechet distance beside scipy {scipy.__version__}'s sqrtm, d = 2048, s, one thread\n")
    print("| n | ours | scipy | ratio | ours | scipy, relative difference | self-distance of ours / trace |")
    print("|---|---|---|---|---|---|---|")
    for n in arguments.samples:
        rng = np.random.default_rng(n)
        a, b = features(n, 2048, rng), 1.05 * features(n, 2048, rng)
        program.ask("load", *save(folder, (a, b)))
        ours = [tuple(map(float, program.ask("frechet", 1))) for _ in range(3)]
        value, wall, cpu = timed(lambda: by_sqrtm(a, b)) if n <= arguments.largest_peer else (None, None, None)
        ours += [tuple(map(float, program.ask("frechet", 1))) for _ in range(2)]
        program.ask("load", *save(folder, (a, a)))
        own = float(program.ask("frechet", 1)[0]) / np.var(a, axis=0, ddof=1).sum()
        mine, my_cpu = statistics.median(x[1] for x in ours), statistics.median(x[2] for x in ours)
        peer = (f"{wall:.1f}", f"{cpu / my_cpu:.0f}", f"{abs(value / ours[0][0] - 1):.0e}") if value is not None else ("-",) * 3
        print(f"| {n} | {mine:.2f} | {peer[0]} | {peer[1]} | {ours[0][0]:.6g} | {peer[2]} | {own:.0e} |", flush=True)
    program.close()
    print()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    parser.add_argument("--bin", default=os.path.join(root, "build/release/bin"))
    parser.add_argument("--repeats", type=int, default=7)
    parser.add_argument("--only", choices=["ssim", "frechet"])
    parser.add_argument("--samples", type=int, nargs="+", default=[50, 300, 1500, 4096])
    parser.add_argument("--largest-peer", type=int, default=1500, help="sqrtm is not run for more samples than this")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if arguments.only != "frechet":
            ssim_table(arguments, folder)
        if arguments.only != "ssim":
            frechet_table(arguments, folder)


if __name__ == "__main__":
    main()
