"""Commands of the program that have no function here: those that need libtorch."""
from __future__ import annotations

import codecs
import io
import json
import os
import re
import shutil
import signal
import subprocess
import threading
from typing import IO, Any, Optional

from mvstudio._error import Error
from mvstudio._progress import Callback, Shown
from mvstudio._report import Fields, Report, report_of


def _program() -> str:
    found = os.environ.get("MVSTUDIO_BIN") or shutil.which("mvstudio")
    if not found:
        raise Error("MISSING-TOOL", "there is no program `mvstudio` in PATH", "install it, or name it in MVSTUDIO_BIN")
    return found


def words_of(option: str, value: Any) -> list[str]:
    """Flags of an option: a list gives one each, a dict NAME=VALUE each, True the flag alone, False its opposite."""
    flag = "--" + option.rstrip("_").replace("_", "-")
    if isinstance(value, bool):
        return [flag if value else "--no-" + flag[2:]]
    if isinstance(value, dict):
        return [word for key, item in value.items() for word in (flag, f"{key}={text_of(item)}")]
    if isinstance(value, (list, tuple)):
        return [word for item in value for word in (flag, text_of(item))]
    return [flag, text_of(value)]


def text_of(value: Any) -> str:
    return value if isinstance(value, str) else os.fspath(value) if hasattr(value, "__fspath__") else repr(value)


_PATIENCE_S = 10  # for the program to end after it was asked to
_STATE = re.compile(r"(.*) (\d+)(?:/(\d+))?  (?:[\d.]+/s|[\d.]+ s each)(?:  ETA [\d.]+ \w+)?  (.*)")
_State = tuple[str, int, int, str]


class _Said:
    """What a program writes to stderr: lines, and the latest state of its bar, which begins with a carriage return."""

    def __init__(self, stream: IO[bytes]) -> None:
        self.lines: list[str] = []
        self.state: Optional[_State] = None
        self._stream = stream
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        held, decoder = "", codecs.getincrementaldecoder("utf-8")("replace")
        while data := os.read(self._stream.fileno(), 65536):
            *lines, held = re.split(r"[\r\n]", held + decoder.decode(data))
            for line in lines:
                self._take(line)
            if held.startswith("\033[K"):
                self._take(held)
        self._take(held)

    def _take(self, line: str) -> None:
        if not line.startswith("\033[K"):
            self.lines += [line] if line else []
            return
        shown = line[3:]
        found = _STATE.fullmatch(shown)
        if found:
            self.state = (found[1], int(found[2]), int(found[3] or 0), found[4])
        elif shown and not re.search(r" \d+(/\d+)?  ", shown):
            self.state = (shown, 0, 0, "")  # the name alone: a stage begins

    def text(self) -> str:
        self._thread.join()
        return "\n".join(self.lines)


def _ended(process: subprocess.Popen[bytes], said: _Said, callback: Optional[Callback]) -> None:
    """Waits, and shows progress meanwhile; after Ctrl-C or an exception of the callback the program is asked to end."""
    shown = None
    try:
        while True:
            try:
                process.wait(timeout=0.05)
                return
            except subprocess.TimeoutExpired:
                state = said.state
                if callback is not None and state is not None and state != shown:
                    shown = state
                    callback(*state)
    except BaseException:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(timeout=_PATIENCE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        raise


def _run(words: list[str], progress: Any) -> tuple[str, str, int]:
    """What the program printed, what it said on stderr, and its exit code."""
    try:
        # A group of its own: Ctrl-C in a terminal reaches this process, which passes it on once. A process that is killed cannot: the
        # program ends with the thread that started it, this one, which waits. Its group may not read the terminal.
        process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, process_group=0,
                                   env=os.environ | {"MVSTUDIO_CALLER": str(os.getpid())})
    except OSError as error:
        raise Error("MISSING-TOOL", f"{words[0]}: {error.strerror}", "name the program in MVSTUDIO_BIN") from None
    assert process.stdout is not None and process.stderr is not None
    with Shown(progress) as callback, process.stdout, process.stderr:
        said, printed = _Said(process.stderr), io.BytesIO()
        reader = threading.Thread(target=shutil.copyfileobj, args=(process.stdout, printed), daemon=True)
        reader.start()
        _ended(process, said, callback)
        reader.join()
        return printed.getvalue().decode("utf-8", "replace"), said.text(), process.returncode


def command(name: str, *places: Any, overwrite: bool = False, progress: Any = None, threads: int = 0, seed: int = 1,
            **options: Any) -> Report:
    """Runs a command of the program `mvstudio`, in a process of its own.

    Parameters
    ----------
    name : str
        ``"avatar train"``.
    *places : str or path
        What has no flag: ``"dataset"``.
    overwrite : bool
        Whether results of an earlier run may be replaced.
    progress : callable, bool or None
        ``progress(stage, done, total, note)``; True: shown on stderr.
    threads : int
        0: as many as the machine has.
    seed : int
    **options
        Those of docs/cli.md, with ``_`` for ``-``: ``steps=200``; a list gives a flag each, a dict ``NAME=VALUE``; None: not given.

    Returns
    -------
    Report

    Notes
    -----
    The program is that of MVSTUDIO_BIN, else `mvstudio` of PATH. Ctrl-C, or an exception of the callback, ends it; it keeps what it
    keeps when it is interrupted (docs/reliability.md). What needs no libtorch is a function of `mvstudio.stages`, in this process.
    """
    shown = "none" if progress is None or progress is False else "bar"
    words = [_program(), *name.split(), *map(text_of, places), "--json", "--progress", shown, "--threads", str(threads), "--seed", str(seed)]
    words += ["--overwrite"] if overwrite else []
    words += [word for option, value in options.items() if value is not None for word in words_of(option, value)]
    printed, said, code = _run(words, progress)
    fields = _result(printed)
    if fields is None:
        raise Error("INTERNAL", f"`mvstudio {name}` ended with exit code {code} and no result: {said.strip()[-300:]}")
    for key in ("errors", "warnings"):
        for notice in fields[key]:
            notice.setdefault("hint", "")
            notice["fails"] = "level" in notice
    for output in fields["outputs"]:
        output.setdefault("role", "")
    return report_of(name, json.dumps({"inputs": [], "text": said, **fields}))


def _result(text: str) -> Optional[Fields]:
    try:
        return Fields(json.loads(text))
    except ValueError:
        return None
