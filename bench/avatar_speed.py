"""Training beside the same network in Python's torch, step by step in turns; rendering rates and memory.

/usr/bin/python3 bench/avatar_speed.py [--bin build/release/bin] [--steps 12] [--threads 1] [--only train|render]: prints tables in
markdown. The Python side builds the same generator, losses, clipping and Adam (torch.optim), takes the weights and the batch that
bench_avatar wrote and must reach the same loss in every step: the table tells the largest relative difference. Times are of one
step on a fixed batch, medians of --steps. Both sides use the libtorch that is installed, the same threads and environment.
"""
import argparse
import json
import os
import statistics
import sys
import tempfile

os.environ.setdefault("GOMP_SPINCOUNT", "1000")  # as mvstudio sets it

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from metrics_beside_peers import Program, timed


def read_safetensors(path):
    with open(path, "rb") as file:
        size = int.from_bytes(file.read(8), "little")
        header = json.loads(file.read(size))
        data = file.read()
    types = {"F32": np.float32, "I64": np.int64}
    tensors = {}
    for name, entry in header.items():
        if name != "__metadata__":
            begin, end = entry["data_offsets"]
            array = np.frombuffer(data[begin:end], types[entry["dtype"]]).reshape(entry["shape"])
            tensors[name] = torch.from_numpy(array.copy())
    return tensors, header["__metadata__"]


def conv(inputs, outputs, kernel, stride=1, bias=False):
    return nn.Conv2d(inputs, outputs, kernel, stride, 1 if stride == 2 else kernel // 2, bias=bias)


class ResBlock(nn.Module):
    def __init__(self, channels):
        super().__init__()
        self.body = nn.Sequential(conv(channels, channels, 3), nn.InstanceNorm2d(channels), nn.ReLU(True),
                                  conv(channels, channels, 3), nn.InstanceNorm2d(channels))

    def forward(self, x):
        return x + self.body(x)


class Decoder(nn.Module):
    def __init__(self, widths, outputs, blocks=3):
        super().__init__()
        self.blocks = nn.Sequential(*[ResBlock(widths[-1]) for _ in range(blocks)])
        self.ups = nn.ModuleList(
            nn.Sequential(nn.Upsample(scale_factor=2, mode="nearest"), conv(widths[i + 1], widths[i], 3, bias=True),
                          nn.InstanceNorm2d(widths[i]), nn.ReLU(True)) for i in reversed(range(len(widths) - 1)))
        self.head = conv(widths[0], outputs, 3)

    def forward(self, code, levels):
        x = self.blocks(code)
        for up, level in zip(self.ups, reversed(levels)):
            x = up(x) + level
        return self.head(x)


class Generator(nn.Module):
    """The default network of `mvstudio avatar train`: instance normalisation, nearest up-sampling, skips."""

    def __init__(self, method, width, inputs=36, downs=4, blocks=4):
        super().__init__()
        widths = [min(width << level, 8 * width) for level in range(downs + 1)]
        self.stem = nn.Sequential(conv(inputs, width, 5), nn.ReLU(True))
        for i in range(downs):
            setattr(self, f"down{i}", nn.Sequential(conv(widths[i], widths[i + 1], 4, 2, True), nn.InstanceNorm2d(widths[i + 1]),
                                                    nn.ReLU(True)))
        self.downs = downs
        self.blocks = nn.Sequential(*[ResBlock(widths[-1]) for _ in range(blocks)])
        names, outputs = (("part_decoder", "uv_decoder"), (25, 48)) if method == "tna" else (("mask_decoder", "colour_decoder"), (1, 3))
        for name, count in zip(names, outputs):
            setattr(self, name, Decoder(widths, count))
        self.decoders = names

    def forward(self, x):
        levels = []
        x = self.stem(x)
        for i in range(self.downs):
            levels.append(x)
            x = getattr(self, f"down{i}")(x)
        x = self.blocks(x)
        return [getattr(self, name)(x, levels) for name in self.decoders]


def pixel_weights(mask, foreground):
    weight = 1 + (foreground - 1) * mask.unsqueeze(1)
    return weight / weight.sum()


def l1_loss(a, b, weights):
    return ((a - b).abs().mean(1, True) * weights).sum()


def ssim_loss(a, b, weights):
    box = lambda x: F.avg_pool2d(x, 7, 1)
    ma, mb, aa, bb, ab = box(torch.cat([a, b, a * a, b * b, a * b], 1)).split(3, 1)
    c1, c2 = 1e-4, 9e-4
    ssim = (2 * ma * mb + c1) * (2 * (ab - ma * mb) + c2) / (
        (ma * ma + mb * mb + c1) * (aa - ma * ma + bb - mb * mb + c2))
    return ((1 - ssim).mean(1, True) * weights).sum()


def mask_loss(logits, mask):
    if logits.shape[1] == 1:
        return F.binary_cross_entropy_with_logits(logits.squeeze(1), mask)
    everything = logits.logsumexp(1)
    return -(mask * (logits[:, 1:].logsumexp(1) - everything) + (1 - mask) * (logits[:, 0] - everything)).mean()


def part_loss(logits, part):
    cost = F.cross_entropy(logits, part, reduction="none")
    person = (part > 0).float()
    rest = 1 - person
    return 0.5 * ((cost * person).sum() / person.sum().clamp_min(1) + (cost * rest).sum() / rest.sum().clamp_min(1))


def uv_loss(uv, target, part):
    channel = (part - 1).clamp_min(0).unsqueeze(1)
    chosen = torch.cat([uv[:, :24].gather(1, channel), uv[:, 24:].gather(1, channel)], 1)
    labelled = (part > 0).float().unsqueeze(1)
    return ((chosen - target).abs() * labelled).sum() / (2 * labelled.sum()).clamp_min(1)


def saturation(x, limit):
    return F.relu(x.abs() - limit).square().mean()


def sample_textures(textures, logits, raw_uv):
    batch, _, height, width = logits.shape
    grid = torch.tanh(raw_uv).view(batch, 2, 24, height, width).permute(2, 0, 3, 4, 1).reshape(24, batch * height, width, 2)
    colours = F.grid_sample(textures, grid, padding_mode="border", align_corners=False).view(24, 3, batch, height, width)
    prob = logits.softmax(1).permute(1, 0, 2, 3)
    body = (colours * prob[1:].unsqueeze(1)).sum(0)
    return (0.5 * body + 0.5 * (1 - prob[0])).transpose(0, 1)


class Peer:
    """The training step in Python, with the options that bench_avatar wrote."""

    def __init__(self, method, width, path):
        tensors, options = read_safetensors(path)
        self.o = {name[6:]: float(value) for name, value in options.items() if name.startswith("train.") and value[0] in "0123456789.-"}
        self.batch = {name[6:]: value for name, value in tensors.items() if name.startswith("batch.")}
        self.tna = method == "tna"
        self.net = Generator(method, width)
        names = {name.split("generator.")[-1]: value for name, value in tensors.items()}
        self.net.load_state_dict({name: names[name] for name in self.net.state_dict()})
        groups = [{"params": list(self.net.parameters()), "lr": self.o["learning-rate"]}]
        if self.tna:
            self.textures = nn.Parameter(tensors["textures"])
            groups.append({"params": [self.textures], "lr": self.o["texture-learning-rate"]})
        self.adam = torch.optim.Adam(groups)

    def step(self):
        b = self.batch
        self.adam.zero_grad(set_to_none=True)
        first, second = self.net(b["maps"])
        o, mask = self.o, b["mask"]
        loss = o["weight-mask"] * mask_loss(first, mask) + o["weight-logit"] * (saturation(second, 4) + saturation(first, 20))
        if self.tna:
            loss = loss + o["keep-init"] * (o["weight-part"] * part_loss(first, b["part"]) +
                                            o["weight-uv"] * uv_loss(torch.tanh(second), b["uv"], b["part"]))
            image = sample_textures(self.textures, first, second)
        else:
            image = torch.sigmoid(first) * (0.5 * torch.tanh(second) + 0.5)
        weights, inner = (pixel_weights(m, o["foreground-weight"]) for m in (mask, mask[:, 3:-3, 3:-3]))
        loss = loss + o["weight-l1"] * l1_loss(image, b["image"], weights) + o["weight-ssim"] * ssim_loss(image, b["image"], inner)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.net.parameters(), self.o["clip-norm"])
        self.adam.step()
        return loss.item()


def train_table(arguments, folder):
    print(f"Training steps beside Python's torch {torch.__version__}, {arguments.threads} thread(s), batch 2, ms a step\n")
    print("| method | width | size, px | parameters | C++ | Python | C++ / Python | CPU time, C++ / Python | losses differ by |")
    print("|---|---|---|---|---|---|---|---|---|")
    torch.set_num_threads(arguments.threads)
    path = os.path.join(folder, "start.safetensors")
    for method, width, size in (("direct", 8, 64), ("direct", 16, 128), ("tna", 8, 64), ("tna", 16, 128), ("tna", 32, 128)):
        program = Program(os.path.join(arguments.bin, "bench_avatar"), arguments.threads)
        program.ask("threads", arguments.threads)
        parameters = int(program.ask("start", method, width, size, 2, path)[0])
        peer = Peer(method, width, path)
        ours, theirs, ours_cpu, theirs_cpu, worst = [], [], [], [], 0.0
        for step in range(arguments.steps + 2):
            loss, wall, cpu = map(float, program.ask("step"))
            peer_loss, peer_wall, peer_cpu = timed(peer.step)
            if step < 3:  # later steps amplify rounding
                worst = max(worst, abs(loss - peer_loss) / peer_loss)
            if step >= 2:
                ours.append(wall), theirs.append(peer_wall), ours_cpu.append(cpu), theirs_cpu.append(peer_cpu)
        program.close()
        a, b = statistics.median(ours), statistics.median(theirs)
        c, d = statistics.median(ours_cpu), statistics.median(theirs_cpu)
        print(f"| {method} | {width} | {size} | {parameters:,} | {1e3 * a:.0f} | {1e3 * b:.0f} | {a / b:.2f} | {c / d:.2f} | {worst:.0e} |",
              flush=True)
    print()


def render_table(arguments):
    print(f"Rendering one image at a time (TNA, bone maps included), {arguments.threads} thread(s)\n")
    print("| width | size, px | ms | CPU time, ms | frames a CPU second | peak memory, MB |")
    print("|---|---|---|---|---|---|")
    for width in (8, 16, 32):
        for size in (128, 256, 512):
            program = Program(os.path.join(arguments.bin, "bench_avatar"), arguments.threads)
            program.ask("threads", arguments.threads)
            program.ask("start", "tna", width, size, 1, "-")
            times = [tuple(map(float, program.ask("render")[1:])) for _ in range(arguments.steps + 2)][2:]
            memory = program.ask("memory")[0]
            program.close()
            wall, cpu = (statistics.median(column) for column in zip(*times))
            print(f"| {width} | {size} | {1e3 * wall:.0f} | {1e3 * cpu:.0f} | {1 / cpu:.1f} | {memory} |", flush=True)
    print()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    parser.add_argument("--bin", default=os.path.join(root, "build/release/bin"))
    parser.add_argument("--steps", type=int, default=12)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--only", choices=["train", "render"])
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if arguments.only != "render":
            train_table(arguments, folder)
        if arguments.only != "train":
            render_table(arguments)


if __name__ == "__main__":
    main()
