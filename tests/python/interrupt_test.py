"""Ctrl-C ends what runs in C++, soon, and the process goes on."""
import os
import signal
import subprocess
import sys
import time

import conftest
import mvstudio

SCRIPT = """
import sys, time
sys.path.insert(0, {package!r}); sys.path.insert(0, {tests!r})
import conftest, mvstudio, numpy as np
rig = mvstudio.Rig.from_json(conftest.rig_text())
px = np.random.default_rng(1).uniform(0, 700, (4, 2000000, 2))
def begun(*state):
    print("begun", flush=True)
try:
    mvstudio.triangulate(px, rig, progress=begun)
    print("done")
except KeyboardInterrupt:
    print("interrupted", mvstudio.triangulate(px[:, :10], rig).x.shape, flush=True)
"""


def test_ctrl_c_within_a_second():
    package = os.path.dirname(os.path.dirname(mvstudio.__file__))
    script = SCRIPT.format(package=package, tests=os.path.dirname(conftest.__file__))
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout.readline() == "begun\n"
        begun = time.monotonic()
        child.send_signal(signal.SIGINT)
        said = [line for line in child.stdout if line != "begun\n"]
        seconds = time.monotonic() - begun
    assert said == ["interrupted (10, 3)\n"] and seconds < 1
