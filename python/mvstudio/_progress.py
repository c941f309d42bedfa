"""Progress of long work, shown where somebody asks for it."""
from __future__ import annotations

import sys
from typing import Any, Callable, Optional

Callback = Callable[[str, int, int, str], object]


class _Bar:
    """A line a stage on stderr: tqdm's where it is installed, as in notebooks."""

    def __init__(self) -> None:
        self._make: Any = None
        self._bar: Any = None
        self._stage, self._width = "", 0
        try:
            from tqdm.auto import tqdm
            self._make = tqdm
        except ImportError:
            pass

    def __call__(self, stage: str, done: int, total: int, note: str) -> None:
        if self._make is None:
            text = f"{stage} {done}{f'/{total}' if total >= done and total > 0 else ''}  {note}".rstrip()
            end = "\n" if self._stage not in ("", stage) else "\r"
            sys.stderr.write((end if self._stage else "") + text.ljust(self._width if end == "\r" else 0))
            sys.stderr.flush()
            self._stage, self._width = stage, len(text)
            return
        if self._bar is None or stage != self._stage:
            self.close()
            self._bar, self._stage = self._make(desc=stage, total=total or None), stage
        self._bar.total = total or None
        self._bar.update(max(0, done - self._bar.n))

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
        elif self._make is None and self._stage:
            sys.stderr.write("\n")


class Shown:
    """With this: the callback of an argument `progress`, which may be None, True for a bar, or a callable."""

    def __init__(self, progress: Any) -> None:
        self._bar = _Bar() if progress is True else None
        self.callback: Optional[Callback] = self._bar or (None if progress is False else progress)

    def __enter__(self) -> Optional[Callback]:
        return self.callback

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()
