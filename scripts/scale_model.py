"""What a stage of a take costs, from measured rates, and the tasks of a studio's footage. scripts/scale makes tables with it."""
import dataclasses
import json
import pathlib

from scale_sim import Task

GB, TB = 1e9, 1e12
BOARD_FRAMES = 60     # of each camera, for calibrate
VGA, HD = 640 * 480 / 1e6, 1920 * 1080 / 1e6  # megapixels


@dataclasses.dataclass
class Rate:
    """Of a take, on one core. Seconds: fixed + cameras * (camera + mpx * camera_mpx) + images * (image + mpx * image_mpx)."""
    fixed: float = 0.0
    camera: float = 0.0
    camera_mpx: float = 0.0
    image: float = 0.0
    image_mpx: float = 0.0
    footage: int = 0        # times that it reads the footage, digests included
    read: tuple = ()        # bytes/image of other files: constant, for each megapixel
    write: tuple = (0, 0)   # bytes/image that it writes, alike
    files: float = 0.0      # files that it writes for each image
    opens: float = 0.0      # files that it reads or whose sizes and times it compares, for each image
    memory: tuple = (0, 0, 0)  # bytes: constant, for a megapixel of each thread, for each image of the take
    spread: str = ""        # its threads share "cameras" or "images"; empty: one works, or little is gained


@dataclasses.dataclass
class Studio:
    name: str
    cameras: int
    fps: float
    mpx: float
    image_bytes: float      # of footage
    hours: float = 1.0

    def images(self):
        return self.cameras * self.fps * 3600 * self.hours


@dataclasses.dataclass
class Node:
    cores: int = 16
    file_bytes: float = 0.0  # bytes that could be moved in the time that a file costs the file system


def seconds(rate, cameras, images, mpx):
    """Of one core."""
    return rate.fixed + cameras * (rate.camera + mpx * rate.camera_mpx) + images * (rate.image + mpx * rate.image_mpx)


def threads(rate, cameras, images, cores):
    return {"cameras": min(cores, cameras), "images": min(cores, max(1, images)), "": 1}[rate.spread]


def memory(rate, studio, images, cores):
    workers = threads(rate, studio.cameras, images, cores)
    return rate.memory[0] + rate.memory[1] * workers * studio.mpx + rate.memory[2] * images


def read_bytes(rate, images, mpx, image_bytes):
    constant, per_mpx = rate.read or (0, 0)
    return images * (rate.footage * image_bytes + constant + mpx * per_mpx)


def write_bytes(rate, images, mpx):
    return images * (rate.write[0] + mpx * rate.write[1])


def template(plan):
    """Stage -> the stages that it waits for, whether it is of a take, and the measured seconds: from PLAN/plan.jsonl."""
    lines = (pathlib.Path(plan) / "plan.jsonl").read_text(encoding="utf-8").splitlines()
    tasks = [json.loads(line) for line in lines[1:]]
    tasks = [t for t in tasks if not t.get("part")]  # parts are no stages
    whole = {t["id"] for t in tasks}
    for t in tasks:
        t["after"] = [a for a in t["after"] if a in whole]
    stage_of, stages = {t["id"]: t["stage"] for t in tasks}, {}
    for t in tasks:
        if t["stage"] not in stages:
            stages[t["stage"]] = (sorted({stage_of[a] for a in t["after"]}), bool(t["take"]), t["seconds"])
    return stages


def tasks_of(studio, takes, rates, stages, node):
    """The tasks of a plan, numbered as `mvstudio plan` does: a stage's tasks stand in a row. Without a rate, a stage takes what
    it took when it was measured."""
    tasks, ids = [], {}
    for stage, (after, of_take, measured) in stages.items():
        rate = rates.get(stage) or Rate(fixed=measured or 0.0)
        images = studio.images() / takes if of_take else studio.cameras * BOARD_FRAMES
        cost = seconds(rate, studio.cameras, images, studio.mpx) / threads(rate, studio.cameras, images, node.cores)
        read = read_bytes(rate, images, studio.mpx, studio.image_bytes) + rate.opens * images * node.file_bytes
        write = write_bytes(rate, images, studio.mpx) + rate.files * images * node.file_bytes
        for take in range(takes if of_take else 1):
            ids[stage, take] = len(tasks) + 1
            if of_take:
                waits = [ids[s, take if stages[s][1] else 0] for s in after]
            else:
                waits = [i for (s, _), i in ids.items() if s in after]
            tasks.append(Task(ids[stage, take], stage, cost, read, write, tuple(waits), str(take)))
    return tasks
