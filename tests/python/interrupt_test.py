"""Ctrl-C ends what runs in C++, soon, and the process goes on."""
import os
import signal
import threading
import time

import conftest
import mvstudio
import numpy as np
import pytest


def test_ctrl_c_within_a_second():
    rig = mvstudio.Rig.from_json(conftest.rig_text())
    px = np.random.default_rng(1).uniform(0, 700, (4, 400000, 2))  # no views agree: the slowest kind of points
    sent = []

    def send():
        sent.append(time.process_time())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Timer(0.3, send).start()
    with pytest.raises(KeyboardInterrupt):
        mvstudio.triangulate(px, rig, threads=1)
    assert time.process_time() - sent[0] < 1  # of the processor: other programs may be running
    assert mvstudio.triangulate(px[:, :10], rig).x.shape == (10, 3)
