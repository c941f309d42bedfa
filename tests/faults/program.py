"""Runs the program under test with the fault library loaded, and tells what happened."""

import ctypes
import dataclasses
import errno
import os
import pathlib
import resource
import select
import signal
import socket
import struct
import subprocess

CLASSES = ["open", "create", "read", "write", "fsync", "rename", "mkdir", "unlink", "link", "close", "alloc"]
# Calls that change what is on the disk: killed before each of them, the program leaves every state that it can leave.
CHANGES = ["create", "write", "fsync", "rename", "mkdir", "unlink", "link"]
_LOG_BYTES = 8 * 18 + 1024 + 8192


@dataclasses.dataclass
class Fault:
    """What is to go wrong; see shim.cc."""
    classes: list
    n: int
    how: object = errno.EIO  # an errno, "kill", "killafter" or "torn"
    sticky: bool = False

    def environment(self):
        return {"MVS_FAULT_OP": ",".join(self.classes), "MVS_FAULT_N": str(self.n), "MVS_FAULT_ERRNO": str(self.how),
                "MVS_FAULT_STICKY": "1" if self.sticky else "0"}


@dataclasses.dataclass
class Outcome:
    exit: object  # a number, or the name of the signal that ended it, or "timeout"
    out: str
    err: str
    hit: int = 0
    counts: dict = dataclasses.field(default_factory=dict)
    together: int = 0
    what: str = ""
    trace: list = dataclasses.field(default_factory=list)


def exit_of(status):
    if os.WIFSIGNALED(status):
        return signal.Signals(os.WTERMSIG(status)).name
    return os.WEXITSTATUS(status)


def no_core_files():
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


class Program:
    """One copy of the program that waits, loaded, and forks itself for each run."""

    def __init__(self, binary, shim, watch, logs, environment):
        self.binary, self.watch, self.logs = str(binary), str(watch), pathlib.Path(logs)
        self.environment = dict(environment)
        self.logs.mkdir(parents=True, exist_ok=True)
        self.log = self.logs / "faults.log"
        mine, theirs = socket.socketpair()
        loaded = dict(self.environment, LD_PRELOAD=str(shim), MVS_FAULT_SERVER=str(theirs.fileno()))
        self.server = subprocess.Popen([self.binary, "version"], env=loaded, pass_fds=[theirs.fileno()], cwd="/",
                                       stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, preexec_fn=no_core_files)
        theirs.close()
        self.socket = mine

    def close(self):
        self.socket.close()
        self.server.wait()

    def _number(self, seconds):
        data = b""
        while len(data) < 4:
            if not select.select([self.socket], [], [], seconds)[0]:
                return None
            more = self.socket.recv(4 - len(data))
            if not more:
                raise RuntimeError("the server of the program under test has died: does it load with the fault library?")
            data += more
        return struct.unpack("i", data)[0]

    def run(self, argv, cwd, fault=None, seconds=120, environment=None):
        """Runs `mvstudio argv` in the folder `cwd`; a run that hangs is killed."""
        out, err = self.logs / "stdout", self.logs / "stderr"
        fault = fault or Fault(CHANGES, 0)
        self.log.write_bytes(bytes(_LOG_BYTES))
        env = dict(self.environment, **(environment or {}), **fault.environment(), MVS_FAULT_PATH=self.watch,
                   MVS_FAULT_LOG=str(self.log))
        words = [self.binary, *map(str, argv)]
        fields = [str(cwd), str(out), str(err), str(len(words)), *words, *(f"{k}={v}" for k, v in env.items())]
        blob = b"".join(field.encode() + b"\0" for field in fields)
        self.socket.sendall(struct.pack("I", len(blob)) + blob)
        child = self._number(20)
        status = self._number(seconds)
        hung = status is None
        if hung:
            os.kill(child, signal.SIGKILL)
            status = self._number(20)
        try:
            os.killpg(child, signal.SIGKILL)  # its children, if it has left any
        except ProcessLookupError:
            pass
        outcome = Outcome("timeout" if hung else exit_of(status), out.read_text(errors="replace"), err.read_text(errors="replace"))
        self._read_log(outcome)
        return outcome

    def _read_log(self, outcome):
        data = self.log.read_bytes()
        numbers = struct.unpack_from("18Q", data)
        outcome.counts = dict(zip(CLASSES, numbers))
        outcome.together, outcome.hit = numbers[16], numbers[17]
        text = data[8 * 18:]
        outcome.what = text[:1024].split(b"\0")[0].decode(errors="replace")
        outcome.trace = text[1024:].split(b"\0")[0].decode(errors="replace").split()

    def start(self, argv, cwd, tag):
        """A run in a process of its own, without the fault library."""
        with open(self.logs / f"stdout-{tag}", "wb") as out, open(self.logs / f"stderr-{tag}", "wb") as err:
            return subprocess.Popen([self.binary, *map(str, argv)], cwd=cwd, env=self.environment, stdin=subprocess.DEVNULL,
                                    stdout=out, stderr=err, start_new_session=True, preexec_fn=no_core_files)

    def text_of(self, tag):
        return (self.logs / f"stderr-{tag}").read_text(errors="replace")


class Symbols:
    """Names of the functions on a trace, from the program's symbol table."""

    def __init__(self, binary):
        self.binary, self.table = str(binary), None

    def _load(self):
        listing = subprocess.run(["nm", "-C", "--defined-only", self.binary], capture_output=True, text=True, check=False).stdout
        table = []
        for line in listing.splitlines():
            parts = line.split(" ", 2)
            if len(parts) == 3 and parts[1] in "tTwW":
                table.append((int(parts[0], 16), parts[2]))
        self.table = sorted(table)
        self.starts = [address for address, _ in self.table]

    def names(self, trace, most=6):
        import bisect
        if self.table is None:
            self._load()
        names = []
        for frame in trace:
            module, _, offset = frame.rpartition("+")
            if os.path.realpath(module) != os.path.realpath(self.binary):
                name = "[" + os.path.basename(module) + "]"
            else:
                at = bisect.bisect_right(self.starts, int(offset, 16)) - 1
                name = self.table[at][1] if at >= 0 else "?"
                name = name.replace("mvstudio::", "").replace("(anonymous namespace)::", "").replace("std::__cxx11::", "")
                name = name.split("(")[0][:80]
            if name in ("[libc.so.6]", "[libmvstudio_faults.so]", "_start"):
                continue
            if not names or names[-1] != name:
                names.append(name)
        return names[:most]


def unshare_supported():
    """Whether this process may mount file systems."""
    libc = ctypes.CDLL(None, use_errno=True)
    return os.geteuid() == 0 and libc.umount2(b"/nonexistent-folder", 0) != 0 and ctypes.get_errno() == errno.ENOENT
