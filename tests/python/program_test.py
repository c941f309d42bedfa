"""Commands of the program from Python: their progress, and what ends them."""
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time

import conftest  # noqa: F401  (where mvstudio is)
import mvstudio
import numpy as np
import pytest
from mvstudio import _program, _progress

STUDIO = dict(cameras=4, size="160x120", board_frames=0, texture_px=64, samples=1)


def running(out):
    """Processes whose command line names a folder."""
    return [path for path in pathlib.Path("/proc").glob("[0-9]*/cmdline") if str(out).encode() in read(path)]


def read(path):
    try:
        return path.read_bytes()
    except OSError:
        return b""


def test_progress_is_the_programs(tmp_path):
    calls = []
    report = mvstudio.command("synth", out=tmp_path / "studio", take_frames=8, **STUDIO, progress=lambda *state: calls.append(state))
    assert report.ok and "person footage" in {stage for stage, *_ in calls}
    for stage, done, total, note in calls:
        assert 0 <= done and (total == 0 or done <= total) and isinstance(note, str) and "\033" not in stage
    assert (tmp_path / "studio/mvstudio.toml").exists()


def test_an_exception_of_the_callback_ends_the_program(tmp_path):
    def stop(*state):
        raise LookupError("enough")
    with pytest.raises(LookupError, match="enough"):
        mvstudio.command("synth", out=tmp_path / "studio", take_frames=2000, **STUDIO, progress=stop)
    assert running(tmp_path / "studio") == [] and not (tmp_path / "studio").exists()


def test_ctrl_c_ends_the_program(tmp_path):
    threading.Timer(0.8, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        mvstudio.command("synth", out=tmp_path / "studio", take_frames=2000, **STUDIO)
    assert running(tmp_path / "studio") == [] and not (tmp_path / "studio").exists()


def test_the_program_ends_with_a_python_that_is_killed(tmp_path):
    script = ("import sys; sys.path.insert(0, sys.argv[1]); import mvstudio\n"
              "said = lambda *state: print(state, flush=True)\n"
              f"mvstudio.command('synth', out=sys.argv[2], take_frames=2000, **{STUDIO!r}, progress=said)")
    words = [sys.executable, "-c", script, os.path.dirname(os.path.dirname(mvstudio.__file__)), str(tmp_path / "studio")]
    with subprocess.Popen(words, stdout=subprocess.PIPE) as python:
        python.stdout.readline()  # the program is at work
        assert len(running(tmp_path / "studio")) >= 2
        python.kill()
    while running(tmp_path / "studio"):  # ctest ends a test that hangs
        time.sleep(0.05)
    assert not (tmp_path / "studio").exists() and list(tmp_path.iterdir()) == []


def test_states_of_the_bar():
    said = _program._Said.__new__(_program._Said)
    said.lines, said.state = [], None
    for line, state in [("\033[Kfitting the body", ("fitting the body", 0, 0, "")), ("\033[Kpose2d 12/89  8.9/s  ETA 9 s  cam_01", ("pose2d", 12, 89, "cam_01")),
                        ("\033[Ktraining 3  4.0 s each  loss 0.2", ("training", 3, 0, "loss 0.2")), ("\033[K", ("training", 3, 0, "loss 0.2")),
                        ("warning: a line", ("training", 3, 0, "loss 0.2"))]:
        said._take(line)
        assert said.state == state
    assert said.lines == ["warning: a line"]


def test_a_bar_without_tqdm_is_a_line_a_stage(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    with _progress.Shown(True) as callback:
        callback("reading", 1, 4, "")
        callback("reading", 4, 4, "left")
        callback("writing", 1, 0, "")
    assert capsys.readouterr().err.splitlines()[-1] == "writing 1" and _progress.Shown(None).callback is None


def test_a_bar_by_tqdm(monkeypatch):
    """With a module of tqdm's interface, as Debian's python3-tqdm need not be there."""
    bars = []

    class Bar:
        def __init__(self, desc, total):
            self.desc, self.total, self.n, self.closed = desc, total, 0, False
            bars.append(self)

        def update(self, by):
            self.n += by

        def close(self):
            self.closed = True
    monkeypatch.setitem(sys.modules, "tqdm.auto", type("module", (), {"tqdm": Bar}))
    rig = mvstudio.Rig.from_json(conftest.rig_text())
    px = np.random.default_rng(1).uniform(0, 700, (4, 40000, 2))
    mvstudio.triangulate(px, rig, progress=True)
    assert bars and all(bar.closed for bar in bars) and bars[-1].n == bars[-1].total


def test_a_program_that_says_nothing_is_an_error(tmp_path, monkeypatch):
    script = tmp_path / "mvstudio"
    script.write_text("#!/bin/sh\necho broken >&2\nexit 9\n", encoding="utf-8")
    script.chmod(0o755)
    monkeypatch.setenv("MVSTUDIO_BIN", str(script))
    with pytest.raises(mvstudio.Error, match="exit code 9 and no result: broken"):
        mvstudio.command("version")
    script.write_text("#!/bin/sh\nyes '' | head -c 3000000 | tr '\\n' x\n", encoding="utf-8")  # more than a pipe holds
    with pytest.raises(mvstudio.Error, match="exit code 0 and no result"):
        mvstudio.command("version")


def test_scores_are_the_programs_to_the_bit(tmp_path):
    pictures = pytest.importorskip("PIL.Image", reason="needs python3-pil")
    draw = np.random.default_rng(5)
    for shape in ((40, 50, 3), (33, 64, 3)):  # the program reads grey files as three equal channels
        image = draw.integers(0, 256, shape, dtype=np.uint8)
        other = np.clip(image + draw.normal(size=shape) * 9, 0, 255).astype(np.uint8)
        for name, pixels in (("a.png", image), ("b.png", other)):
            pictures.fromarray(pixels).save(tmp_path / name)
        report = mvstudio.command("metrics", tmp_path / "a.png", tmp_path / "b.png")
        assert report.metrics.ssim == mvstudio.metrics.ssim(image, other) < 1
        assert report.metrics.psnr_db == mvstudio.metrics.psnr(image, other)
