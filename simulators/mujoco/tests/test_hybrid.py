"""Rigs of o80.hybrid: the same bits in each way of pacing, what is refused, what is recorded."""

from __future__ import annotations

import gc
import itertools
import os
import signal
import sys
import time
import warnings
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode
from hybrid_tasks import RATE, START, Followed, Many, Push, Still, played

import o80
from o80.drivers import Reading
from o80.hybrid import (
    EVERY,
    HybridTask,
    Mirror,
    Outcome,
    Rig,
    Transitions,
    attach,
    difference,
    make,
    make_vec,
    relive,
)
from o80.hybrid.mirror import Motion, pairs_of
from o80.learning import VectorEnvironment
from o80.learning.training import NamedTask
from o80.rows.columns import columns_at

STEPS = 70


def rig_of(seed: int) -> dict[str, Any]:
    """A task whose rig is drawn: step, delay, velocity, chunks."""
    random = np.random.default_rng(seed)
    every = int(random.integers(1, 11))
    chunks = bool(random.integers(2))
    steps = int(random.integers(1, 4)) if chunks else 1
    rig = Rig(
        robot="two_joints",
        robot_options={"gain": float(random.uniform(10, 40))},
        world="mujoco",
        world_options={"model": "models/push.xml"},
        mirror=Mirror(velocity=difference(int(random.integers(1, 6)))),
        every=every,
        delay=int(random.integers(0, every * steps)),
        frequency=RATE,
    )
    size = {"chunk_size": steps + int(random.integers(0, 3)), "action_steps": steps}
    return {"rig": rig} | (size if chunks else {})


def task_of(seed: int, base: type[HybridTask] = Push) -> type[HybridTask]:
    return type("Drawn", (base,), {**rig_of(seed), "__module__": base.__module__})


@pytest.mark.parametrize("seed", range(6))
def test_copies_and_single_robots_give_the_same_bits(seed: int) -> None:
    task = task_of(seed)
    copies = 3
    with make_vec(task, copies, threads=2, autoreset_mode="SameStep") as vector:
        shape = vector.single_action_space.shape
        observations = [vector.reset(seed=seed)[0]]
        actions = [
            np.stack(
                [
                    np.random.default_rng((seed, copy, i)).uniform(-1, 1, shape)
                    for copy in range(copies)
                ]
            )
            for i in range(STEPS)
        ]
        ends = 0
        for each in actions:
            observed, rewards, *over, _ = vector.step(each.astype(np.float32))
            observations.append(np.column_stack([observed, rewards]))
            ends += int(np.count_nonzero(over))
    assert ends > copies
    for copy in range(copies):
        with make(task) as single:
            assert np.array_equal(single.reset(seed=seed + copy)[0], observations[0][copy])
            moved = 0.0
            for i, each in enumerate(actions):
                observed, reward, terminated, truncated, _ = single.step(
                    each[copy].astype(np.float32)
                )
                moved = max(moved, float(np.abs(observed[2:4] - START).max()))
                if terminated or truncated:
                    observed, _ = single.reset()
                assert np.array_equal([*observed, reward], observations[i + 1][copy]), (copy, i)
    assert moved > 0.01, "nothing was pushed: the rig shows nothing"


@pytest.mark.parametrize("seed", range(3))
def test_processes_give_the_bits_of_inline_robots(seed: int) -> None:
    task = task_of(seed)
    with make(task) as inline, make(task, pacing="processes") as processes:
        for i, (here, there) in enumerate(
            zip(played(inline, 40, seed), played(processes, 40, seed), strict=True)
        ):
            assert np.array_equal(here, there), i


@pytest.mark.parametrize(
    ("robot", "worlds"), [("two_joints", 1), ("two_joints", 4), ("plain_arm.py:LimitedArm", 1)]
)
def test_by_the_clock_steps_without_a_late_one_give_the_same_bits(robot: str, worlds: int) -> None:
    compared = 0
    rig = Rig(**{**vars(Push.rig), "delay": 4, "robot": robot, "worlds": worlds})
    task = type("Clocked", (Still,), {"rig": rig, "ends": False, "__module__": Still.__module__})
    for episode in range(6):
        with (
            make(task) as inline,
            make(task, pacing="real_time", max_late=10**6, max_drift=1e6) as clocked,
        ):
            random = np.random.default_rng(episode)
            here, infos = inline.reset(seed=episode)
            there, clocked_infos = clocked.reset(seed=episode)
            assert np.array_equal(here, there)
            assert_same_worlds(infos, clocked_infos)
            for step in range(Still.max_steps or 0):
                action = random.uniform(-1, 1, 2).astype(np.float32)
                wanted, found = inline.step(action), clocked.step(action)
                if clocked.task.statistics().late_actions:
                    break
                assert np.array_equal(wanted[0], found[0]), (episode, step)
                assert wanted[1:4] == found[1:4]
                assert_same_worlds(wanted[4], found[4])
                compared += 1
            if compared >= 40:
                return
    if compared < 5:
        pytest.skip("this machine is too slow for 40 steps a second")


def assert_same_worlds(wanted: dict[str, Any], found: dict[str, Any]) -> None:
    for name, values in wanted["worlds"].items():
        assert np.array_equal(values, found["worlds"][name]), name


@pytest.mark.parametrize("end", ["first", "all"])
@pytest.mark.parametrize("pacing", ["copies", "inline", "processes"])
def test_each_of_many_worlds_has_the_bits_of_a_rig_with_only_that_one(
    end: str, pacing: Any
) -> None:
    """Also after the episodes of other worlds have ended."""
    seed = 5 + ["copies", "inline", "processes"].index(pacing) + 3 * (end == "all")
    task, copies = task_of(seed, Many), 2 if pacing == "copies" else 1
    task.rig = Rig(**{**vars(task.rig), "worlds": Many.drawn, "end": end})
    made = task(copies, pacing="inline" if pacing == "copies" else pacing)
    everywhere = [*np.ndindex(copies, Many.drawn)]
    random, waited = np.random.default_rng(seed), 0
    with ExitStack() as stack:
        vector = stack.enter_context(VectorEnvironment(made, autoreset_mode="Disabled"))
        alone = {
            place: stack.enter_context(make(task, worlds=1, only=place[1])) for place in everywhere
        }
        shown = vector.reset(seed=seed)[1]["worlds"]
        for copy, world in everywhere:
            observed, _ = alone[copy, world].reset(seed=seed + copy)
            assert np.array_equal(observed, shown["observation"][copy, world])
        for step in range(STEPS):
            actions = random.uniform(-1, 1, vector.action_space.shape).astype(np.float32)
            *_, terminated, truncated, infos = vector.step(actions)
            shown, over = infos["worlds"], terminated | truncated
            for place in everywhere:
                if not shown["running"][place]:
                    waited += 1
                    continue
                observed, reward, ended, _, _ = alone[place].step(actions[place[0]])
                assert np.array_equal(observed, shown["observation"][place]), (step, place)
                assert reward == shown["reward"][place]
                assert ended == shown["terminated"][place]
            running = shown["running"] & ~(shown["terminated"] | shown["truncated"])
            assert np.array_equal(over, ~running.any(axis=1))
            assert end == "all" or np.array_equal(over, ~running[:, 0])
            if over.any():
                vector.reset(options={"reset_mask": over})
                for place in everywhere:
                    if over[place[0]]:
                        alone[place].reset()
    assert waited, "no world ended before its episode"


def test_a_copy_is_judged_if_a_flag_is_raised_in_any_of_its_worlds() -> None:
    flagged = {"flags": ("world.puck_position[2] > 0.5",), "__module__": Many.__module__}
    with make_vec(type("Flagged", (Many,), flagged), 2, worlds=4) as vector:
        vector.reset(seed=1)
        place = np.full((1, 4, 3), 0.2)
        place[0, 2, 2] = 0.9
        task: Any = vector.task
        task.world.request("place", np.array([1]), body="puck", position=place)
        infos = vector.step(np.zeros((2, 2), np.float32))[4]
        assert (infos["worlds"]["reward"] != 0).tolist() == [[False] * 4, [True] * 4]


def test_a_halt_of_one_world_ends_the_episode_of_its_copy_alone() -> None:
    with make_vec(Many, 3, worlds=2, ends=False, autoreset_mode="Disabled") as vector:
        vector.reset(seed=1)
        members(vector)[1][3].halt("enough")
        _, _, terminated, _, infos = vector.step(np.zeros((3, 2), np.float32))
        assert terminated.tolist() == [False, True, False]
        assert infos["worlds"]["terminated"].tolist() == [[False] * 2, [True] * 2, [False] * 2]
        vector.reset(options={"reset_mask": terminated})
        assert not vector.step(np.zeros((3, 2), np.float32))[2].any()
        task: Any = vector.task
        assert task.statistics().world_time > 0


def test_the_world_mirrors_each_row_of_an_episode_once() -> None:
    with make(Push, pacing="processes") as environment:
        robot, world = members(environment)
        environment.reset(seed=1)
        first, begun = robot.published, world.published
        steps = 0
        over = False
        while not over:
            *_, terminated, truncated, _ = environment.step(np.array([0.9, 0.5], np.float32))
            steps, over = steps + 1, terminated or truncated
        rows = robot.history(since=first + 1).rows
        mirrored = world.history(since=begun + 1).rows
        assert len(rows) == len(mirrored) == steps * 5
        assert np.array_equal(mirrored["observed"]["joints"]["position"], rows["observed"])
        assert np.array_equal(environment.task.robot.rows[0], rows[-5:])
        places = np.vstack(
            [robot.history(since=first, until=first).rows["observed"], rows["observed"]]
        )
        for i, velocity in enumerate(mirrored["observed"]["joints"]["velocity"]):
            span = min(i + 1, 3)
            np.testing.assert_allclose(
                velocity, (places[i + 1] - places[i + 1 - span]) / span * RATE, atol=1e-9
            )


def test_flags_choose_which_copies_are_judged() -> None:
    with make_vec(Followed, 3) as vector:
        task: Any = vector.task
        vector.reset(seed=0)
        actions = np.array([[0, 0], [0.9, 0], [0, -0.9]], np.float32)
        paid = np.zeros(3)
        for _ in range(20):
            paid += vector.step(actions)[1]
        raised = task.world.last["extended"]["effort"][:, 0, 0] > 0.1
        raised |= task.robot.last["observed"][:, 1] < -0.5
        assert paid[0] == 0
        assert paid[2] > 0
        assert np.array_equal(task.flagged(), raised)


# ---------------------------------------------------------------------------- mirror


def test_a_missed_row_holds_the_place_and_the_next_one_has_its_velocity() -> None:
    schema = o80.robots.load("two_joints").describe()
    mirror = Mirror(velocity=difference(3), fresh="extended.homing")
    pairs = pairs_of(mirror, schema, {"shoulder": "rad", "elbow": "rad"}, "w")
    with o80.robots.load("two_joints").inline() as robot:
        rows = np.zeros((1, 12), robot.history(1).rows.dtype)
    motion = Motion(mirror, pairs, 1, schema)
    good = np.array([1, 1, 1, 1, 1, 0, 0, 1, 1, 1, 1, 1], bool)
    places = np.cumsum(np.random.default_rng(2).uniform(0, 1, (12, 2)), axis=0)
    rows["observed"][0], rows["extended"]["homing"][0] = places, good
    begin = np.zeros(1, rows.dtype)
    only = np.zeros(1, np.intp)
    motion.begin(only, begin)
    found = [motion.follow(only, rows[:, part], 0.5) for part in (slice(0, 7), slice(7, 12))]
    positions = np.concatenate([each[0][0] for each in found])
    velocities = np.concatenate([each[1][0] for each in found if each[1] is not None])
    held = [0, 1, 2, 3, 4, 4, 4, 7, 8, 9, 10, 11]
    assert np.array_equal(positions, places[held])
    before = {0: (None, 1), 1: (None, 2), 2: (None, 3), 3: (0, 3), 4: (1, 3)}
    before |= {7: (4, 3), 8: (7, 1), 9: (7, 2), 10: (7, 3), 11: (8, 3)}
    for row in range(12):
        since, rows_between = before.get(row, (row, 1))
        start = np.zeros(2) if since is None else places[since]
        wanted = (places[row] - start) / (rows_between * 0.5) if good[row] else np.zeros(2)
        np.testing.assert_allclose(velocities[row], wanted, err_msg=str(row))
    assert motion.missed[0] == 0


OTHER = {
    "every": 2,
    "robot": "two_joints",
    "world": "mujoco",
    "world_options": {"model": "models/push.xml"},
}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({}, "need a velocity: .*With velocity 0"),
        (
            {"mirror": Mirror(velocity=difference()), "robot": "pam"},
            "agonist_1' of robot 'pam' has no joint",
        ),
        ({"mirror": Mirror("obsrved")}, "no number 'obsrved'"),
        ({"mirror": Mirror(velocity="extended.homing")}, "has 1 numbers, 'observed' has 2"),
        ({"mirror": Mirror(names={"elbw": "elbow"})}, "no actuator 'elbw'. Did you mean 'elbow'"),
        ({"mirror": Mirror(names=["shoulder"])}, "1 joints for 2 numbers"),
        (
            {"mirror": Mirror("extended.joint_positions"), "robot": "pam"},
            "4 numbers and the robot 8 actuators: name the joint",
        ),
        ({"every": 2, "delay": 2}, "delay must be less than the 2 iterations"),
        ({"things": "x.xml", "world": "two_joints", "world_options": {}}, "things need a model"),
    ],
)
def test_a_rig_that_cannot_be_is_refused(changes: dict[str, Any], message: str) -> None:
    task = type("T", (Push,), {"rig": Rig(**{**OTHER, **changes}), "__module__": Push.__module__})
    with pytest.raises(o80.Error, match=message):
        make(task)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"ens": 1}, "no parameter 'ens'. Did you mean 'ends'"),
        ({"pacing": "fast"}, "pacing must be one of"),
        ({"attach": "arm"}, "attach is for pacing='real_time'"),
        ({"world": attach("camera")}, "world 'camera' runs in another process.*not inline"),
        ({"copies": 2, "pacing": "processes"}, "2 copies are inline"),
        ({"threads": 2, "pacing": "processes"}, "threads step copies inline"),
        ({"action_steps": 2}, "action_steps must be at most chunk_size"),
        ({"home_rest": float("nan")}, "home_rest must be a finite number of at least 0, got nan"),
        ({"home_duration": -1}, "home_duration must be a finite number of at least 0, got -1"),
        ({"flags": ("puck_speed < 1",)}, "must be like 'world"),
        ({"flags": ("world.puck_position < 1",)}, "'puck_position' has 3: name one"),
    ],
)
def test_options_that_make_no_sense_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(o80.InvalidArgument, match=message):
        Push(**options)


# ---------------------------------------------------------------------------- faults


def members(environment: Any) -> Any:
    """Robot and world."""
    return environment.task.engine.members


def episode(environment: Any, seed: int) -> list[Any]:
    random = np.random.default_rng(seed)
    found = [environment.reset(seed=seed)[0]]
    actions = random.uniform(-1, 1, (4, 2)).astype(np.float32)
    return found + [environment.step(action)[0] for action in actions]


@pytest.mark.parametrize(
    "options", [{}, {"threads": 1}, {"worlds": 3}, {"chunk_size": None, "pacing": "processes"}]
)
def test_an_interrupt_anywhere_leaves_an_environment_that_resets(options: dict[str, Any]) -> None:
    def raises_at(line: int) -> Any:
        left = itertools.count(line, -1)

        def trace(frame: Any, event: str, _argument: Any) -> Any:
            if "/hybrid/" not in frame.f_code.co_filename:
                return None
            if event == "line" and next(left) == 0:
                raise KeyboardInterrupt
            return trace

        return trace

    with make(Many if "worlds" in options else Push, **options) as environment:
        wanted = episode(environment, 3)
        for line in np.random.default_rng(1).integers(0, 600, 25).tolist():
            before = sys.gettrace()
            sys.settrace(raises_at(line))
            try:
                episode(environment, 9)
            except KeyboardInterrupt:
                pass
            finally:
                sys.settrace(before)
            for here, there in zip(wanted, episode(environment, 3), strict=True):
                assert np.array_equal(here, there), line


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize("pacing", ["inline", "processes"])
def test_a_halt_ends_the_episode_and_a_reset_goes_on(which: int, pacing: Any) -> None:
    with make(Push, pacing=pacing, ends=False) as environment:
        wanted = episode(environment, 4)
        environment.reset(seed=5)
        member = members(environment)[which]
        member.halt("enough")
        *_, terminated, truncated, info = environment.step(np.zeros(2, np.float32))
        assert (terminated, truncated, info["halt"]) == (True, False, "enough")
        if pacing == "processes":  # somebody has asked for it
            with pytest.raises(o80.CopyFailed, match="does not end this halt"):
                environment.reset()
            member.resume()
        for here, there in zip(wanted, episode(environment, 4), strict=True):
            assert np.array_equal(here, there)


def test_a_halt_of_one_copy_leaves_the_others() -> None:
    actions = np.full((3, 2), 0.8, np.float32)
    with make_vec(Push, 3, ends=False) as one, make_vec(Push, 3, ends=False) as other:
        one.reset(seed=1)
        other.reset(seed=1)
        members(one)[0][1].halt("enough")
        for step in range(8):
            found, wanted = one.step(actions), other.step(actions)
            assert np.array_equal(found[0][[0, 2]], wanted[0][[0, 2]])
            assert found[2].tolist() == [False, step == 0, False]


@pytest.mark.parametrize("which", [0, 1])
def test_a_robot_or_a_world_that_was_killed_is_named(which: int) -> None:
    with make(Push, pacing="processes") as environment:
        environment.reset(seed=1)
        member = members(environment)[which]
        process = next(each for each in o80.segments() if each.name == member.segment)
        os.kill(process.pid, signal.SIGKILL)
        with pytest.raises(o80.BackendKilled, match=member.segment):
            environment.step(np.zeros(2, np.float32))
        with pytest.raises(o80.BackendKilled, match=member.segment):
            environment.reset()


def test_by_the_clock_a_caller_that_pauses_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    with make(Still, pacing="real_time", ends=False, max_late=50) as environment:
        environment.reset(seed=1)
        environment.step(np.zeros(2, np.float32))
        robot = members(environment)[0]
        robot.wait_for(robot.published + 60, timeout=60)
        *_, terminated, truncated, info = environment.step(np.zeros(2, np.float32))
        assert (terminated, truncated) == (False, True)
        assert "more than max_late=50" in info["stalled"]
        with pytest.raises(gymnasium.error.ResetNeeded):
            environment.step(np.zeros(2, np.float32))
        environment.reset()
        assert "stalled" not in environment.step(np.zeros(2, np.float32))[4]


def test_by_the_clock_a_robot_that_skips_periods_is_told() -> None:
    with make(Still, pacing="real_time", ends=False, max_late=10**6, robot_options={}) as made:
        made.reset(seed=1)
        made.step(np.zeros(2, np.float32))
        robot = members(made)[0]
        process = next(each for each in o80.segments() if each.name == robot.segment)
        os.kill(process.pid, signal.SIGSTOP)
        time.sleep(0.5)  # these periods are lost, however fast the machine is
        os.kill(process.pid, signal.SIGCONT)
        terminated = truncated = False
        while not (terminated or truncated):
            *_, terminated, truncated, info = made.step(np.zeros(2, np.float32))
        assert truncated
        assert "more than max_drift=0.2 s" in info["stalled"]
        made.reset()
        assert made.task.statistics().largest_drift > 0.2


def test_a_halt_by_the_watchdog_ends_the_episode() -> None:
    library = o80.robots.load("two_joints")
    with library.start("watched", frequency=RATE, silence=RATE, stale="halt") as process:
        robot = process.frontend()
        options: dict[str, Any] = {"chunk_size": 2, "max_late": 10**6, "max_drift": 1e6}
        with make(Push, pacing="real_time", attach="watched", ends=False, **options) as made:
            made.reset(seed=1)
            rows = np.zeros((2, 2), np.float32)
            made.step(rows)
            robot.wait_for(robot.published + 2 * RATE, timeout=60)
            *_, terminated, truncated, info = made.step(rows)
            assert (terminated, truncated) == (True, False)
            assert "sign of life" in info["halt"]


@pytest.mark.parametrize("resume", [False, True])
def test_by_the_clock_a_reset_resumes_only_if_it_may(resume: bool) -> None:
    with make(Still, pacing="real_time", resume=resume, robot_options={}) as environment:
        environment.reset(seed=1)
        robot = members(environment)[0]
        robot.halt("by hand")
        environment.step(np.zeros(2, np.float32))
        with pytest.raises(o80.CopyFailed, match="by hand"):
            environment.reset()


def test_a_robot_that_runs_is_attached_to_and_goes_on() -> None:
    with o80.robots.load("two_joints").start("attached", frequency=RATE) as process:
        with make(
            Push, pacing="real_time", attach="attached", max_late=10**6, max_drift=1e6
        ) as made:
            made.reset(seed=1)
            made.step(np.zeros(2, np.float32))
        assert process.alive


def test_a_robot_and_a_world_that_burst_already_give_the_same_bits(tmp_path: Path) -> None:
    options: dict[str, Any] = {
        "model": Path(__file__).with_name("models") / "push.xml",
        "joints": "shoulder, elbow",
    }
    with (
        o80.robots.load("two_joints").start("own_arm", frequency=RATE, bursting=True),
        o80.robots.load("mujoco").start("own_world", frequency=RATE, bursting=True, **options),
    ):
        with make(Push, pacing="processes", attach="own_arm", world=attach("own_world")) as made:
            found = list(played(made, 50, 3))
        with pytest.raises(o80.InvalidArgument, match="robot 'own_arm' bursts"):
            make(Push, pacing="real_time", attach="own_arm")
    with make(Push) as made:
        for mine, other in zip(played(made, 50, 3), found, strict=True):
            assert mine.tobytes() == other.tobytes()


def test_by_the_clock_a_step_may_send_nothing() -> None:
    with make(Push, pacing="real_time", max_late=10**6, max_drift=1e6) as made:
        made.reset(seed=1)
        made.step(np.full(2, 0.3, np.float32))
        engine: Any = made.task.engine
        before = engine.span[2], engine.counts.steps, engine.counts.late_actions
        engine.step(None, EVERY, made.task.until_halted)
        assert (engine.span[2], engine.counts.steps) == (before[0] + 5, before[1] + 1)
        assert engine.counts.late_actions == before[2]
        engine.stalled = "the caller paused"
        engine.begin()
        engine.step(None, EVERY, made.task.until_halted)
        assert (engine.stalled, engine.counts.steps) == ("", before[1] + 2)
        row = made.task.robot.rows[0]
        np.testing.assert_array_equal(row["desired"][-1], np.full(2, 0.3, np.float32))


def test_a_recording_holds_every_world(tmp_path: Path) -> None:
    with make(Many, worlds=3, record=tmp_path / "run.mcap", ends=False, max_steps=2) as made:
        made.reset(seed=1)
        for _ in range(2):
            made.step(np.full(2, 0.3, np.float32))
        world = made.task.world.last[0].copy()
    recording = o80.open(tmp_path / "run.mcap")
    values = recording.marks[0].values
    names = [each for each in recording if each != values["robot"]]
    assert (len(names), names[0]) == (3, values["world"])
    for name, last in zip(names, world, strict=True):
        assert recording[name].history().rows[-1] == last


class Own(HybridTask):
    """A rig and spaces of the object, and numbers that C++ passes on."""

    def __init__(self, copies: int = 1, **options: Any) -> None:
        self.rig = Followed.rig
        self.action_space = Box(-1, 1, (2,), np.float32)
        self.observation_space = Box(-np.inf, np.inf, (2,), np.float32)
        super().__init__(copies, **options)

    def begin(self, copies: Any, generators: Any, options: Any) -> None:
        pass

    def observe(self, copies: Any) -> Any:
        return self.world.last["observed"][copies, 0]

    def judge(self, copies: Any) -> Outcome:
        return Outcome(1.0)


@pytest.mark.parametrize("copies", [2, 1])
def test_numbers_that_are_passed_on_are_those_of_the_robot(copies: int) -> None:
    with make_vec(Own, copies) as made:
        task: Any = made.task
        made.reset(seed=1)
        for target in (0.3, -0.2, 0.6):
            made.step(np.full((copies, 2), target, np.float32))
            robot, world = task.robot.rows["observed"], task.world.rows["desired"]
            np.testing.assert_array_equal(world[:, 0], robot)
        assert task.statistics().steps == 3


def test_a_recording_holds_the_episodes_and_replays(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    with make(Push, pacing="processes", record=file, ends=False, max_steps=4) as environment:
        for seed in (3, None):
            environment.reset(seed=seed, options={"a": 1})
            rewards = [environment.step(np.full(2, 0.5, np.float32))[1] for _ in range(4)]
        environment.reset()
    recording = o80.open(file)
    marks = [mark for mark in recording.marks if mark.name.startswith("episode")]
    assert [mark.name for mark in marks] == ["episode", "episode_end"] * 2
    assert marks[0].values["seed"] == 3
    assert marks[0].values["options"] == {"a": 1}
    assert marks[3].values["rewards"] == rewards
    assert marks[3].values["truncated"]
    for segment in recording:
        assert o80.replay(file, segment=segment).identical


def test_by_the_clock_too_an_episode_begins_with_its_first_step(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    options: dict[str, Any] = {"max_late": 10**6, "max_drift": 1e6, "max_steps": 2}
    with make(Still, pacing="real_time", record=file, **options) as environment:
        environment.reset(seed=1)
        robot = environment.task.engine.frontends[0]
        name, waited = robot.segment, robot.wait_for(robot.published + 50, 60).iteration
        while not environment.step(np.zeros(2, np.float32))[3]:
            pass
    begun, _ = (mark for mark in o80.open(file).marks if mark.name.startswith("episode"))
    assert begun.rows[name] >= waited


class Watched(Still):
    """Keeps the rows of all steps, and draws noise when it observes."""

    kept: ClassVar[list[Any]] = []

    def observe(self, copies: Any) -> Any:
        return super().observe(copies) + self.generators[0].normal(0, 0.01)

    def judge(self, copies: Any) -> Outcome:
        self.kept.append(self.world.rows.copy())
        return super().judge(copies)

    def action_of(self, rows: Any) -> Any:
        return rows["desired"][-1]


def test_marks_of_other_programs_are_not_taken_for_episodes_of_a_task(tmp_path: Path) -> None:
    file, ours = tmp_path / "run.mcap", {"robot": "arm", "options": {}}
    library = o80.robots.load("two_joints")
    with library.inline("arm") as arm, o80.Recording(file, arm) as recording:
        recording.mark("environment", **ours)
        recording.mark("episode", number=0)
        arm.burst(20)
        recording.mark("episode_end", actions=[[0, 0]])
    with pytest.raises(o80.InvalidArgument, match="its marks of episodes are not those"):
        list(relive(file, Push))
    with pytest.raises(o80.InvalidArgument, match=r"task must be a class .*, got <class 'int'>"):
        list(relive(file, int))


@pytest.mark.parametrize("pacing", ["processes", "real_time"])
def test_a_recorded_robot_in_its_own_worlds_gives_what_was_recorded(
    pacing: Any, tmp_path: Path
) -> None:
    file, random, played = tmp_path / "run.mcap", np.random.default_rng(1), []
    options: dict[str, Any] = {"max_late": 10**6, "max_drift": 1e6, "worlds": 2}
    Watched.kept.clear()
    with make(Watched, pacing=pacing, record=file, drawn=3, **options) as environment:
        for seed in (3, None, None):
            seen, over = [environment.reset(seed=seed)[1]["worlds"] | {"action": 0}], False
            while not over:
                action = random.uniform(-1, 1, 2).astype(np.float32)
                *_, terminated, truncated, info = environment.step(action)
                seen.append(info["worlds"] | {"action": action})
                over = terminated or truncated
            played.append({name: [each[name] for each in seen] for name in seen[0]})
        rows = [*Watched.kept]
        environment.reset()
        environment.step(action)  # of an episode that is dropped
    Watched.kept.clear()
    for wanted, found in zip(played, relive(file, Watched), strict=True):
        assert np.array_equal(wanted["observation"], found.observations)
        for name in ("action", "reward", "terminated", "truncated", "running"):
            values = getattr(found, {"action": "actions", "reward": "rewards"}.get(name, name))
            assert np.array_equal(wanted[name][1:], values), name
    for before, after in zip(rows, Watched.kept, strict=True):
        for field in ("desired", "observed", "extended"):
            assert np.array_equal(before[field], after[field])


def test_a_recorded_robot_goes_on_in_new_worlds(tmp_path: Path) -> None:
    file = tmp_path / "run.mcap"
    with make(Many, record=file, ends=False, max_steps=4) as environment:
        for seed in range(2):
            environment.reset(seed=seed)
            for _ in range(4):
                environment.step(np.full(2, 0.5, np.float32))

    def relived(seed: int) -> list[Transitions]:
        return list(relive(file, Many, worlds=20, seed=seed, drawn=20))

    one, same, other = relived(1), relived(1), relived(2)
    assert [each.rewards.shape for each in one] == [(4, 20)] * 2
    for i in range(2):
        assert np.array_equal(one[i].observations, same[i].observations)
        assert len(np.unique(one[i].rewards[-1])) == 20
        assert not np.isin(one[i].rewards, other[i].rewards).any()
        robot = slice(0, 2)
        assert np.array_equal(one[i].observations[..., robot], other[i].observations[..., robot])


def test_a_recording_without_episodes_needs_an_action_of_rows(tmp_path: Path) -> None:
    file = tmp_path / "arm.mcap"
    with (
        o80.robots.load("two_joints").inline("by_hand", frequency=RATE) as robot,
        o80.Recording(file, robot),
    ):
        robot.add_command(None, [0.4, -0.3], iterations=300)
        robot.burst(400)
    with pytest.raises(o80.InvalidArgument, match=r"define Many.action_of\(rows\)"):
        list(relive(file, Many))
    episodes = list(relive(file, Watched, ends=False))
    assert [len(each.actions) for each in episodes] == [30, 30, 20]
    assert episodes[0].truncated[-1].all()
    ends = np.concatenate([each.actions for each in episodes])
    assert (np.diff(ends[:50, 0]) > 0).all()


class Tracker:
    """Rows of a simulated puck as a camera has them: late and noisy, at times of its own."""

    actuators = ()
    extended: ClassVar[dict[str, Any]] = {"puck_position": (float, 3), "puck_velocity": (float, 3)}

    def __init__(self) -> None:
        self.row = 0

    def read(self, reading: Reading) -> None:
        noise = np.random.default_rng(self.row).normal(0, 0.005, 3)
        late = max(self.row - 4, 0) * 1e-3
        self.row += 1
        place = np.array([0.4 + late, 0.15, 0.05]) + noise
        reading.extended = {"puck_position": place, "puck_velocity": (1, 0, 0)}


def test_a_tracker_in_the_place_of_the_world_is_joined_by_time() -> None:
    patient: dict[str, Any] = {"max_late": 10**6, "max_drift": 1e6, "pacing": "real_time"}
    with (
        o80.robots.load(Tracker).start("tracker", frequency=130) as process,
        make(Still, world=attach("tracker"), ends=False, **patient) as environment,
    ):
        task: Any = environment.task
        assert not task.world.simulated
        environment.reset(seed=1)
        for _ in range(6):
            observed, reward, *_, info = environment.step(np.zeros(2, np.float32))
            robot, world = task.robot.rows[0], task.world.rows[0, 0]
            tracked = process.frontend().history().rows
            for mine, seen in zip(robot, world, strict=True):
                newest = tracked[tracked["time"] <= mine["time"]][-1]
                assert seen == newest
            assert np.allclose(observed[2:5], world[-1]["extended"]["puck_position"])
            assert reward == info["worlds"]["reward"][0] != 0
        assert len(np.unique(tracked["time"])) > 5


def test_a_tracker_that_stops_ends_the_episode() -> None:
    with (
        o80.robots.load(Tracker).start("tracker", frequency=130) as process,
        make(
            Still, world=attach("tracker"), pacing="real_time", ends=False, max_steps=10_000
        ) as environment,
    ):
        environment.reset(seed=1)
        process.stop()
        over = False
        while not over:
            *_, terminated, truncated, info = environment.step(np.zeros(2, np.float32))
            over = terminated or truncated
        assert "tracker" in str(info.get("stalled") or info.get("halt"))
        with pytest.raises(o80.BackendGone, match="tracker"):
            environment.reset()


def test_columns_are_found_by_their_group() -> None:
    schema = o80.robots.load("mujoco").describe(model=Path(__file__).parent / "models/push.xml")
    names = [column.name for column in columns_at(schema, "observed.joints")]
    assert names == [
        f"observed.{joint}.{part}"
        for joint in ("shoulder", "elbow")
        for part in ("position", "velocity")
    ]


class Unset(Push):
    """A driver in Python that serves no reset."""

    rig = replace(Push.rig, robot="plain_arm.py:PlainArm")
    home_duration = 0.1


@pytest.mark.parametrize("copies", [1, 2])
@pytest.mark.parametrize("arm", ["PlainArm", "GroupsArm"])
def test_a_robot_without_a_reset_goes_home(arm: str, copies: int) -> None:
    rig = replace(Unset.rig, robot=f"plain_arm.py:{arm}")
    task = type("Drawn", (Unset,), {"rig": rig, "__module__": __name__})
    with make_vec(task, copies) as environments:
        first, _ = environments.reset(seed=1)
        environments.step(np.full((copies, 2), 0.9, np.float32))
        again, _ = environments.reset(seed=1)
        np.testing.assert_allclose(again, first, atol=0.05)


def test_the_trainer_finds_a_task_by_its_file() -> None:
    task = f"{Path(__file__).parent / 'hybrid_tasks.py'}:Push"
    with closing(NamedTask(task, {"max_steps": 3}).make_vec(2, AutoresetMode.SAME_STEP)) as vector:
        vector.reset(seed=1)
        for _ in range(3):
            *_, truncated, info = vector.step(vector.action_space.sample())
    assert truncated.all()
    assert "final_obs" in info


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"observe": lambda self, copies: np.zeros(3)}, r"observe must return.*\(3,\)"),
        (
            {"targets": lambda self, actions, copies: actions[:, :1]},
            r"must return the shape \(2, 2\)",
        ),
        ({"judge": lambda self, copies: Outcome([1.0, np.nan])}, "gave copy 1 the reward nan"),
        ({"home": (1.0, 2.0, 3.0)}, "a number for each of the 2 actuators"),
        ({"home": (2.9, -2.9), "home_duration": 0.02}, "away from home"),
    ],
)
def test_a_task_that_errs_is_named_and_closed(changes: dict[str, Any], message: str) -> None:
    task = type("Wrong", (Push,), changes | {"__module__": Push.__module__})

    def plays() -> None:
        with make_vec(task, 2) as environments:
            environments.reset(seed=1)
            environments.step(np.zeros((2, 2), np.float32))

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        with pytest.raises(o80.InvalidArgument, match=message):
            plays()
        gc.collect()
    assert not [each for each in said if each.category is ResourceWarning]


def test_actions_are_clipped_into_their_space() -> None:
    with make(Push) as wild, make(Push) as mild:
        for environment, action in ((wild, 5.0), (mild, 1.0)):
            environment.reset(seed=1)
            environment.step(np.full(2, action, np.float32))
        assert np.array_equal(wild.task.robot.last, mild.task.robot.last)
