"""Motions of the joints from now into the strike."""

import numpy as np
import pytest

from o80_table_tennis.players.swing import JointMotion, Swing

START = JointMotion(np.array([0.1, 1.0]), np.array([0.5, -0.2]), np.array([3.0, 1.0]))
END = JointMotion(np.array([0.4, 0.8]), np.array([2.0, 0.0]), np.array([0.0, 0.0]))


def test_it_goes_from_start_to_end() -> None:
    swing = Swing.between(START, END, 0.3)
    for motion, wanted in ((swing.at(0.0), START), (swing.at(0.3), END)):
        assert motion.q == pytest.approx(wanted.q)
        assert motion.dq == pytest.approx(wanted.dq)
        assert motion.ddq == pytest.approx(wanted.ddq)


def test_speeds_and_accelerations_are_derivatives() -> None:
    swing, small = Swing.between(START, END, 0.3), 1e-6
    before, after = swing.at(0.1), swing.at(0.1 + small)
    assert (after.q - before.q) / small == pytest.approx(before.dq, abs=1e-4)
    assert (after.dq - before.dq) / small == pytest.approx(before.ddq, abs=1e-3)


def test_it_goes_on_with_its_last_speed() -> None:
    swing = Swing.between(START, END, 0.3)
    assert swing.at(0.35).q == pytest.approx(END.q + 0.05 * END.dq)
