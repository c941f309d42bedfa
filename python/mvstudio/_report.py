"""What a stage returns."""
from __future__ import annotations

import json
from typing import Any, Mapping, NamedTuple

from mvstudio._error import Error, with_arguments


class Fields(dict):
    """A dict whose keys are attributes as well: ``report.metrics.rms_px``; nested dicts are ``Fields``, too."""

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"there is no {name!r}; there are {', '.join(self)}") from None

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self})


class Notice(NamedTuple):
    """A warning, or a reason why something failed."""

    code: str
    text: str
    hint: str
    fails: bool


class Output(NamedTuple):
    """A file or folder that was written."""

    path: str
    role: str


def _notices(items: list[dict[str, Any]]) -> list[Notice]:
    return [Notice(n["code"], with_arguments(n["text"]), with_arguments(n["hint"]), n["fails"]) for n in items]


class Report:
    """Figures, files and warnings of a stage: the JSON object that the program prints with ``--json``.

    Attributes
    ----------
    metrics : Fields
        The figures, by the names of the program's JSON; ``None`` for what is not finite.
    outputs : list of Output
        Files and folders that were written.
    inputs : list of str
        Files and folders that were read.
    warnings : list of Notice
        What should be known of the result.
    exit : int
        The program's exit code: 0 done, 4 a quality gate failed, 6 parts were left out and are listed.
    text : str
        What the program prints.
    """

    def __init__(self, stage: str, fields: Mapping[str, Any]) -> None:
        self.stage = stage
        self.metrics: Fields = fields["metrics"]
        self.outputs = [Output(item["path"], item["role"]) for item in fields["outputs"]]
        self.inputs: list[str] = list(fields["inputs"])
        self.warnings = _notices(fields["warnings"])
        self.exit: int = fields["exit"]
        self.text = with_arguments(fields["text"])

    @property
    def ok(self) -> bool:
        """Whether everything was done and every quality gate passed; there may be warnings."""
        return self.exit == 0

    def path(self, role: str) -> str:
        """The output of a role, such as ``"calibration"``; raises KeyError where there is none."""
        for output in self.outputs:
            if output.role == role:
                return output.path
        raise KeyError(role)

    def __repr__(self) -> str:
        return f"<{self.stage}: exit {self.exit}, {len(self.warnings)} warnings, metrics {', '.join(self.metrics)}>"

    def __str__(self) -> str:
        return self.text.rstrip("\n") or repr(self)

    def _repr_html_(self) -> str:
        escaped = self.text.replace("&", "&amp;").replace("<", "&lt;")
        return f"<pre>{escaped}</pre>"


def report_of(stage: str, text: str) -> Report:
    """The report in a JSON text; raises Error where it holds an error."""
    fields = json.loads(text, object_hook=Fields)
    report = Report(stage, fields)
    errors = _notices(fields["errors"])
    if errors:
        raise Error(errors[0].code, errors[0].text, errors[0].hint, report)
    return report
