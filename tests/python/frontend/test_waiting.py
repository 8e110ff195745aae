"""Backends that died, and what they leave. Ctrl-C in each wait is in test_signals."""

import os
import signal

import pytest
from processes import WAIT

import o80


def test_a_killed_backend_is_an_error_and_its_history_stays(
    process: o80.robots.Process,
) -> None:
    arm = process.frontend()
    arm.wait_for(20, timeout=WAIT)
    os.kill(process.pid, signal.SIGKILL)
    with pytest.raises(o80.BackendKilled, match=process.segment):
        arm.wait_for(10**12, timeout=WAIT)

    assert arm.life == "killed"
    assert not arm.alive
    history = arm.history()
    assert history.iteration.tolist() == list(range(arm.oldest, arm.published + 1))
    assert len(history) > 20
    arm.add_command(0, 1.0)
    with pytest.raises(o80.BackendKilled):
        arm.pulse()
    arm.forget_added()
    with o80.Frontend(process.segment, dead=True) as late:
        assert late.published == arm.published
    arm.close()
