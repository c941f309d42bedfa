"""Every stage of the program that does without libtorch, as a function: ``mvstudio.stages.NAME(**options) -> Report``.

The functions are made from the stages' own lists of options: names, defaults and help are those of docs/cli.md, with ``_`` for
``-``. Besides its options every stage takes

overwrite : bool
    Whether results of an earlier run may be replaced.
progress : callable, bool or None
    Called as ``progress(stage, done, total, note)`` some twenty times a second. True: shown on stderr, by tqdm where it is installed.
threads : int
    0: as many as the machine has.
seed : int
    Equal seeds give equal results.

Python's lock is free while a stage runs, and Ctrl-C ends it within a second. One stage runs at a time in a process.
"""
from __future__ import annotations

import difflib
import inspect
from typing import Any, Callable, Iterable

from mvstudio import _core
from mvstudio._error import Error, with_arguments
from mvstudio._program import text_of, words_of
from mvstudio._progress import Shown
from mvstudio._report import Report, report_of

_TYPES = {"bool": "bool", "int": "int", "float": "float", "text": "str, or list of them", "path": "str or path", "word": "str",
          "list": "str, list, or dict of NAME: VALUE"}
_COMMON = {"overwrite": False, "progress": None, "threads": 0, "seed": 1}
_PLACES = {"calib_eval": "calibration", "dataset_pack": "dataset", "report": "runs"}  # the command's place that need not be given
# Places of the commands, where there is not one.
_NUM_PLACES = {"board_propose": 0, "calib_compare": 2, "calib_lenses_add": 2, "calib_refine": 0, "calibrate": 0, "dataset_build": 0, "error_budget": 0,
               "metrics": 2, "sync": 0, "synth": 0, "triangulate": 0}
_GO_ON = ("calib_lenses_add", "dataset_pack", "dataset_verify", "report", "session_trust")  # their commands add to what is there, and have no --overwrite


def _parameters(stage: dict[str, Any]) -> list[inspect.Parameter]:
    """What is required comes first; where the command has a place that is not, that place, and the rest has to be named."""
    either, named = inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY
    defaults = {f["name"]: f["default"] for f in stage["fields"] if f["name"] not in stage["required"]} | _COMMON
    required = [f["name"] for f in stage["fields"] if f["name"] in stage["required"]]
    place = _PLACES.get(stage["name"])
    if place is None:
        parameters = [inspect.Parameter(name, either) for name in required]
    else:
        parameters = [inspect.Parameter(place, either, default=defaults.pop(place))] + [inspect.Parameter(name, named) for name in required]
    return parameters + [inspect.Parameter(name, named, default=default) for name, default in defaults.items()]


def _doc(stage: dict[str, Any]) -> str:
    lines = [stage["title"], "", f"The command ``mvstudio {stage['command']}`` as a function.", "", "Parameters", "----------"]
    for field in stage["fields"]:
        lines += [f"{field['name']} : {_TYPES[field['type']]}", f"    {with_arguments(field['help'])}"]
    lines += ["overwrite, progress, threads, seed", "    See :mod:`mvstudio.stages`.", "", "Returns", "-------", "Report"]
    return "\n".join(lines)


def _value(kind: str, value: Any) -> Any:
    """A list of words or numbers where the program takes them in one text: with commas."""
    if kind != "text" or isinstance(value, (str, bytes, dict)) or not isinstance(value, Iterable):
        return value
    return ",".join(str(item) for item in value)


def _bound(name: str, signature: inspect.Signature, args: Any, kwargs: Any) -> dict[str, Any]:
    """The arguments by name; a TypeError names the function and what may have been meant."""
    for unknown in kwargs.keys() - signature.parameters.keys():
        near = difflib.get_close_matches(unknown, signature.parameters, 1, 0.5)
        meant = f"; did you mean `{near[0]}`?" if near else f"; help(mvstudio.stages.{name}) lists them"
        raise TypeError(f"{name}() got an unexpected keyword argument '{unknown}'{meant}")
    try:
        return dict(signature.bind(*args, **kwargs).arguments)
    except TypeError as error:
        places = [p.name for p in signature.parameters.values() if p.kind is p.POSITIONAL_OR_KEYWORD]
        raise TypeError(f"{name}(): {error}; without a name it takes {', '.join(places) or 'nothing'}") from None


def _places(name: str, parameters: Iterable[str]) -> list[str]:
    """What the stage's command takes without a flag: the first parameters."""
    return list(parameters)[:_NUM_PLACES.get(name, 1)]


def _argv(stage: dict[str, Any], given: dict[str, Any], places: list[str], common: dict[str, Any]) -> list[str]:
    """The program's command line that does the same, for the record of what made a result."""
    words = ["mvstudio", *stage["command"].split()]
    for name in places:
        value = given.get(name, ())
        words += [text_of(item) for item in (value if isinstance(value, (list, tuple)) else [value])]
    for field in stage["fields"]:
        if field["name"] in given and field["name"] not in places:
            words += words_of(field["flag"].split(",")[0], given[field["name"]])
    words += ["--overwrite"] if common["overwrite"] else []
    return words + [word for key in ("threads", "seed") if common[key] != _COMMON[key] for word in words_of(key, common[key])]


def _make(stage: dict[str, Any]) -> Callable[..., Report]:
    name = stage["name"]
    signature = inspect.Signature(_parameters(stage), return_annotation=Report)
    kinds = {field["name"]: field["type"] for field in stage["fields"]}
    places = _places(name, signature.parameters)

    def run(*args: Any, **kwargs: Any) -> Report:
        given = {key: _value(kinds.get(key, ""), value) for key, value in _bound(name, signature, args, kwargs).items()}
        common = {key: given.pop(key, default) for key, default in _COMMON.items()}
        with Shown(common["progress"]) as callback:
            return report_of(name, _core.run_stage(name, given, common["overwrite"] or name in _GO_ON, callback, common["threads"],
                                                   common["seed"], _argv(stage, given, places, common)))

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
