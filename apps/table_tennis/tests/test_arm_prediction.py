"""The arm is predicted over its dead time as it then moves."""

from contextlib import closing

import numpy as np
import pytest
from opened_environment import opened

from o80_table_tennis.players.arm_dynamics import ArmModel
from o80_table_tennis.players.arm_prediction import ArmPredictor, ArmState
from o80_table_tennis.players.hitting_policy import HittingSettings
from o80_table_tennis.task.observations import JOINT_POSITIONS, JOINT_VELOCITIES, PRESSURES
from o80_table_tennis.world.arm import JOINTS
from o80_table_tennis.world.timing import STEP

BEGIN = 0.004  # the action of step k acts from row k + 2 on


def test_speeds_follow_the_torques_of_the_model() -> None:
    model, rng, short = ArmModel(), np.random.default_rng(2), 1e-6
    for _ in range(20):
        q, dq = rng.uniform(-1, 1, 4), rng.uniform(-3, 3, 4)
        acceleration = rng.uniform(-20, 20, 4)
        torque = model.torque(q, dq, acceleration)
        change = (model.speeds_after(q, dq, torque, short) - dq) / short
        assert change == pytest.approx(acceleration, abs=0.02)


def test_the_motion_of_the_dead_time_is_predicted_from_the_actions_in_flight() -> None:
    """Nearer by far than the present state, or its speed continued."""
    rng, steps, dead_steps = np.random.default_rng(3), 60, [4, 4, 2, 1]
    with closing(opened(preset="identified")) as environment:
        settings = HittingSettings.of(environment.arm)
        predictor = ArmPredictor(
            settings.arm, settings.muscles, settings.lag, settings.dead_time, BEGIN
        )
        seen, _ = environment.reset(seed=1)
        rows, predicted = [], []
        predictor.start(seen[PRESSURES].astype(np.float64))
        action = np.zeros(8, np.float32)
        for step in range(steps):
            row = seen.astype(np.float64)
            rows.append(row)
            now = ArmState(row[JOINT_POSITIONS], row[JOINT_VELOCITIES], row[PRESSURES])
            predicted.append(predictor.predict(now))
            # there and back, so that no joint meets its stop
            if step % 8 == 0:
                action = 0.25 * rng.uniform(-1, 1, 8).astype(np.float32)
            elif step % 4 == 0:
                action = -action
            seen, *_ = environment.step(action)
            predictor.ask(environment.task.commanded()[0])

    for joint, ahead in enumerate(dead_steps):
        errors, moved, continued = [], [], []
        for step in range(8, steps - 4):
            later, present = rows[step + ahead], rows[step]
            errors.append(predicted[step].q[joint] - later[joint])
            moved.append(present[joint] - later[joint])
            continued.append(moved[-1] + ahead * STEP * present[JOINTS + joint])
            assert abs(later[joint]) < 1.5
            speed = predicted[step].dq[joint] - later[JOINTS + joint]
            assert abs(speed) < 0.35, (joint, step)
        error = float(np.std(errors))
        assert error < 0.25 * np.std(moved), joint
        if ahead > 1:
            assert error < 0.7 * np.std(continued), joint
