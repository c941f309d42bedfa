"""Runs `mvstudio` on a recording and keeps what it said."""

import dataclasses
import json
import os
import pathlib
import subprocess
import time

TIMEOUT_S = 120


@dataclasses.dataclass
class Run:
    exit: object          # exit code, or "timeout"
    result: dict          # the JSON object of stdout; {} where there is none
    calibration: dict     # calibration.json, or None
    errors: str           # stderr
    seconds: float

    def messages(self):
        """(code, text, hint) of everything that was said."""
        said = [(m.get("code", ""), m.get("text", ""), m.get("hint") or "")
                for m in (self.result.get("errors") or []) + (self.result.get("warnings") or [])]
        if self.exit not in (0, 4) and not self.result.get("errors"):
            said += [("", line, "") for line in self.errors.splitlines() if line.strip()]
        return [m for m in said if m[0] != "CLI-PROVENANCE"]


def environment(folder):
    keep = {k: os.environ[k] for k in ("PATH", "LANG", "LD_LIBRARY_PATH") if k in os.environ}
    return dict(keep, HOME=str(folder), MVSTUDIO_CACHE="off", OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", GOMP_SPINCOUNT="1000")


def write(recording, folder):
    """The recording's files in `folder`; returns the path of the corners."""
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in recording.files.items():
        (folder / name).write_text(text)
    path = folder / f"corners.{recording.extension()}"
    path.write_bytes(recording.text().encode())
    return path


def arguments(recording, folder, corners, model=None):
    more = [a.replace("{folder}", str(folder)) for a in recording.arguments]
    boards = [] if recording.second else ["--board", recording.board_text.replace("{folder}", str(folder))]
    return ["--corners", str(corners), *boards, *recording.size_arguments(), *more,
            *(["--model", model] if model else [])]


def execute(binary, command, folder, out=None, timeout=TIMEOUT_S):
    """One command with --json; `out` is the folder that it writes a calibration to."""
    started = time.monotonic()
    words = [str(binary), *command, "--json", "--threads", "1", *(["--out", str(out)] if out else [])]
    try:
        done = subprocess.run(words, env=environment(folder), cwd=folder, capture_output=True, timeout=timeout, errors="replace")
        code, text, errors = done.returncode, done.stdout, done.stderr
    except subprocess.TimeoutExpired:
        code, text, errors = "timeout", "", f"no end within {timeout} s"
    try:
        result = json.loads(text)
    except ValueError:
        result = {}
    written = pathlib.Path(out) / "calibration.json" if out else None
    calibration = json.loads(written.read_text()) if written and written.exists() and code in (0, 4) else None
    return Run(code, result, calibration, errors, time.monotonic() - started)


def calibrate(binary, recording, folder, model=None, timeout=TIMEOUT_S):
    folder = pathlib.Path(folder)
    corners = write(recording, folder)
    out = folder / ("out-" + (model or "auto"))
    return execute(binary, ["calibrate", *arguments(recording, folder, corners, model)], folder, out, timeout)
