"""The tasks of one long take whose stages `mvstudio plan` cuts by cameras and blocks of frames. scripts/scale makes tables with it."""
import dataclasses
import math

from scale_model import read_bytes, tasks_of, write_bytes
from scale_sim import Task

BLOCK = 300  # frames: kKeptBlock of stages/input/kept_footage.h
PARTED = ("pose2d", "mask", "dataset")
SAMPLED = ("mask", "dataset")  # which learn from a first pass over a camera


@dataclasses.dataclass
class Cut:
    """Parts of a stage of one take."""
    blocks: int       # of a camera
    at_once: int      # blocks of a part
    parts: int        # of a camera
    seconds: float    # of a part, on one thread
    samples_s: float  # of a camera's first pass; 0: there is none


def cut(studio, stage, rate, task_s):
    """As CutStages of stages/plan/cut.cc does it."""
    frames = studio.fps * 3600 * studio.hours
    block_s = BLOCK * (rate.image + rate.image_mpx * studio.mpx)
    blocks = max(1, math.ceil(frames / BLOCK))
    at_once = min(blocks, max(1, round(task_s / block_s)))
    samples_s = rate.fixed + studio.mpx * rate.camera_mpx if stage in SAMPLED else 0.0
    return Cut(blocks, at_once, math.ceil(blocks / at_once), rate.fixed + at_once * block_s, samples_s)


def share_seconds(studio, rate):
    """`verify` of one camera."""
    return rate.fixed + studio.images() / studio.cameras * (rate.image + rate.image_mpx * studio.mpx)


def _sharing(total, cores, read, write, cost, after, first_id, stage):
    """`total` equal tasks of one thread as tasks of a node that does `cores` of them at a time."""
    nodes = math.ceil(total / cores)
    return [Task(first_id + k, stage, cost, read / nodes, write / nodes, tuple(after), "0") for k in range(nodes)]


def tasks_in_parts(studio, rates, stages, node, task_s=300.0):
    """One take of the studio's hours. A node does as many parts at a time as it has cores; passing over the frames before a part
    is not counted. What joins parts looks at every file of them once more."""
    whole = {t.stage: t for t in tasks_of(studio, 1, rates, stages, node)}
    images, tasks, last = studio.images(), [], {}
    for stage, (after, _, _) in stages.items():
        waits = [last[s] for s in after]
        if stage in PARTED:
            rate, parts = rates[stage], cut(studio, stage, rates[stage], task_s)
            footage = images * studio.image_bytes
            if parts.samples_s:
                made = _sharing(studio.cameras, node.cores, footage, 0.0, parts.samples_s, waits, len(tasks) + 1, stage)
                tasks += made
                waits = [t.id for t in made]
            read = read_bytes(rate, images, studio.mpx, studio.image_bytes) + rate.opens * images * node.file_bytes
            write = write_bytes(rate, images, studio.mpx) + rate.files * images * node.file_bytes
            made = _sharing(studio.cameras * parts.parts, node.cores, read, write, parts.seconds, waits, len(tasks) + 1, stage)
            tasks += made
            files = rate.files * images * node.file_bytes
            tasks.append(Task(len(tasks) + 1, stage, rate.fixed, 0.0, files, tuple(t.id for t in made), "0"))
        elif stage == "verify":
            made = _sharing(studio.cameras, node.cores, whole[stage].read, 0.0, share_seconds(studio, rates[stage]), waits, len(tasks) + 1,
                            stage)
            tasks += made
            tasks.append(Task(len(tasks) + 1, stage, rates[stage].fixed, after=tuple(t.id for t in made), take="0"))
        else:
            tasks.append(dataclasses.replace(whole[stage], id=len(tasks) + 1, after=tuple(waits)))
        last[stage] = len(tasks)
    return tasks
