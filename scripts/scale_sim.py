"""A plan of tasks on nodes that share a file system, as a discrete-event simulation. scripts/scale makes tables with it."""
import dataclasses
import heapq
import math
import random


@dataclasses.dataclass
class Task:
    """A task reads its bytes, then computes, then writes its bytes. A node does one task at a time."""
    id: int
    stage: str
    seconds: float          # of computing on one node
    read: float = 0.0       # bytes from the shared file system
    write: float = 0.0      # bytes to it
    after: tuple = ()       # ids of the tasks that it waits for
    take: str = ""


@dataclasses.dataclass
class Cluster:
    nodes: int = 1
    shared: float = math.inf    # bytes/s of the file system, for all nodes together
    link: float = math.inf      # bytes/s of one node's network
    start: float = 0.0          # s that a scheduler needs to start a task
    slow_share: float = 0.0     # share of the tries that are stragglers
    slow_factor: float = 1.0    # their computing takes so many times as long
    mtbf: float = math.inf      # s of computing between two failures of a node; the task begins again
    seed: int = 1


@dataclasses.dataclass
class Outcome:
    seconds: float          # until the last task is done
    tries: int              # tasks that were started, with those that failed
    busy: float             # node seconds, failed tries included
    in_files: float         # node seconds of reading and writing


def with_gates(tasks):
    """The same tasks, each stage waiting for all of every stage that one of its tasks waits for, as arrays of Slurm do."""
    stage_of = {t.id: t.stage for t in tasks}
    before, members = {}, {}
    for t in tasks:
        before.setdefault(t.stage, set()).update(stage_of[a] for a in t.after)
        members.setdefault(t.stage, []).append(t.id)
    gate = {stage: -1 - k for k, stage in enumerate(members)}
    gated = [dataclasses.replace(t, after=tuple(gate[s] for s in sorted(before[t.stage]))) for t in tasks]
    return gated + [Task(gate[s], "gate", 0.0, after=tuple(ids)) for s, ids in members.items()]


def critical_path(tasks):
    """Seconds of the longest chain of computing."""
    by_id, ends = {t.id: t for t in tasks}, {}

    def end(task):
        if task.id not in ends:
            ends[task.id] = task.seconds + max((end(by_id[a]) for a in task.after), default=0.0)
        return ends[task.id]

    return max(end(t) for t in tasks)


class _Files:
    """Transfers that share a bandwidth alike. Work is counted for one transfer: all that run progress at the same rate."""

    def __init__(self, cluster):
        self.cluster, self.now, self.done, self.ends = cluster, 0.0, 0.0, []

    def rate(self):
        return min(self.cluster.link, self.cluster.shared / len(self.ends))

    def advance(self, now):
        if self.ends and not math.isinf(self.rate()):
            self.done += self.rate() * (now - self.now)
        self.now = now

    def add(self, now, size, what):
        self.advance(now)
        heapq.heappush(self.ends, (self.done + size, what))

    def next_time(self):
        if not self.ends:
            return math.inf
        return self.now + max(0.0, self.ends[0][0] - self.done) / self.rate()

    def pop(self, now):
        self.advance(now)
        self.done = max(self.done, self.ends[0][0])
        return heapq.heappop(self.ends)[1]


class _Run:
    """One simulation. Ready tasks start in the order of their ids, gates at once and on no node."""

    def __init__(self, tasks, cluster):
        self.cluster, self.random, self.files = cluster, random.Random(cluster.seed), _Files(cluster)
        self.tasks = {t.id: t for t in tasks}
        self.missing = {t.id: len(t.after) for t in tasks}
        self.readers, self.ready, self.timers, self.began = {}, [], [], {}
        for t in tasks:
            for a in t.after:
                self.readers.setdefault(a, []).append(t.id)
        self.free, self.now, self.left = cluster.nodes, 0.0, len(tasks)
        self.tries, self.busy, self.in_files = 0, 0.0, 0.0
        for t in sorted(tasks, key=lambda t: t.id):
            if not t.after:
                self.release(t.id)

    def release(self, task):
        if self.tasks[task].stage == "gate":
            self.finish(task)
        else:
            heapq.heappush(self.ready, task)

    def finish(self, task):
        self.left -= 1
        for reader in self.readers.get(task, ()):
            self.missing[reader] -= 1
            if self.missing[reader] == 0:
                self.release(reader)

    def start_ready(self):
        while self.free and self.ready:
            task = heapq.heappop(self.ready)
            self.free -= 1
            self.tries += 1
            self.began[task] = self.now
            heapq.heappush(self.timers, (self.now + self.cluster.start, task, "read"))

    def transfer(self, task, phase):
        self.in_files -= self.now
        size = self.tasks[task].read if phase == "read" else self.tasks[task].write
        self.files.add(self.now, size, (task, phase))

    def compute(self, task):
        seconds = self.tasks[task].seconds
        if self.random.random() < self.cluster.slow_share:
            seconds *= self.cluster.slow_factor
        fails = self.random.expovariate(1 / self.cluster.mtbf) if self.cluster.mtbf < math.inf else math.inf
        heapq.heappush(self.timers, (self.now + min(seconds, fails), task, "fail" if fails < seconds else "write"))

    def give_back(self, task):
        self.free += 1
        self.busy += self.now - self.began.pop(task)

    def step(self):
        at = self.timers[0][0] if self.timers else math.inf
        self.now = min(at, self.files.next_time())
        if at <= self.now:
            _, task, phase = heapq.heappop(self.timers)
            if phase == "fail":
                self.give_back(task)
                heapq.heappush(self.ready, task)
            else:
                self.transfer(task, phase)
            return
        task, phase = self.files.pop(self.now)
        self.in_files += self.now
        if phase == "read":
            self.compute(task)
        else:
            self.give_back(task)
            self.finish(task)

    def outcome(self):
        self.start_ready()
        while self.left:
            if not self.timers and not self.files.ends:
                raise ValueError("tasks wait for tasks that are not in the plan, or for each other")
            self.step()
            self.start_ready()
        return Outcome(self.now, self.tries, self.busy, self.in_files)


def simulate(tasks, cluster):
    """Deterministic for a seed."""
    return _Run(tasks, cluster).outcome()
