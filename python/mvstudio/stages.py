"""Every stage of the program that does without libtorch, as a function: ``mvstudio.stages.NAME(**options) -> Report``.

The functions are made from the stages' own lists of options: names, defaults and help are those of docs/cli.md, with ``_`` for
``-``. Besides its options every stage takes

overwrite : bool
    Whether results of an earlier run may be replaced.
progress : callable or None
    Called as ``progress(stage, done, total, note)`` some twenty times a second.
threads : int
    0: as many as the machine has.
seed : int
    Equal seeds give equal results.

Python's lock is free while a stage runs, and Ctrl-C ends it within a second. One stage runs at a time in a process.
"""
from __future__ import annotations

import inspect
from typing import Any, Callable

from mvstudio import _core
from mvstudio._error import Error, with_arguments
from mvstudio._report import Report, report_of

_TYPES = {"bool": "bool", "int": "int", "float": "float", "text": "str", "path": "str or path", "word": "str",
          "list": "str, list, or dict of NAME: VALUE"}
_COMMON = {"overwrite": False, "progress": None, "threads": 0, "seed": 1}


def _parameters(stage: dict[str, Any]) -> list[inspect.Parameter]:
    required = [f for f in stage["fields"] if f["name"] in stage["required"]]
    others = [f for f in stage["fields"] if f["name"] not in stage["required"]]
    parameters = [inspect.Parameter(f["name"], inspect.Parameter.POSITIONAL_OR_KEYWORD) for f in required]
    defaults = {f["name"]: f["default"] for f in others} | _COMMON
    return parameters + [inspect.Parameter(n, inspect.Parameter.KEYWORD_ONLY, default=d) for n, d in defaults.items()]


def _doc(stage: dict[str, Any]) -> str:
    lines = [stage["title"], "", f"The command ``mvstudio {stage['command']}`` as a function.", "", "Parameters", "----------"]
    for field in stage["fields"]:
        lines += [f"{field['name']} : {_TYPES[field['type']]}", f"    {with_arguments(field['help'])}"]
    lines += ["overwrite, progress, threads, seed", "    See :mod:`mvstudio.stages`.", "", "Returns", "-------", "Report"]
    return "\n".join(lines)


def _make(stage: dict[str, Any]) -> Callable[..., Report]:
    name = stage["name"]
    signature = inspect.Signature(_parameters(stage), return_annotation=Report)

    def run(*args: Any, **kwargs: Any) -> Report:
        given = signature.bind(*args, **kwargs).arguments
        common = {key: given.pop(key, default) for key, default in _COMMON.items()}
        return report_of(name, _core.run_stage(name, given, common["overwrite"], common["progress"], common["threads"],
                                               common["seed"]))

    run.__name__ = run.__qualname__ = name
    run.__module__ = __name__
    run.__doc__ = _doc(stage)
    run.__signature__ = signature  # type: ignore[attr-defined]
    return run


def options(name: str) -> list[dict[str, Any]]:
    """The options of a stage: dicts of ``name``, ``flag``, ``default``, ``type``, ``help`` and ``subject``."""
    for stage in _LIST:
        if stage["name"] == name:
            return [dict(field) for field in stage["fields"]]
    raise Error("CLI-USAGE", f"there is no stage {name!r}; there are {', '.join(s['name'] for s in _LIST)}")


def commands() -> dict[str, str]:
    """The stages' names and the commands of the program that do the same."""
    return {stage["name"]: stage["command"] for stage in _LIST}


_LIST = _core.stages()
for _stage in _LIST:
    globals()[_stage["name"]] = _make(_stage)
__all__ = ["commands", "options"] + [_stage["name"] for _stage in _LIST]
