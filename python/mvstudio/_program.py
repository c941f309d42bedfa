"""Commands of the program that have no function here: those that need libtorch."""
from __future__ import annotations

import json
import os
import shutil
import subprocess
from typing import Any, Optional

from mvstudio._error import Error
from mvstudio._report import Fields, Report, report_of


def _program() -> str:
    found = os.environ.get("MVSTUDIO_BIN") or shutil.which("mvstudio")
    if not found:
        raise Error("MISSING-TOOL", "there is no program `mvstudio` in PATH", "install it, or name it in MVSTUDIO_BIN")
    return found


def _words(option: str, value: Any) -> list[str]:
    """Flags of an option: a list gives one each, a dict NAME=VALUE each, True the flag alone, False its opposite."""
    flag = "--" + option.rstrip("_").replace("_", "-")
    if isinstance(value, bool):
        return [flag if value else "--no-" + flag[2:]]
    if isinstance(value, dict):
        return [word for key, item in value.items() for word in (flag, f"{key}={_text(item)}")]
    if isinstance(value, (list, tuple)):
        return [word for item in value for word in (flag, _text(item))]
    return [flag, _text(value)]


def _text(value: Any) -> str:
    return value if isinstance(value, str) else os.fspath(value) if hasattr(value, "__fspath__") else repr(value)


def command(name: str, *places: Any, overwrite: bool = False, threads: int = 0, seed: int = 1, **options: Any) -> Report:
    """Runs a command of the program `mvstudio`, in a process of its own.

    Parameters
    ----------
    name : str
        ``"avatar train"``.
    *places : str or path
        What has no flag: ``"dataset"``.
    overwrite : bool
        Whether results of an earlier run may be replaced.
    threads : int
        0: as many as the machine has.
    seed : int
    **options
        Those of docs/cli.md, with ``_`` for ``-``: ``steps=200``; None: not given.

    Returns
    -------
    Report

    Notes
    -----
    The program is that of MVSTUDIO_BIN, else `mvstudio` of PATH. What needs no libtorch is a function of `mvstudio.stages`, in this
    process.
    """
    words = [_program(), *name.split(), *map(_text, places), "--json", "--progress", "none", "--threads", str(threads), "--seed", str(seed)]
    words += ["--overwrite"] if overwrite else []
    words += [word for option, value in options.items() if value is not None for word in _words(option, value)]
    try:
        ended = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, check=False)
    except OSError as error:
        raise Error("MISSING-TOOL", f"{words[0]}: {error.strerror}", "name the program in MVSTUDIO_BIN") from None
    fields = _result(ended.stdout)
    if fields is None:
        raise Error("INTERNAL", f"`mvstudio {name}` ended with exit code {ended.returncode} and no result: {ended.stderr.strip()[-300:]}")
    for key in ("errors", "warnings"):
        for notice in fields[key]:
            notice.setdefault("hint", "")
            notice["fails"] = "level" in notice
    for output in fields["outputs"]:
        output.setdefault("role", "")
    return report_of(name, json.dumps({"inputs": [], "text": ended.stderr, **fields}))


def _result(text: str) -> Optional[Fields]:
    try:
        return Fields(json.loads(text))
    except ValueError:
        return None
