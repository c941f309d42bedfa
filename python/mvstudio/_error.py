"""The one exception of mvstudio."""
from __future__ import annotations

import keyword
import re

_OPTION = re.compile(r"\boption '([a-zA-Z0-9][a-z0-9-]*)'")


def argument(option: str) -> str:
    """Python's name of an option: ``max-error-px`` is ``max_error_px``, ``from`` is ``from_``."""
    name = option.replace("-", "_")
    return name + "_" if keyword.iskeyword(name) else name


def with_arguments(text: str) -> str:
    """A text of the library with Python's names for options."""
    return _OPTION.sub(lambda found: f"`{argument(found.group(1))}`", text)


class Error(ValueError, RuntimeError):
    """What mvstudio could not do, in one line: what, where, the likely cause and what to do.

    Attributes
    ----------
    code : str
        The stable code of docs/reliability.md, such as ``"INPUT-FORMAT"`` or ``"CLI-USAGE"``.
    hint : str
        What to do about it; may be empty.
    report : Report or None
        What the stage found before it gave up.
    """

    __module__ = "mvstudio"  # where users find it, and what tracebacks say

    def __init__(self, code: str, text: str, hint: str = "", report: object = None) -> None:
        super().__init__(text + (f" ({hint})" if hint else ""))
        self.code = code
        self.text = text
        self.hint = hint
        self.report = report

    def __reduce__(self) -> tuple[type[Error], tuple[str, str, str]]:
        return type(self), (self.code, self.text, self.hint)

    @classmethod
    def of(cls, code: str, text: str, hint: str = "", report: object = None) -> Error:
        """The error with the names that Python has for options."""
        return cls(code, with_arguments(text), with_arguments(hint), report)
