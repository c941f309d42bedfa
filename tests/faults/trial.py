"""One command under test: where it runs, what is there before and after, and every fault that is tried on it."""

import collections
import errno
import os
import random
import shutil
import subprocess
import time

import snapshot
import verdict
from program import CHANGES, Fault

# Class of calls -> how they fail, in turn.
ERRORS = {"open": [errno.EIO, errno.EACCES], "create": [errno.ENOSPC, errno.EACCES], "read": [errno.EIO],
          "write": [errno.ENOSPC, errno.EIO], "fsync": [errno.EIO], "rename": [errno.EIO, errno.ENOSPC],
          "mkdir": [errno.ENOSPC, errno.EACCES], "unlink": [errno.EIO], "link": [errno.EPERM, errno.EIO], "close": [errno.EIO],
          "alloc": [errno.ENOMEM]}
# Column of the table -> the calls that it counts together, and what happens there.
KILLS = {"kill": (CHANGES, "kill"), "torn": (["write"], "torn"), "killafter": (["rename", "mkdir", "link", "unlink"], "killafter")}
DEAD_DISK = {"full": (["create", "write", "mkdir", "fsync", "link"], errno.ENOSPC),
             "read-only": (["create", "mkdir", "unlink", "rename", "link"], errno.EROFS)}
COLUMNS = [*ERRORS, *DEAD_DISK, *KILLS, "tmpfs", "ro-out", "ro-in", "pair", "names"]
# Told, and counted apart: the result stands, but its command says that it failed, or has no record of all of it; a library of
# others ended the process when it got no memory.
NOTES = {"late", "unrecorded", "third-party"}
GROUPS = [list(ERRORS)[:5], list(ERRORS)[5:] + [*DEAD_DISK], [*KILLS, "tmpfs", "ro-out", "ro-in", "pair", "names"]]
# What stands beside the box's own files while other names are tried. `deep/latest/..` is the box for the system, and `deep` for who
# reads the text alone.
LINKS = {"deep/latest": "../aside", "deep/back": ".."}
RESERVED = ["any.result.json", "provenance.jsonl", ".mvstudio.json", ".mvstudio-" + "0a" * 16, ".mvstudio.any.lock"]


def sample(count, most, seed):
    """Which of `count` places: all, or the last, some chosen once for all, and the first two."""
    if count <= most:
        return list(range(count, 0, -1))
    rest = random.Random(seed).sample(range(3, count), max(0, min(most - 3, count - 3)))
    return ([count] + sorted(rest) + [1, 2])[:most]


class Box:
    """The folder that one command runs in, made anew for every run at the same path."""

    def __init__(self, root, template):
        self.path, self.template = root / "box", template
        self.mounted = False

    def clear(self):
        if self.mounted:
            subprocess.run(["umount", "-l", self.path], check=True)
            self.mounted = False
        shutil.rmtree(self.path, ignore_errors=True)

    def restore(self):
        self.clear()
        shutil.copytree(self.template, self.path, symlinks=True)

    def restore_on_tmpfs(self, extra_bytes=None):
        """On a file system of its own, with so many bytes to spare."""
        self.clear()
        self.path.mkdir()
        if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=2g", "tmpfs", self.path], capture_output=True, check=False).returncode:
            return False
        self.mounted = True
        shutil.copytree(self.template, self.path, symlinks=True, dirs_exist_ok=True)
        if extra_bytes is not None:
            self.remount(f"size={self.used() + extra_bytes}")
        return True

    def used(self):
        disk = os.statvfs(self.path)
        return (disk.f_blocks - disk.f_bfree) * disk.f_frsize

    def remount(self, options):
        subprocess.run(["mount", "-o", "remount," + options, self.path], check=True)


class Trial:
    """One command: its box, what is there before and after, and the faults."""

    def __init__(self, case, program, watch, inputs, spare, options):
        self.case, self.program, self.inputs, self.options = case, program, inputs, options
        self.box = Box(watch, spare / "template")
        self.findings, self.tried, self.places = [], collections.Counter(), {}
        self.reruns = {}
        self.deadline = None

    def argv(self, words):
        return [str(w).replace("{in}", str(self.inputs)) for w in words]

    def run(self, fault=None, words=None):
        return self.program.run(self.argv(words or self.case.argv), self.box.path, fault, environment=self.case.environment,
                                seconds=self.case.seconds)

    def state(self):
        return snapshot.take(self.box.path, self.case.ignore, self.case.measured)

    # ---- before any fault

    def prepare(self):
        shutil.rmtree(self.box.template, ignore_errors=True)
        self.box.template.mkdir(parents=True)
        self.case.fill(self.box.template, self.inputs, self.case.foreign)
        self.box.restore()
        for words in self.case.old:
            done = self.run(words=words)
            if done.exit not in (0, self.case.exit):
                raise RuntimeError(f"{self.case.name}: the old state cannot be made: exit {done.exit}: {done.err.strip()[:400]}")
        self.case.fill(self.box.path, self.inputs, self.case.late)
        shutil.rmtree(self.box.template)
        shutil.copytree(self.box.path, self.box.template, symlinks=True)
        old = self.state()
        started = time.monotonic()
        reference = self.run()
        self.wall = time.monotonic() - started
        if reference.exit != self.case.exit:
            raise RuntimeError(f"{self.case.name}: undisturbed exit {reference.exit}: {reference.err.strip()[:400]}")
        self.states = verdict.States(old, self.state(), self.case.exit)
        self.counts, self.changes = reference.counts, reference.together
        if not self.changes:
            raise RuntimeError(f"{self.case.name}: the fault library saw no call that changes the disk")
        self.new_bytes = sum(p.lstat().st_size + 4096 for p in self.box.path.rglob("*"))
        if not self.states.changing:
            raise RuntimeError(f"{self.case.name}: old and new state are the same")
        self._is_reproducible()

    def _is_reproducible(self):
        """Without this nothing can be told from a difference."""
        self.box.restore()
        self.run()
        if self.state() != self.states.new:
            raise RuntimeError(f"{self.case.name}: two undisturbed runs differ: {snapshot.difference(self.state(), self.states.new)}")
        if self.case.overwrites:
            again = self.run()
            self.report("again", "-", 0, again, verdict.after_rerun(again, self.state(), self.states, self.case))

    # ---- faults

    def report(self, column, how, n, outcome, problems):
        for name, detail in problems:
            self.findings.append({"case": self.case.name, "class": column, "how": str(how), "n": n, "problem": name, "detail": detail,
                                  "what": outcome.what if outcome else "", "trace": outcome.trace if outcome else [],
                                  "exit": outcome.exit if outcome else None})

    def rerun(self, column, how, n, outcome):
        state = self.state()
        key = snapshot.key(state)
        if key not in self.reruns:
            again = self.run(words=self.case.again)
            after = self.state()
            self.reruns[key] = verdict.after_rerun(again, after, self.states, self.case)
        self.report(column, how, n, outcome, self.reruns[key])

    def one(self, column, fault, n):
        """Returns whether the fault was reached."""
        self.box.restore()
        outcome = self.run(fault)
        state = self.state()
        if not outcome.hit:
            return False
        self.tried[column] += 1
        if fault.how in ("kill", "torn", "killafter"):
            problems = verdict.after_kill(outcome, state, self.states, self.case)
        else:
            problems = verdict.after_error(outcome, state, self.states, self.case, column)
        self.report(column, fault.how, n, outcome, problems)
        if not (self.case.partial and outcome.exit == 6):
            self.rerun(column, fault.how, n, outcome)
        return True

    def places_of(self, column):
        classes = {**{k: [k] for k in ERRORS}, **{k: v[0] for k, v in {**KILLS, **DEAD_DISK}.items()}}[column]
        return sum(self.counts[c] for c in classes), classes

    def column(self, column, most):
        """All faults of a column as functions to be called, most telling first."""
        if column == "tmpfs":
            return [lambda share=share: self.full_disk(share) for share in ([0, 0.5] if most < 8 else [0, 0.02, 0.1, 0.25, 0.5, 0.75, 0.95])]
        if column == "ro-out":
            return [self.read_only_box]
        if column == "ro-in":
            return [self.read_only_inputs]
        if column == "pair":
            return [lambda at=at: self.pair(at) for at in ([0] if most < 8 else [0, 0, 0.3, 0.6, 0.9])]
        if column == "names":
            return self.other_names()
        count, classes = self.places_of(column)
        self.places[column] = count
        many = most * 2 if column == "kill" else min(most, 12) if column in DEAD_DISK else most
        jobs = []
        for n in sample(count, many, self.case.name + column):
            hows = [KILLS[column][1]] if column in KILLS else [DEAD_DISK[column][1]] if column in DEAD_DISK else ERRORS[column]
            fault = Fault(classes, n, hows[n % len(hows)], sticky=column in DEAD_DISK)
            jobs.append(lambda fault=fault, n=n: self.one(column, fault, n))
        return jobs

    def all(self, columns, most, deadline):
        columns = [c for c in columns if c not in self.case.without]
        work = [self.column(column, min(most, self.case.most)) for column in columns]
        if most < 8:  # a sample: turn about, so that every class has its share of the time
            rounds = [job for tier in zip(*[jobs + [None] * (40 - len(jobs)) for jobs in work]) for job in tier if job]
        else:
            rounds = [job for jobs in work for job in jobs]
        for job in rounds:
            if deadline and time.monotonic() > deadline:
                break
            job()
        self.box.clear()

    # ---- a full disk, a read-only one, two at once

    def full_disk(self, share):
        extra = int(share * self.new_bytes) // 4096 * 4096 + 4096
        if not self.box.restore_on_tmpfs(extra):
            return
        self.tried["tmpfs"] += 1
        outcome = self.run()
        state = self.state()
        outcome.what = f"tmpfs with {extra} bytes to spare"
        self.report("tmpfs", "ENOSPC", extra, outcome, verdict.after_error(outcome, state, self.states, self.case, "tmpfs"))
        self.box.remount("size=2g")
        self.rerun("tmpfs", "ENOSPC", extra, outcome)

    def read_only_box(self):
        if not self.box.restore_on_tmpfs():
            return
        self.tried["ro-out"] += 1
        self.box.remount("ro")
        outcome = self.run()
        outcome.what = "read-only file system"
        problems = verdict.after_error(outcome, self.state(), self.states, self.case, "ro-out")
        if outcome.exit == self.case.exit:
            problems.append(("silent", "success on a read-only file system"))
        self.report("ro-out", "EROFS", 0, outcome, problems)

    def read_only_inputs(self):
        """Inputs are only read: the result is the same where they cannot be written."""
        folder = str(self.inputs)
        if subprocess.run(["mount", "--bind", folder, folder], capture_output=True, check=False).returncode:
            return
        try:
            subprocess.run(["mount", "-o", "remount,bind,ro", folder], check=True)
            self.tried["ro-in"] += 1
            self.box.restore()
            outcome = self.run()
            outcome.what = "inputs on a read-only file system"
            self.report("ro-in", "EROFS", 0, outcome, verdict.after_rerun(outcome, self.state(), self.states, self.case))
        finally:
            subprocess.run(["umount", "-l", folder], check=True)

    def other_names(self):
        """Each output under other names of its place, under names that are kept, and through a folder that is not there."""
        jobs = []
        for at, word in enumerate(self.case.argv):
            if at == 0 or word.split("/")[0] not in ("out", "one.h5") or self.case.argv[at - 1] == "--cache":
                continue
            jobs += [lambda at=at, name=f"deep/{link}/{word}": self.other_name(at, name, True) for link in ("latest/..", "back")]
            folder = word[:word.rfind("/") + 1]
            jobs += [lambda at=at, name=name: self.other_name(at, name, False)
                     for name in [f"nowhere/../{word}", *(folder + reserved for reserved in RESERVED)]]
        return jobs

    def other_name(self, at, name, same):
        self.box.restore()
        (self.box.path / "deep").mkdir()
        (self.box.path / "aside").mkdir()
        for link, target in LINKS.items():
            (self.box.path / link).symlink_to(target)
        self.tried["names"] += 1
        words = list(self.case.argv)
        words[at] = name
        outcome = self.run(words=words)
        outcome.what = name
        state = self.state()
        for path in ("deep/", "aside/", *LINKS):
            state.pop(path, None)
        self.report("names", name, at, outcome, verdict.after_other_name(outcome, state, self.states, same))

    def pair(self, at):
        self.box.restore()
        self.tried["pair"] += 1
        words = self.argv(self.case.argv)
        first = self.program.start(words, self.box.path, "first")
        time.sleep(at * self.wall)
        second = self.program.start(words, self.box.path, "second")
        exits = []
        for process in (first, second):
            try:
                exits.append(process.wait(self.case.seconds * 2))
            except subprocess.TimeoutExpired:
                process.kill()
                exits.append("timeout")
        texts = [self.program.text_of("first"), self.program.text_of("second")]
        problems = verdict.after_pair(exits, texts, self.state(), self.states, self.case)
        self.report("pair", "two at once", 0, None, problems)
