"""The policy that hits: its model of arm, muscles and ball, its search, and what it plays."""

import os
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

import o80_table_tennis
from o80_table_tennis.balls.sources import balls_from
from o80_table_tennis.physics.flight import predict_landing, simulated_shot
from o80_table_tennis.physics.racket_impact import RacketImpact
from o80_table_tennis.players.arm_dynamics import ArmModel
from o80_table_tennis.players.found_parameters import (
    FoundParameters,
    found_settings,
    with_parameters,
)
from o80_table_tennis.players.hitting_policy import HittingPolicy, HittingSettings
from o80_table_tennis.players.interception import (
    TOUCH,
    InterceptionSettings,
    StrikePlanner,
    coming_ball,
)
from o80_table_tennis.players.kinematics import (
    BLADE_THICKNESS,
    FOREARM,
    JOINT_LIMIT,
    SHOULDER,
    UPPER_ARM,
    posture_towards,
    racket_pose,
)
from o80_table_tennis.players.playing import play
from o80_table_tennis.players.policies import DEFAULT_FACTOR, default_policy
from o80_table_tennis.players.pressure_control import MusclePair, PressureActions, PressureLag
from o80_table_tennis.players.search import SCALES, Parameters, Score, search, start_parameters
from o80_table_tennis.players.swing import JointMotion, Swing
from o80_table_tennis.settings import TaskSettings
from o80_table_tennis.task.actions import COARSE, FINE, changed_pressures
from o80_table_tennis.task.observations import SIZE, ObservationBounds, pack_observation
from o80_table_tennis.world.scene import MODEL

ROOT = Path(__file__).resolve().parents[3]
DATA = Path(os.environ.get("O80_DATA", ROOT.parent / "shared" / "data"))
PLAYING = np.array([0.17, 1.1, 1.04, 0.5])
NARROW = 0.074  # from the middle of the blade to its nearest rim [m]
ARM = slice(0, 4)

Numbers = npt.NDArray[np.float64]
share = st.floats(0.0, 1.0)


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(MODEL))


def postures(count: int) -> list[Numbers]:
    return list(np.random.default_rng(3).uniform(-1.4, 1.4, (count, 4)))


def observed(q: Numbers, ball: Numbers, velocity: Numbers) -> npt.NDArray[np.float32]:
    """The arm at rest at `q`, half of all pressures in its muscles."""
    row = pack_observation(q, np.zeros(4), np.full(8, 0.5), ball, velocity)
    return row.astype(np.float32)


class TestKinematics:
    def test_the_racket_is_where_the_scene_has_it(self, model: mujoco.MjModel) -> None:
        data, racket = mujoco.MjData(model), model.body("racket").id
        for q in postures(40):
            data.qpos[ARM] = q
            mujoco.mj_kinematics(model, data)
            pose = racket_pose(q)
            assert pose.position == pytest.approx(data.xpos[racket], abs=1e-9)
            assert pose.normal == pytest.approx(data.xmat[racket].reshape(3, 3)[:, 1], abs=1e-9)

    def test_the_blade_is_as_thick_as_in_the_scene(self, model: mujoco.MjModel) -> None:
        assert model.geom("racket").size[1] == pytest.approx(BLADE_THICKNESS / 2)

    def test_postures_reach_their_points(self) -> None:
        for q in postures(60):
            q[1:3] = np.abs(q[1:3])  # away from the base, the elbow up
            point = racket_pose(q).position
            assert racket_pose(posture_towards(point, 0.0)).position == pytest.approx(point)
        assert posture_towards(racket_pose(PLAYING).position, 0.5) == pytest.approx(PLAYING)

    @given(
        *(st.floats(0.0, 1.5), st.floats(-1.0, 1.0), st.floats(0.5, 2.5), st.floats(-2.0, 2.0)),
    )
    def test_every_posture_is_within_the_stops(
        self, x: float, y: float, z: float, wrist: float
    ) -> None:
        assert np.all(np.abs(posture_towards((x, y, z), wrist)) <= JOINT_LIMIT)

    @pytest.mark.parametrize(
        ("point", "nearest"),
        [
            ((2.0, 0.0, SHOULDER), UPPER_ARM + FOREARM),  # too far: the arm is straight
            ((0.3, 0.0, SHOULDER), np.hypot(UPPER_ARM, FOREARM)),  # too near: a right angle
        ],
    )
    def test_out_of_reach_the_racket_comes_near(
        self, point: tuple[float, float, float], nearest: float
    ) -> None:
        position = racket_pose(posture_towards(point, 0.0)).position
        assert position == pytest.approx((nearest, 0.0, SHOULDER), abs=0.005)

    def test_below_its_reach_the_forearm_points_at_the_ball(self) -> None:
        posture = posture_towards((0.5, 0.0, 0.8), 0.0)
        assert posture[1] == JOINT_LIMIT
        x, _, z = racket_pose(posture).position
        assert x < 0.5
        assert z < SHOULDER - 0.3


def test_torques_are_nearly_those_of_the_scene(model: mujoco.MjModel) -> None:
    """Those that play: joint 1 fast, the others slow. Left out is what the model says it leaves."""
    data = mujoco.MjData(model)
    rng = np.random.default_rng(5)
    for _ in range(30):
        q = PLAYING + rng.uniform(-0.4, 0.4, 4)
        dq = rng.uniform(-1.0, 1.0, 4) * [3.0, 0.3, 0.3, 0.3]
        ddq = rng.uniform(-1.0, 1.0, 4) * [15.0, 5.0, 5.0, 5.0]
        data.qpos[ARM], data.qvel[ARM], data.qacc[:] = q, dq, 0.0
        data.qacc[ARM] = ddq
        mujoco.mj_inverse(model, data)
        wanted = data.qfrc_inverse[ARM]
        torque = ArmModel().torque(q, dq, ddq)
        assert torque == pytest.approx(wanted, abs=0.15 + 0.03 * np.abs(wanted).max())


class TestPressures:
    def test_pressures_make_their_torques(self) -> None:
        muscles = MusclePair()
        q = np.array([0.3, 1.1, 1.4, -0.5])
        for torque in np.random.default_rng(1).uniform(-8.0, 8.0, (20, 4)):
            pressures = muscles.pressures(torque, q, 0.45)
            contraction = muscles.contracted + np.outer(q, [1.0, -1.0]) * muscles.pulley
            force = muscles.maximum_force * pressures * (1.0 - contraction / muscles.stroke)
            assert muscles.pulley * (force[:, 0] - force[:, 1]) == pytest.approx(torque)

    def test_a_slack_muscle_leaves_the_torque_to_the_other(self) -> None:
        pressures = MusclePair().pressures(np.array([20.0, -20.0, 0.0, 0.0]), np.zeros(4), 0.1)
        made = 0.037 * 1500.0 * 0.8 * (pressures[:, 0] - pressures[:, 1])
        assert made == pytest.approx([20.0, -20.0, 0.0, 0.0])

    def test_asking_undoes_the_lag(self) -> None:
        lag, now, wanted = PressureLag(), np.full(8, 0.4), np.linspace(0.3, 0.5, 8)
        asked = lag.asking(now, wanted, 0.014)
        assert lag.after(now, asked, 0.014) == pytest.approx(wanted)

    @pytest.mark.parametrize("factor", [COARSE, FINE])
    def test_actions_lead_to_the_wanted_pressures(self, factor: float) -> None:
        actions = PressureActions(factor=factor)
        start = np.full(8, 0.5)
        actions.start(start)
        wanted = np.linspace(-0.2, 1.2, 8)
        pressures = start
        for _ in range(100):
            action = actions.towards(wanted)
            assert np.all(np.abs(action) <= 1.0)
            taken = action.astype(np.float64)
            pressures = changed_pressures(pressures, taken, factor=factor)
            assert actions.asked == pytest.approx(pressures)
        assert pressures == pytest.approx(np.clip(wanted, 0.0, 1.0), abs=1e-6)


class TestSwing:
    start = JointMotion(np.array([0.1, 1.0]), np.array([0.5, -0.2]), np.array([3.0, 1.0]))
    end = JointMotion(np.array([0.4, 0.8]), np.array([2.0, 0.0]), np.array([0.0, 0.0]))

    def test_it_goes_from_start_to_end(self) -> None:
        swing = Swing.between(self.start, self.end, 0.3)
        for motion, wanted in ((swing.at(0.0), self.start), (swing.at(0.3), self.end)):
            assert motion.q == pytest.approx(wanted.q)
            assert motion.dq == pytest.approx(wanted.dq)
            assert motion.ddq == pytest.approx(wanted.ddq)

    def test_speeds_and_accelerations_are_derivatives(self) -> None:
        swing, small = Swing.between(self.start, self.end, 0.3), 1e-6
        before, after = swing.at(0.1), swing.at(0.1 + small)
        assert (after.q - before.q) / small == pytest.approx(before.dq, abs=1e-4)
        assert (after.dq - before.dq) / small == pytest.approx(before.ddq, abs=1e-3)

    def test_it_goes_on_with_its_last_speed(self) -> None:
        swing = Swing.between(self.start, self.end, 0.3)
        assert swing.at(0.35).q == pytest.approx(self.end.q + 0.05 * self.end.dq)

    def test_later_it_is_the_same(self) -> None:
        swing = Swing.between(self.start, self.end, 0.3)
        assert swing.later(0.1).at(0.05).q == pytest.approx(swing.at(0.15).q)


class TestStrikes:
    @pytest.mark.parametrize("seed", range(8))
    def test_a_planned_strike_sends_the_ball_to_the_target(self, seed: int) -> None:
        settings = InterceptionSettings()
        shot = simulated_shot(np.random.default_rng(seed))
        row = int(np.argmax(shot.positions[:, 1] < 2.0))
        ball = coming_ball(shot.positions[row], shot.velocities[row], settings)
        assert ball is not None
        strike = StrikePlanner(settings).plan(ball)
        assert strike is not None

        # the racket's face touches the ball, and turns it round
        position, velocity = ball.at(strike.time)
        pose = racket_pose(strike.posture)
        normal = np.array(pose.normal)
        offset = position - np.array(pose.position)
        assert offset @ normal == pytest.approx(TOUCH, abs=0.002)
        assert np.linalg.norm(offset - TOUCH * normal) < NARROW
        racket = np.cross([0.0, 0.0, strike.speeds[0]], pose.position)
        outgoing = RacketImpact().outgoing(velocity, racket, normal)
        landing = predict_landing(position, outgoing, spin=settings.spin)
        assert landing is not None
        assert landing.position[:2] == pytest.approx((0.0, 2.5), abs=0.1)

    def test_a_ball_that_flies_away_is_left_alone(self) -> None:
        away = np.array([0.2, 3.0, 1.0])
        assert coming_ball(np.array([0.5, 1.0, 1.2]), away, InterceptionSettings()) is None

    def test_a_ball_behind_the_arm_is_left_alone(self) -> None:
        coming = np.array([0.2, -3.0, 0.0])
        assert coming_ball(np.array([0.6, -0.5, 1.2]), coming, InterceptionSettings()) is None


class TestPolicy:
    @given(
        shares=st.lists(st.lists(share, min_size=SIZE, max_size=SIZE), min_size=1, max_size=4),
    )
    def test_every_action_lies_in_the_box(self, shares: list[list[float]]) -> None:
        bounds, policy = ObservationBounds(), HittingPolicy()
        for row in shares:
            span = bounds.high - bounds.low
            action = policy.act((bounds.low + np.array(row, np.float32) * span).astype(np.float32))
            assert action.shape == (8,)
            assert action.dtype == np.float32
            assert np.all(np.abs(action) <= 1.0)

    def test_the_arm_stays_as_it_is_without_a_ball(self) -> None:
        policy = HittingPolicy()
        pressures = HittingSettings().muscles.pressures(
            ArmModel().torque(PLAYING, np.zeros(4), np.zeros(4)), PLAYING, 0.45
        )
        row = pack_observation(
            PLAYING, np.zeros(4), pressures.ravel(), np.array([0.5, -1.0, 0.1]), np.zeros(3)
        )
        for _ in range(5):
            assert policy.act(row.astype(np.float32)) == pytest.approx(np.zeros(8), abs=0.01)

    def test_a_new_episode_forgets_the_last(self) -> None:
        ball, velocity = np.array([0.46, 2.95, 1.37]), np.array([0.24, -4.1, 2.3])
        policy = HittingPolicy()
        first = [policy.act(observed(PLAYING, ball, velocity)) for _ in range(3)]
        policy.reset()
        again = [policy.act(observed(PLAYING, ball, velocity)) for _ in range(3)]
        assert np.array_equal(first, again)


class TestSearch:
    @staticmethod
    def score(parameters: Parameters) -> Score:
        """Best at the start, but for the flight, which should be longer."""
        start = start_parameters() | {"interception.flight": 0.6}
        miss = sum(((parameters[name] - start[name]) / SCALES[name]) ** 2 for name in SCALES)
        return Score(mean_reward=-miss, hits=0, episodes=1)

    def test_it_finds_better_numbers(self) -> None:
        found, score = search(self.score, candidates=300, seed=1)
        assert score.mean_reward > 0.2 * self.score(start_parameters()).mean_reward
        assert found["interception.flight"] == pytest.approx(0.6, abs=0.02)

    def test_the_same_seed_finds_the_same_numbers(self) -> None:
        first = search(self.score, candidates=20, seed=2)
        assert first == search(self.score, candidates=20, seed=2)

    def test_found_numbers_are_played_with(self) -> None:
        found = FoundParameters.load()
        assert set(found.parameters) == set(SCALES)
        assert found_settings().interception.flight == found.parameters["interception.flight"]

    def test_a_number_that_does_not_exist_is_refused(self) -> None:
        with pytest.raises(KeyError, match="speed_of_light"):
            with_parameters(HittingSettings(), {"control.speed_of_light": 1.0})

    def test_found_numbers_can_be_kept(self, tmp_path: Path) -> None:
        found = FoundParameters.load()
        found.save(tmp_path / "again.json")
        assert FoundParameters.load(tmp_path / "again.json") == found


@pytest.mark.timeout(300)
def test_most_balls_are_hit_and_fly_back() -> None:
    """All recorded shots of the ball gun where they are there, else simulated ones."""
    recorded = DATA / "ball_gun_2019"
    path = str(recorded) if recorded.is_dir() else None
    count = len(balls_from(path)) if path else 20
    environment = gymnasium.make(
        o80_table_tennis.ACCELERATED, task=TaskSettings(balls=path, factor=DEFAULT_FACTOR)
    )
    try:
        played = play(environment, default_policy(), range(count), seed=1)
    finally:
        environment.close()
    assert len(played.episodes) == count
    assert played.hits >= count / 2
