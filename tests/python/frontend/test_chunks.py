"""Chunks: what is planned is what happens, and a sender is told what became of its rows."""

import asyncio
import random
import re
import threading
from collections.abc import Callable
from enum import IntEnum
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from manual_backend import ManualBackend
from processes import WAIT, run_o80, run_python

import o80
from o80.plot import plot
from o80.rows.journal_text import command_text
from o80.rows.plans import planned_by_chunks

ROWS = np.array([[0.0, 0.1, 0.3, 0.3, 0.2]] * 2).T


def rows_of(choose: random.Random, start: float, count: int) -> list[list[float]]:
    rows = [[start, start]]
    for _ in range(count):
        rows.append([float(np.clip(each + choose.uniform(-0.1, 0.1), -3, 3)) for each in rows[-1]])
    return rows[1:]


def test_a_chunk_is_played_and_told(arm: o80.Frontend) -> None:
    arm.burst(100)
    with arm.chunks(step=10, ease=10) as plan:
        sent = plan.send(ROWS, seen=100)
        assert plan.left == 50, "inline it is decided at once"
        assert plan.wait(lead=20).iteration == 130
        seen = plan.wait(lead=20 * arm.period)  # as a float it is seconds
        assert (seen.iteration, plan.left) == (130, 20)
        assert (sent.late, sent.skipped, sent.first, sent.begins, sent.shift) == (0, 0, 0, 101, 0)
        assert plan.planned(110, 16)[:, 0].tolist() == [0.1, 0.3, 0.3, 0.2]
        assert plan.planned(115, 16)[:, 1] == pytest.approx([0.20625, 0.31875, 0.240625])
        plan.wait()
    assert arm.history().desired[[110, 120, 130, 140, 150]].tolist() == ROWS.tolist()
    assert sent.batch.statuses == ["completed"]
    with pytest.raises(o80.InvalidArgument, match="this plan was closed"):
        plan.send(ROWS)


# rule K12
@pytest.mark.parametrize("profile", ["smooth", "monotone", "linear", "hold"])
@pytest.mark.parametrize("seed", range(6))
def test_what_is_planned_is_what_happens(arm: o80.Frontend, seed: int, profile: Any) -> None:
    choose = random.Random(seed)
    step = choose.choice([1, 4, 10, 7 / 2, 50 / 3])
    compared = 0
    with arm.chunks(step=step, ease=choose.choice([None, 1, 7]), profile=profile) as plan:
        for _ in range(25):
            arm.burst(choose.randrange(1, 40))
            if choose.random() < 0.2:  # the plan goes on from a command, which the journal tells
                arm.add_command(None, [-0.5, 0.7], iterations=50, mode="overwrite")
                arm.burst(choose.randrange(1, 60))
            seen = max(0, arm.published - choose.randrange(60))
            count = choose.randrange(1, 30)
            sent = plan.send(
                rows_of(choose, float(arm.latest().desired[0]), count),
                seen=seen,
                first=choose.randrange(min(count, 4)),
                fixed=choose.random() < 0.3,
                late=choose.choice(["skip", "reject"]),
            )
            arm.burst(1)
            assert sent.decided
            now = arm.published
            planned = plan.planned(now, step=1)
            if choose.random() < 0.2:
                arm.burst(len(planned) + 3)
            else:
                arm.burst(min(len(planned), 5) + 1)
            happened = arm.history(arm.published - now).desired[: len(planned)]
            assert happened.tolist() == planned[: len(happened)].tolist()
            compared += len(happened)
    assert compared > 50


def test_a_wait_is_a_sign_of_life_for_each_row_and_says_when_the_robot_is_halted(
    segment: str,
) -> None:
    with o80.Backend(segment, ["lift"], silence=5) as backend:
        backend.publish([0.0])
        arm = o80.Frontend(segment)
        plan = arm.chunks(step=2, ease=2)
        plan.send([[0.1], [0.2]], seen=arm.latest())
        with pytest.raises(o80.TimeoutError):  # it is not decided yet
            plan.wait(lead=100, timeout=0.0)
        for _ in range(30):  # the plan runs dry, and no answer comes
            backend.publish(backend.step())
            assert plan.wait(lead=100, timeout=0.0).iteration == arm.published
        assert plan.starved
        assert arm.halted is None
        with pytest.raises(o80.TimeoutError):
            plan.wait(lead=100, timeout=0.0)  # this row was returned
        while arm.halted is None:
            backend.publish(backend.step())
        with pytest.raises(o80.BackendHalted, match=rf"'{segment}' is halted \(.*`resume` it"):  # type: ignore[unreachable]
            plan.wait(lead=100, timeout=0.0)
        arm.close()


def test_a_rejected_answer_says_why(arm: o80.Frontend) -> None:
    arm.burst(450)
    with arm.chunks(step=10, ease=10) as plan:
        late = plan.send(ROWS, seen=100, fixed=True)
        arm.burst(1)
        assert late.rejected
        assert (late.batch[0].reason, late.late, late.begins) == ("late", None, None)
        sent = plan.send(ROWS, seen=101, first=3)
        older = plan.send(ROWS, seen=90)
        arm.burst(1)
        assert (sent.shift, sent.begins, sent.first) == (350, 452, 0)
        assert older.batch[0].reason == "older"
        assert "older observation" in older.batch[0].text


# rule K14
def test_the_row_of_a_camera_is_an_anchor(process: o80.robots.Process) -> None:
    with process.frontend() as arm, o80.Backend(f"{process.segment}-camera", ["lens"]) as camera:
        arm.wait_for(20, WAIT)
        camera.publish([0.0])
        with o80.Frontend(f"{process.segment}-camera") as reader:
            seen = reader.latest()
        arm.wait_for(arm.published + 20, WAIT)
        with arm.chunks(step=2000) as plan:
            sent = plan.send(ROWS, seen=seen)
            plan.wait(lead=10**6, timeout=WAIT)
            told = sent.batch.seen
            assert told is not None
            assert (told.iteration, told.epoch) == (0, seen.epoch)
            before = arm.at_time(seen.time)
            command = next(
                each for entry in arm.journal() for each in entry.commands if each.pace == "chunk"
            )
            assert command.anchor == before.iteration
            arm.purge()
        with (
            o80.robots.load("two_joints").inline() as simulated,
            pytest.raises(o80.InvalidArgument, match="is from another run"),
        ):
            simulated.chunks(step=10).send(ROWS, seen=seen)


# rule K13
def test_an_ensemble_has_the_shares_of_act(arm: o80.Frontend) -> None:
    arm.burst(10)
    with arm.chunks([0], step=10, ease=1, ensemble=0.01) as plan:
        plan.send(np.zeros((6, 1)), seen=10)
        plan.wait(lead=50)
        plan.send(np.ones((6, 1)), seen=20)
        plan.wait(lead=50)
        second = plan.planned(30, 4)[:, 0]
        plan.send(np.ones((6, 1)), seen=30)
        plan.wait(lead=50)
        third = plan.planned(40, 3)[:, 0]
    assert second == pytest.approx([0.4975] * 4, abs=1e-4)
    assert third == pytest.approx([0.4975 + (1 - 0.4975) * 0.33] * 3, abs=1e-3)


# rule K13
def test_weights_are_shares_of_the_new_rows(arm: o80.Frontend) -> None:
    arm.burst(10)
    with arm.chunks("shoulder", step=10, ease=1) as plan:
        plan.send(np.zeros(4), seen=10)
        plan.wait(lead=30)
        plan.send(np.ones(4), seen=20, weights=[0.0, 0.5, 1.0, 0.25])
        plan.wait(lead=30)
        assert plan.planned(20).tolist() == [0.0, 0.5, 1.0, 1.0]


def test_in_real_time_each_answer_is_waited_for_once(process: o80.robots.Process) -> None:
    with process.frontend() as arm, arm.chunks(step=10) as plan:
        asked: list[int] = []

        def answer(place: float) -> o80.SentChunk:
            seen = plan.wait(lead=100, timeout=WAIT)
            asked.append(seen.iteration)
            rows = np.full((40, 2), place)
            prefix = plan.planned(seen, 3)
            rows[: len(prefix)] = prefix
            return plan.send(rows, seen=seen, first=len(prefix))

        for place in (0.01, 0.02, 0.03, 0.04):
            answer(place)
        sent = answer(0.05)
        sent.wait(WAIT)
        while sent.rejected:  # a busy machine has sent it after its last row was due
            sent = answer(0.05)
            sent.wait(WAIT)
        plan.wait(timeout=WAIT)
        assert asked == sorted(set(asked))
        assert sent.batch.statuses == ["completed"]
        assert arm.latest().desired.tolist() == [0.05, 0.05]
        assert plan.wait(grid=True, timeout=WAIT).iteration % 10 == asked[-1] % 10
        row = asyncio.run(plan.aio.wait(lead=20, timeout=WAIT))
        assert row.iteration > asked[-1]


def played(arm: o80.Frontend, sends: list[tuple[int, int, Any, int]]) -> list[list[float]]:
    """Desired rows of a script: when each chunk is sent, what it answers, its rows, `first`."""
    with arm.chunks(step=10, ease=20) as plan:
        for now, seen, rows, first in sends:
            arm.burst(now - arm.published)
            plan.send(rows, seen=seen, first=first)
        arm.burst(700 - arm.published)
    return cast(list[list[float]], arm.history().desired.tolist())


# rule K4
def test_behind_a_frozen_prefix_the_delay_of_an_answer_changes_no_bit() -> None:
    choose = random.Random(4)
    answers = [rows_of(choose, 0.0, 30) for _ in range(4)]

    def delayed(delays: list[int]) -> list[list[float]]:
        with o80.robots.load("two_joints").inline() as arm:
            sends = [
                (100 * (i + 1) + delay, 100 * (i + 1), answers[i], 0 if i == 0 else 8)
                for i, delay in enumerate(delays)
            ]
            return played(arm, sends)

    assert delayed([5, 3, 30, 75]) == delayed([5, 79, 12, 0])


# rule K1
def test_due_iterations_do_not_drift(arm: o80.Frontend) -> None:
    plan = arm.chunks(step=50 / 3)
    exact = [(100 * j + 3) // 6 for j in range(1, 10_001)]  # 50 j / 3, halves up
    assert plan._due(10_000).tolist() == exact
    assert arm.chunks(step=7 / 2)._due(6).tolist() == [4, 7, 11, 14, 18, 21]
    assert arm.chunks(step=5 / 3)._due(6).tolist() == [2, 3, 5, 7, 8, 10]
    assert (1000 + arm.chunks(step=100 / 3)._due(4)).tolist() == [1033, 1067, 1100, 1133]


@pytest.mark.parametrize("stale", ["hold", "purge"])
def test_what_a_killed_sender_left_ends_as_it_was_told(segment: str, stale: Any) -> None:
    step = 20 if stale == "hold" else 1000  # until the last row 4 s, 100 s
    program = (
        "import sys, os, signal, numpy as np, o80\n"
        f"with o80.Frontend({segment!r}) as arm:\n"
        f"    plan = arm.chunks(step={step})\n"
        "    plan.send(np.linspace([0, 0], [1, 1], 100))\n"
        f"    plan.wait(lead={99 * step})\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    with (
        o80.robots.load("two_joints").start(segment, stale=stale) as process,
        process.frontend() as arm,
    ):
        run_python("-c", program, code=None)
        while arm.latest().active.any() or arm.latest().starved.any():  # its death ends its plan
            arm.wait_for(arm.published + 1, WAIT)
        if stale == "hold":
            assert arm.latest().desired.tolist() == [1.0, 1.0]
        else:
            assert arm.latest().desired[0] < 1.0


def marked(history: o80.History) -> list[int]:
    """The first row of each stretch in which a plan is starved, and the one after its last."""
    changes = np.flatnonzero(np.diff(history.starved.any(axis=1).astype(int), prepend=0, append=0))
    return [int(history.iteration[0]) + int(change) for change in changes]


def test_a_starved_plan_is_marked_counted_and_replayed(
    segment: str, arm: o80.Frontend, path: Path
) -> None:
    def burst_and_look(iterations: int, plan: o80.Chunks) -> None:
        for _ in range(iterations):
            row = arm.burst(1)
            assert plan.starved == row.starved.any()

    arm.burst(100)
    with arm.chunks("elbow", step=10, ease=10) as plan:
        plan.send(ROWS[:, 0], seen=100)
        burst_and_look(60, plan)
        plan.send(ROWS[:, 0])
        burst_and_look(60, plan)
        arm.add_command(None, [0.0, 0.0], iterations=10)
        arm.pulse()
        burst_and_look(20, plan)
        plan.send(ROWS[:, 0], final=True)
        burst_and_look(60, plan)
        plan.send(ROWS[:, 0])
        burst_and_look(55, plan)
        shown = run_o80("echo", segment, "--count", "1").stdout
        assert re.search(r"starved elbow\b", shown), shown
        row = arm.latest()
        assert (row.starved.tolist(), row.starvations) == ([False, True], 3)
    assert not plan.starved
    arm.burst(20)
    history = arm.history()
    assert marked(history) == [151, 161, 211, 221, 351, 356]
    assert history.starvations[[150, 151, 210, 211, 370]].tolist() == [0, 1, 1, 2, 3]
    run_o80("save", segment, "-o", path)
    for name in (segment, path):
        shown = run_o80("info", name).stdout
        assert "plans of chunks ran out of rows 3 times" in shown, shown
    said = [command_text(each) for entry in arm.journal() for each in entry.commands]
    assert ["the last of its plan" in line for line in said] == [False] * 3 + [True, False, False]
    assert said[-1] == "close plan"
    for source in (path, arm):
        assert o80.replay(source).identical
    (run,) = o80.replay(path, driver=False)
    assert run.identical
    (run,) = o80.replay(path, driver=False, since=305)
    assert run.identical
    assert run.rows <= 20, "it begins where the plan is closed"


def test_a_frontend_that_closes_ends_its_plans(process: o80.robots.Process) -> None:
    with process.frontend() as other:
        with process.frontend() as arm:
            arm.chunks(step=5).send(np.zeros((4, 2)))
        arm.close()
        last = other.published + 30
        other.wait_for(last, WAIT)
        while other.latest().active.any():
            other.wait_for(other.published + 1, WAIT)
        assert other.wait_for(other.published + 2, WAIT).starvations == 0


@pytest.mark.parametrize(
    ("send", "said"),
    [
        (lambda plan: plan.send([]), "a chunk needs a row|targets of 2 actuators"),
        (lambda plan: plan.send(np.zeros((3, 3))), r"2 actuators must have the shape \(T, 2\)"),
        (lambda plan: plan.send(np.full((3, 2), 4.0)), "shoulder.*-3 to 3"),
        (lambda plan: plan.send(np.full((3, 2), np.nan)), "nan"),
        (lambda plan: plan.send(np.zeros((3, 2)), late="now"), "late must be 'skip' or 'reject'"),
        (lambda plan: plan.send(np.zeros((2, 2)), seen=5, due=[5, 7]), "after iteration 5"),
        (lambda plan: plan.send(np.zeros((2, 2)), due=[9, 9]), "due iterations must rise"),
        (lambda plan: plan.send(np.zeros((2, 2)), weights=[1.0]), "weights must have the shape"),
        (lambda plan: plan.send(np.zeros((2, 2)), seen="now"), "seen"),
        (lambda plan: plan.send(np.zeros((2049, 2))), "from 1 to 2048, got 2049"),
        (lambda plan: plan.send(ROWS, first=-1), "first must be from 0 to 4, got -1"),
        (lambda plan: plan.send(ROWS, seen=2**63), "seen must be from -2147483648"),
        (lambda plan: plan.send(ROWS, due=[10.7]), "due must be a list of whole numbers"),
        (lambda plan: plan.send(ROWS, weights="ab"), "weights must be finite numbers, got 'ab'"),
        (lambda plan: plan.send(ROWS, weights=[1.5] * 5), "weights must be from 0 to 1, got"),
    ],
)
def test_what_cannot_be_sent_is_refused_and_nothing_is_sent(
    arm: o80.Frontend, send: Callable[[Any], object], said: str
) -> None:
    with arm.chunks(step=5) as plan:
        with pytest.raises(o80.InvalidArgument, match=said):
            send(plan)
        arm.burst(5)
        assert not arm.latest().active.any()


def test_the_journal_names_a_chunk(segment: str, arm: o80.Frontend) -> None:
    arm.burst(100)
    with arm.chunks(step=10, ease=10) as plan:
        plan.send(ROWS, seen=100, first=1)
        plan.wait()
    shown = run_o80("echo", segment, "--commands", "--count", "7").stdout
    assert re.search(r"in a chunk due 120 to 150, which answers iteration 100", shown), shown
    assert re.search(r"chunk.*: completed", shown), shown
    command = next(
        command for entry in arm.journal() for command in entry.commands if command.pace == "chunk"
    )
    assert command.due == (110, 120, 130, 140, 150)
    assert (command.anchor, command.ease, command.first) == (100, 10, 1)
    assert command.targets[1].tolist() == ROWS[:, 1].tolist()


class Grip(IntEnum):
    OPEN = 0
    SHUT = 3


def pair(segment: str, state: Any, **options: Any) -> ManualBackend:
    return ManualBackend(segment, ["left", "right"], state, bursting=True, **options)


@pytest.mark.parametrize("kind", [np.float32, np.int8, np.int64, np.bool_, Grip])
@pytest.mark.parametrize("profile", ["smooth", "monotone", "linear", "hold"])
def test_the_plan_is_that_of_the_numbers_which_are_sent(
    segment: str, kind: Any, profile: Any
) -> None:
    choose = random.Random(3)
    drawn: dict[Any, Callable[[], Any]] = {
        np.float32: lambda: choose.uniform(-1, 1),
        np.bool_: lambda: choose.random() < 0.5,
    }
    draw = drawn.get(kind, lambda: choose.choice([0, 3]))
    with pair(segment, kind) as robot:
        arm = robot.frontend
        plan = arm.chunks(step=5, ease=7, profile=profile)
        for _ in range(20):
            plan.send([[draw(), draw()] for _ in range(8)])
            robot.run(1)
            now = arm.published
            planned = plan.planned(now, step=1)
            count = choose.randrange(1, 30)
            robot.run(count)
            desired = arm.history(count).desired
            halves_away = np.trunc(planned + np.copysign(0.5, planned))
            rounded = planned if kind is np.float32 else halves_away
            difference = np.abs(rounded[:count].astype(desired.dtype).astype(float) - desired)
            # on a line, integers of 64 bits begin at the rounded value
            assert difference.max() <= (kind is np.int64 and profile == "linear")


def arm_and_gripper(segment: str) -> ManualBackend:
    joint = [("position", float), ("torque", np.float32)]
    groups = {"joints": (joint, ["left", "right"]), "gripper": float, "valve": bool}
    limits: Any = {"gripper": o80.Limits(minimum=0.0, maximum=1.0), "left": {"torque": (-1, 1)}}
    return ManualBackend(segment, groups, limits=limits, bursting=True)


def test_an_arm_and_its_gripper_are_one_action(segment: str) -> None:
    with arm_and_gripper(segment) as robot, robot.frontend.chunks(step=5, ease=1) as plan:
        arm = robot.frontend
        plan.send([[0.1 * i, -0.1 * i, 0.05 * i, i > 4] for i in range(1, 9)])
        robot.run(1)
        planned = plan.planned(0, step=1)
        assert planned[4::5, 3].tolist() == [0, 0, 0, 0, 1, 1, 1, 1]
        robot.run(len(planned) - 1)
        rows = arm.history(since=1).desired
        shown = (*rows.joints["position"].T, rows.gripper, rows.valve)
        assert np.column_stack(shown).tolist() == planned.tolist()
        assert not rows.joints["torque"].any(), "only the first field of each was given"

        both = {"position": [[0.1, 0.2]] * 3, "torque": [[0.5, -0.5]] * 3}
        sent = plan.send({"joints": both, "gripper": [0.2] * 3, "valve": [True] * 3})
        robot.run(1)
        planned = plan.planned(arm.published, step=1)
        assert planned[-1].tolist() == [0.1, 0.5, 0.2, -0.5, 0.2, 1.0]
        robot.run(20)
        assert sent.batch.statuses == ["completed"]
        assert arm.latest().desired.joints["torque"].tolist() == [0.5, -0.5]
        # weights are those of all numbers that are given
        paths = {"left.torque": [-1.0], "right.position": [1.0], "gripper": [0.4], "valve": [False]}
        plan.send(paths)
        robot.run(8)
        joints = arm.latest().desired.joints
        assert joints.tolist() == [(pytest.approx(0.1), -1.0), (1.0, -0.5)]


def test_rows_outside_the_limits_are_put_on_them_where_that_is_wanted(segment: str) -> None:
    with arm_and_gripper(segment) as robot:
        arm = robot.frontend
        rows = [[0.5, 1.5], [0.5, -0.25], [0.5, 0.75]]
        with arm.chunks(["left", "gripper"], step=2, ease=1, clip=True) as plan:
            sent = plan.send(rows)
            assert sent.clipped == 2
            robot.run(8)
            assert arm.history(since=2).desired.gripper[[0, 2, 4]].tolist() == [1.0, 0.0, 0.75]
        with pytest.raises(o80.InvalidArgument, match="outside its limits: from 0 to 1"):
            arm.chunks(["left", "gripper"], step=2).send(rows)
        arm.add_trajectory(rows, ["left", "gripper"], clip=True)
        arm.add_command("gripper", 7.0, clip=True)
        arm.add_command("joints", [{"torque": 1e30}, {"torque": 0.5}], clip=True)
        assert arm.clipped == 6
        batch = arm.pulse()
        assert (batch.clipped, arm.pulse().clipped) == (4, 0)
        robot.run(6)
        taken = [each.clipped for each in arm.journal() if each.kind == "taken" and each.clipped]
        assert taken == [2, 4]
        told = run_o80("info", segment).stdout
        assert "6 numbers of targets were clipped, in 2 batches" in told
        assert arm.latest().desired.gripper == 1.0
        assert arm.latest().desired.joints["torque"].tolist() == [1.0, 0.5]


def test_a_prepared_burst_moves_an_arm_and_its_gripper(segment: str) -> None:
    with arm_and_gripper(segment) as robot:
        arm = robot.frontend
        burst = arm.prepared_burst(3, ["left", "gripper"], steps=3)
        burst.targets["left"]["torque"] = 0.0
        burst.targets["left"]["position"] = burst.targets["gripper"] = [0.1, 0.2, 0.3]
        waits = threading.Thread(target=burst.run)
        waits.start()
        while arm.published < 3:
            robot.backend.publish(robot.backend.step())
        waits.join()
        desired = burst.rows["desired"]
        assert desired["gripper"].tolist() == [0.1, 0.2, 0.3]
        assert desired["joints"]["position"][:, 0].tolist() == [0.1, 0.2, 0.3]


def test_a_chunk_that_waits_is_planned(arm: o80.Frontend) -> None:
    arm.burst(10)
    with arm.chunks(step=10, ease=10) as plan:
        plan.send(ROWS, seen=100)
        assert plan.left == 140
        assert not plan.starved
        planned = plan.planned(100, step=1)
        seen = plan.wait(lead=20)
        assert seen.iteration == 130
        plan.wait()
        assert arm.history().desired[101:].tolist() == planned.tolist()


@pytest.mark.parametrize("end", ["purge", "halt", "overwrite"])
def test_what_was_dropped_is_no_longer_planned(arm: o80.Frontend, end: str) -> None:
    arm.burst(10)
    with arm.chunks(step=10, ease=10) as plan:
        plan.send(ROWS + 0.5, seen=10)
        arm.burst(15)
        if end == "purge":
            arm.purge()
        elif end == "halt":
            arm.resume(arm.halt("a look"), timeout=WAIT)
        else:
            arm.add_command(None, [0.0, 0.0], iterations=3, mode="overwrite")
            arm.pulse()
        arm.burst(2)
        assert plan.left == 0
        assert not plan.starved
        assert len(plan.planned(arm.published, step=1)) == 0
        arm.burst(8)
        plan.send(ROWS)
        arm.burst(1)
        now = arm.published
        planned = plan.planned(now, step=1)
        plan.wait()
        assert arm.history(len(planned)).desired.tolist() == planned.tolist()


def test_a_plan_that_limits_hold_back_goes_on_until_its_last_row_is_desired(segment: str) -> None:
    limits = {"left": o80.Limits(minimum=-10.0, maximum=10.0, speed=20.0, acceleration=200.0)}
    with pair(segment, float, limits=limits) as robot:
        plan = robot.frontend.chunks("left", step=2, ease=1)
        sent = plan.send([0.5, 1.0], seen=0)
        robot.run(20)
        assert not sent.batch.ended
        plan.send([1.0] * 9)
        robot.run(1)
        planned = plan.planned(20, step=1).tolist()
        assert planned == [1.0] * 18, "from the plan, not from what limits made of it"


def test_a_row_that_is_gone_is_named_and_the_plan_goes_on(segment: str) -> None:
    with pair(segment, float, history=64, journal=0) as robot:
        plan = robot.frontend.chunks("left", step=5)
        plan.send([0.1] * 100)
        robot.run(200)
        assert plan.left == 300
        assert plan.wait(lead=300).iteration == 200
        with pytest.raises(o80.RowOverwritten, match="the history keeps 64 rows"):
            plan.planned(200)
        robot.run(301)
        plan.send([0.2] * 3)
        robot.run(1)
        assert len(plan.planned(501)) > 0


def test_a_plan_keeps_only_what_it_needs(segment: str) -> None:
    with pair(segment, float, history=64) as robot:
        plan = robot.frontend.chunks("left", step=5)
        for _ in range(200):
            plan.send([0.1] * 50)
            robot.run(3)
            plan.planned(robot.frontend.published, 2)
        computed = [part._computed for part in plan._parts]
        kept = sum(len(plan[0]) for plan in filter(None, computed))
        assert len(plan._open) <= 1
        assert len(plan._parts) < 64
        assert kept <= 64 + 250 + 10


def test_a_plan_of_a_later_process_on_the_same_lane_is_another_one(
    bursting: o80.robots.Process, segment: str
) -> None:
    send = f"""
import o80
with o80.Frontend({segment!r}) as arm, arm.chunks(step=1, ease=1) as plan:
    sent = plan.send([[0.5, 0.5]] * %d, seen=%d)
    arm.burst(130)
    print(sent.batch[0].status)
"""
    for rows, seen in ((3, 100), (9, 99)):
        said = run_python("-c", send % (rows, seen))
        assert (said.stdout, said.stderr) == ("completed\n", "")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"step": "a"}, "step must be a number, got 'a'"),
        ({"step": 1e300}, "at most 2"),
        ({"step": Fraction(1, 2)}, "at least 1 iteration"),
        ({"ease": 0}, "ease must be from 1 to 2147483648, got 0"),
        ({"profile": "minimum_jerk"}, "must be one of 'smooth', 'monotone', 'linear', 'hold'"),
        ({"profile": None}, "profile must be a string, got None"),
        ({"ensemble": float("inf")}, "ensemble must be a finite number, got inf"),
    ],
)
def test_a_plan_that_cannot_be_is_refused_when_it_is_opened(
    arm: o80.Frontend, options: dict[str, Any], said: str
) -> None:
    with pytest.raises(o80.InvalidArgument, match=said):
        arm.chunks(**{"step": 5, **options})


def test_several_threads_send_on_one_plan(arm: o80.Frontend) -> None:
    raised: list[BaseException] = []
    with arm.chunks(step=5, ease=1) as plan:

        def send(place: float) -> None:
            try:
                for _ in range(40):
                    plan.send(np.full((20, 2), place))
                    plan.planned(arm.published, 3)
            except BaseException as error:
                raised.append(error)

        threads = [threading.Thread(target=send, args=(0.1 * i,)) for i in range(4)]
        for thread in threads:
            thread.start()
        while any(thread.is_alive() for thread in threads):
            arm.burst(1)
        assert raised == []
        arm.burst(1)
        now = arm.published
        planned = plan.planned(now, step=1)
        plan.wait()
        assert arm.history(len(planned)).desired.tolist() == planned.tolist()


@pytest.mark.parametrize("seed", range(4))
def test_the_journal_and_the_rows_give_the_plans(arm: o80.Frontend, seed: int) -> None:
    choose = random.Random(seed)
    profile: Any = choose.choice(["smooth", "monotone", "linear", "hold"])
    sent = []
    with arm.chunks(step=choose.choice([4, 10, 50 / 3]), profile=profile, ease=9) as plan:
        for _ in range(12):
            arm.burst(choose.randrange(1, 300))
            rows = rows_of(choose, float(arm.latest().desired[0]), choose.randrange(1, 20))
            first = choose.randrange(min(len(rows), 3))
            seen = max(0, arm.published - choose.randrange(40))
            fixed = choose.random() < 0.3
            sent.append(plan.send(rows, seen=seen, first=first, fixed=fixed))
        arm.burst(200)
    history = arm.history()
    found = planned_by_chunks(arm.journal(), history)
    begun = [each for each in sent if each.begins is not None and each.batch[0].status != "purged"]
    begun = [each for each in begun if each.batch.first_iteration is not None]
    assert len(found["elbow"]) == len(found["shoulder"]) > 3
    assert {each.begins for each in found["elbow"]} <= {each.begins for each in begun}
    for i, name in enumerate(("shoulder", "elbow")):
        plans = found[name]
        for planned, after in zip(plans, [*plans[1:], None], strict=True):
            end = planned.begins + len(planned.places)
            end = end if after is None else min(end, after.begins)
            wanted = history.desired[planned.begins : end, i]
            assert planned.places[: len(wanted)].tolist() == wanted.tolist(), "bit for bit"
    legend = plot({"arm": history}, ["elbow"], planned={"arm": found}).axes[0].get_legend()
    assert legend is not None
    assert "planned by chunks" in [text.get_text() for text in legend.get_texts()]


def test_plans_of_the_journal_go_on_only_from_what_was_in_force(arm: o80.Frontend) -> None:
    arm.burst(100)
    with arm.chunks(step=10, ease=1) as plan:
        # it stands: the prefix does not count, and nothing is shifted
        plan.send([[0.1, 0.1]] * 3 + [[0.3, 0.3]] * 9, seen=arm.latest(), first=3)
        arm.burst(30)
        arm.add_command(None, [-0.5, 0.7], iterations=25, mode="overwrite")
        arm.pulse()
        arm.burst(20)
        plan.send([[0.0, 0.0], [0.2, -0.2]], seen=arm.latest())
        arm.burst(40)
    history = arm.history()
    first, second = planned_by_chunks(arm.journal(), history)["shoulder"]
    assert (first.begins, second.begins) == (101, 151)
    assert first.places[:30].tolist() == history.desired[101:131, 0].tolist()
    assert second.places.tolist() == history.desired[151:171, 0].tolist()


def test_without_a_journal_the_plan_behind_a_command_is_not_known(segment: str) -> None:
    robot = o80.robots.load("two_joints")
    with robot.inline(segment, journal=0) as arm, arm.chunks(step=10) as plan:
        plan.send([[0.3, 0.2]] * 3)
        arm.burst(1)
        assert plan.planned(0)[-1].tolist() == [0.3, 0.2], "from rest no journal is needed"
        arm.burst(20)
        arm.add_command(None, [-0.5, 0.7], iterations=50, mode="overwrite")
        arm.burst(20)
        plan.send([[0.0, 0.1], [0.2, -0.2]])
        arm.burst(1)
        with pytest.raises(o80.InvalidArgument, match="needs the journal of"):
            plan.planned(arm.published - 1)


def test_rows_tell_how_far_they_are_from_the_plan(segment: str) -> None:
    limits = {
        name: o80.Limits(speed=5.0, acceleration=20.0, jerk=100.0) for name in ("left", "right")
    }
    choose = random.Random(3)
    with pair(segment, float, limits=limits) as robot:
        arm = robot.frontend
        with arm.chunks(step=20) as plan:
            for _ in range(8):
                plan.send(rows_of(choose, float(arm.latest().desired[0]), 12))
                robot.run(choose.randrange(20, 120))
        history = arm.history()
        found = planned_by_chunks(arm.journal(), history)
    for i, name in enumerate(("left", "right")):
        wanted = np.full(history.iteration[-1] + 30_000, np.nan)
        for each in found[name]:
            wanted[each.begins : each.begins + len(each.places)] = each.places
        rows = history[np.isfinite(wanted[history.iteration]).argmax() :]
        distance = abs(rows.desired[:, i] - wanted[rows.iteration])
        told = np.isfinite(distance)
        assert rows.off_plan[told, i] == pytest.approx(distance[told], rel=1e-6, abs=1e-9)
        assert rows.off_plan[told, i].max() > 1e-3
        assert not rows.off_plan[~rows.clamped[:, i], i].any()
    assert history[-1].off_plan.tolist() == history.off_plan[-1].tolist()


def test_a_row_for_another_year_fills_no_memory(arm: o80.Frontend) -> None:
    with arm.chunks(step=10) as plan:
        plan.send([[0.1, 0.1], [0.3, 0.3]], seen=0, due=[10, 2**31])
        arm.burst(30)
        assert plan.planned(0, 3).shape == (3, 2)
        (planned,) = planned_by_chunks(arm.journal(), arm.history())["elbow"]
        assert len(planned.places) <= 20_030


def test_a_take_over_takes_what_the_slowest_actuator_needs(segment: str) -> None:
    limits = {
        name: o80.Limits(speed=20.0, acceleration=acceleration)
        for name, acceleration in (("left", 200.0), ("right", 20.0))
    }
    with pair(segment, float, limits=limits) as robot:
        arm = robot.frontend
        with arm.chunks(step=10) as plan:
            sent = plan.send([[0.02, 0.02]] * 60)
            assert (sent.first, sent.needed_ease) == (None, None)
            robot.run(1)
            fewest = np.sqrt(5.8 * 0.02 / (20.0 * arm.period**2))
            assert sent.first == np.ceil(fewest / 10) - 1
            assert sent.needed_ease == 0
            planned = plan.planned(0, step=1)
            robot.run(len(planned))
            history = arm.history()
            assert history.desired[1 : len(planned) + 1] == pytest.approx(planned, abs=1e-15)
            assert not history.clamped.any()
        of_journal = planned_by_chunks(arm.journal(), history)
        assert of_journal["left"][0].places[:600] == pytest.approx(planned[:, 0], abs=1e-15)
        with arm.chunks(step=10, ease=1) as plan:
            sent = plan.send([[0.0, 0.0]] * 60)
            robot.run(1)
            assert sent.needed_ease == np.ceil(fewest)
