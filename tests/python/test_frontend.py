"""A frontend: its life, what it knows of its robot, and how it commands."""

import builtins
import os
import pickle
import threading
import warnings

import numpy as np
import pytest

import o80

WAIT = 30.0  # [s] longer than any wait should take


def test_it_waits_for_a_backend_that_starts_later(segment: str) -> None:
    found: list[str] = []

    def attach() -> None:
        with o80.Frontend(segment, timeout=WAIT) as frontend:
            found.append(frontend.robot)

    waiting = threading.Thread(target=attach)
    waiting.start()
    with o80.robots.load("two_joints").start(segment):
        waiting.join(WAIT)

    assert found == ["two_joints"]


def test_it_gives_up_after_its_timeout(segment: str) -> None:
    with pytest.raises(o80.TimeoutError, match=segment):
        o80.Frontend(segment, timeout=0.01)


def test_a_timeout_is_a_builtin_one(segment: str) -> None:
    with pytest.raises(builtins.TimeoutError):
        o80.Frontend(segment, timeout=0.01)


def test_it_knows_its_robot(arm: o80.Frontend, segment: str) -> None:
    assert arm.robot == "two_joints"
    assert arm.segment == segment
    assert [actuator.name for actuator in arm.actuators] == ["shoulder", "elbow"]
    assert arm.actuators[1].index == 1
    assert (arm.actuators[1].minimum, arm.actuators[1].maximum) == (-3.0, 3.0)
    assert arm.actuators[0].when_idle == "hold"
    assert list(arm.requests) == ["reset", "snapshot", "restore"]
    assert arm.frequency == pytest.approx(1000.0)
    assert arm.period == pytest.approx(0.001)
    assert arm.bursting
    assert arm.alive
    assert arm.schema["extended"]["fields"][0]["name"] == "effort"


def test_actuators_go_by_index_or_name(arm: o80.Frontend) -> None:
    arm.add_command(np.int64(0), 0.25)
    arm.add_command("elbow", 0.5)

    assert arm.burst(1).desired.tolist() == [0.25, 0.5]


@pytest.mark.parametrize(
    ("actuator", "text"),
    [("wrist", "shoulder.*elbow"), (2, "shoulder.*elbow"), (-1, "elbow"), (1.5, "index or its")],
)
def test_an_unknown_actuator_is_refused_with_what_there_is(
    arm: o80.Frontend, actuator: int | str, text: str
) -> None:
    with pytest.raises(o80.InvalidArgument, match=text):
        arm.add_command(actuator, 0.0)


@pytest.mark.parametrize("target", [3.1, float("nan"), float("inf"), "fast", None, [1, 2], {}])
def test_a_target_that_cannot_be_followed_is_refused_when_it_is_added(
    arm: o80.Frontend, target: object
) -> None:
    with pytest.raises(o80.InvalidArgument, match="elbow"):
        arm.add_command("elbow", target)

    assert arm.added == 0


def test_a_refusal_is_a_value_error(arm: o80.Frontend) -> None:
    with pytest.raises(ValueError, match="elbow"):
        arm.add_command("elbow", 4.0)


@pytest.mark.parametrize("target", [1, 0.5, np.float32(0.5), np.int8(1), np.array(0.5), True])
def test_every_number_is_a_target(arm: o80.Frontend, target: float) -> None:
    arm.add_command("elbow", target)

    assert arm.burst(1).desired[1] == float(target)


def test_a_command_has_one_pace(arm: o80.Frontend) -> None:
    with pytest.raises(o80.InvalidArgument, match="duration, speed, until and iterations"):
        arm.add_command(0, 0.5, duration=1.0, iterations=3)


@pytest.mark.parametrize(
    "pace",
    [
        {"duration": -1.0},
        {"duration": float("nan")},
        {"duration": 1e300},
        {"duration": "1 s"},
        {"speed": 0.0},
        {"speed": -1.0},
        {"until": -1},
        {"until": 2.5},
        {"iterations": 0},
        {"iterations": 2**70},
        {"mode": "replace"},
        {"profile": "cubic"},
        {"start": "here"},
        {"mode": 1},
    ],
)
def test_a_pace_that_cannot_be_is_refused(arm: o80.Frontend, pace: dict[str, object]) -> None:
    with pytest.raises(o80.InvalidArgument):
        arm.add_command(0, 0.5, **pace)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("pace", "iterations"),
    [
        ({}, 1),
        ({"iterations": 4}, 4),
        ({"duration": 0.005}, 5),
        ({"speed": 100.0}, 5),
        ({"until": 6}, 6),
    ],
)
def test_each_pace_takes_its_iterations(
    arm: o80.Frontend, pace: dict[str, float], iterations: int
) -> None:
    arm.add_command(0, 0.5, **pace)  # type: ignore[arg-type]

    observation = arm.pulse_and_wait(timeout=WAIT)

    assert observation.iteration == iterations
    assert observation.desired[0] == 0.5


def test_queue_appends_and_overwrite_replaces(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0, iterations=10)
    arm.add_command(0, 2.0, iterations=10)
    arm.add_command(1, 1.0, iterations=10)
    arm.add_command(1, 2.0, iterations=10, mode=o80.Mode.OVERWRITE)

    desired = arm.burst(10).desired

    assert desired.tolist() == [1.0, 2.0]


def test_profiles_differ_between_their_ends(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0, iterations=4, profile="linear")
    arm.add_command(1, 1.0, iterations=4, profile=o80.Profile.MINIMUM_JERK)

    arm.burst(4)

    desired = arm.history(since=1, until=4).desired
    assert desired[0, 0] == 0.25
    assert desired[0, 1] < 0.25
    assert desired[3].tolist() == [1.0, 1.0]


def test_a_command_may_start_from_the_observed_state(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0)
    observed = arm.burst(1).observed[0]
    arm.add_command(0, 1.0, iterations=2, start=o80.Start.OBSERVED)

    assert arm.burst(1).desired[0] == pytest.approx((observed + 1.0) / 2)


def test_initial_states_are_those_before_anything_was_asked(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0)
    arm.burst(10)

    assert arm.initial_states.tolist() == [0.0, 0.0]


def test_a_request_is_served_at_once_and_leaves_what_was_added(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0)
    arm.burst(100)
    arm.add_command(1, 0.5)

    arm.request("reset", seed=1)

    assert arm.latest().fresh
    assert arm.latest().observed.tolist() == [0.0, 0.0]
    assert arm.added == 1


def test_a_rejected_request_raises_the_text_of_the_driver(arm: o80.Frontend) -> None:
    with pytest.raises(o80.RequestRejected, match="there are slots 0 to 7"):
        arm.request("snapshot", slot=8)


def test_an_unknown_request_or_field_is_refused_with_what_there_is(arm: o80.Frontend) -> None:
    with pytest.raises(o80.InvalidArgument, match="reset, snapshot, restore"):
        arm.request("launch")
    with pytest.raises(o80.InvalidArgument, match="seed"):
        arm.request("reset", sed=1)
    with pytest.raises(o80.InvalidArgument, match="seed"):
        arm.request("reset", seed=-1)


def test_a_request_may_be_part_of_a_pulse(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0)
    arm.burst(10)
    arm.add_request("reset", seed=1)
    arm.add_command(0, 0.5)

    observation = arm.burst(1)

    assert observation.desired[0] == 0.5


def test_snapshot_run_restore_run_is_the_same(arm: o80.Frontend) -> None:
    def run() -> list[list[float]]:
        first = arm.published + 1
        arm.add_command(0, 1.0, iterations=20)
        arm.burst(20)
        rows: list[list[float]] = arm.history(since=first).observed.tolist()
        return rows

    arm.request("snapshot", slot=3)
    once = run()
    arm.request("restore", slot=3)

    assert run() == once


def test_purge_needs_no_pulse(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0, iterations=100)
    arm.add_command(1, 1.0, iterations=100)
    batch = arm.pulse()
    arm.burst(10)

    arm.purge("shoulder")

    assert batch.statuses == [o80.Status.PURGED, o80.Status.ACTIVE]


def test_purge_of_all_drops_all(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0, iterations=100)
    arm.add_command(1, 1.0, iterations=100)
    batch = arm.pulse()

    arm.purge()

    assert batch.statuses == [o80.Status.PURGED, o80.Status.PURGED]


def test_a_purge_may_be_part_of_a_pulse(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0, iterations=100)
    first = arm.pulse()
    arm.add_purge(0)
    arm.add_command(0, 0.5, iterations=2)
    assert first.statuses != [o80.Status.PURGED]

    observation = arm.pulse_and_wait(timeout=WAIT)

    assert first.statuses == [o80.Status.PURGED]
    assert observation.desired[0] == 0.5


def test_what_was_added_and_never_pulsed_is_warned_about(segment: str) -> None:
    arm = o80.robots.load("two_joints").inline(segment)
    arm.add_command(0, 1.0)

    with pytest.warns(ResourceWarning, match="never pulsed"):
        arm.close()


def test_what_was_pulsed_is_not_warned_about(segment: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with o80.robots.load("two_joints").inline(segment) as arm:
            arm.add_command(0, 1.0)
            arm.pulse()


def test_leaving_a_with_block_lets_motion_complete(process: o80.robots.Process) -> None:
    with process.frontend() as watcher:
        with process.frontend() as arm:
            arm.add_command(0, 1.0, iterations=20)
            arm.pulse()
        while watcher.latest().desired[0] < 1.0:
            watcher.wait_for_next(WAIT)


def test_an_error_in_a_with_block_purges_what_the_frontend_sent(
    bursting: o80.robots.Process,
) -> None:
    with bursting.frontend() as other:
        other.add_command(1, 1.0, iterations=100)
        kept = other.pulse()
        batch = fail_in(bursting.frontend())
        other.burst(1)

        assert batch.statuses == [o80.Status.PURGED]
        assert kept.statuses == [o80.Status.ACTIVE]


def test_motion_may_go_on_after_an_error(bursting: o80.robots.Process) -> None:
    with bursting.frontend() as other:
        batch = fail_in(bursting.frontend(on_error="continue"))
        other.burst(1)

        assert batch.statuses == [o80.Status.ACTIVE]


def fail_in(frontend: o80.Frontend) -> o80.Batch:
    """Sends a command of many iterations and leaves its block by an exception."""
    with pytest.raises(ZeroDivisionError), frontend as arm:  # noqa: PT012
        arm.add_command(0, 1.0, iterations=100)
        batch = arm.pulse()
        arm.add_command(0, 2.0)  # never pulsed, and not worth a warning any more
        raise ZeroDivisionError
    return batch


def test_the_word_for_errors_is_checked(process: o80.robots.Process) -> None:
    with pytest.raises(o80.InvalidArgument, match="continue"):
        process.frontend(on_error="ignore")


def test_exclusive_control_keeps_others_out(process: o80.robots.Process) -> None:
    with process.frontend() as arm, process.frontend() as other:
        with arm.control():
            other.add_command(0, 1.0)
            refused = other.pulse()
            refused.wait(WAIT)
            with pytest.raises(o80.ControlTaken, match="exclusive control"), other.control():
                pass
        other.add_command(0, 1.0)
        taken = other.pulse()
        taken.wait(WAIT)

    assert refused.statuses == [o80.Status.REJECTED]
    assert refused.handles[0].reason == o80.Reason.EXCLUSIVE
    assert taken.statuses == [o80.Status.COMPLETED]


def test_a_reader_takes_no_lane_and_cannot_command(process: o80.robots.Process) -> None:
    with o80.Frontend(process.segment, read_only=True) as reader:
        assert reader.latest().iteration >= 0
        assert reader.wait_for_next(WAIT).iteration > 0
        reader.add_command(0, 0.5)
        with pytest.raises(o80.ReadOnly, match=process.segment):
            reader.pulse()
        reader.forget_added()


def test_many_readers_attach_to_few_lanes(segment: str) -> None:
    with o80.robots.load("two_joints").start(segment, lanes=1) as process:
        readers = [process.frontend() for _ in range(5)]
        readers[0].add_command(0, 0.5)
        readers[0].pulse()
        readers[1].add_command(0, 0.5)
        with pytest.raises(o80.NoLane):
            readers[1].pulse()
        readers[0].close()
        readers[1].pulse_and_wait(timeout=WAIT)
        for reader in readers:
            reader.close()


def test_a_full_lane_is_an_error_and_sends_nothing(segment: str) -> None:
    with (
        o80.robots.load("two_joints").start(segment, lane_blocks=16) as process,
        process.frontend() as arm,
    ):
        for _ in range(100):
            arm.add_command(0, 0.5)
        with pytest.raises(o80.LaneFull):
            arm.pulse()
        assert arm.added == 100
        arm.forget_added()
        arm.add_command(0, 0.5)
        arm.pulse_and_wait(timeout=WAIT)


def test_a_closed_frontend_says_so(arm: o80.Frontend) -> None:
    arm.close()
    arm.close()

    assert arm.closed
    for use in (arm.latest, arm.pulse, arm.wait_for_next, arm.history, arm.burst, arm.purge):
        with pytest.raises(o80.Closed, match=arm.segment):
            use()
    with pytest.raises(o80.Closed):
        arm.add_command(0, 1.0)


def test_a_closed_inline_robot_leaves_no_segment(arm: o80.Frontend) -> None:
    arm.add_command(0, 1.0)
    batch = arm.pulse()

    arm.close()

    assert arm.segment not in [entry.name for entry in o80.segments()]
    assert batch.statuses == [o80.Status.PURGED]


def test_a_pickled_frontend_attaches_again(process: o80.robots.Process) -> None:
    with process.frontend() as arm, pickle.loads(pickle.dumps(arm)) as copy:
        assert isinstance(copy, o80.Frontend)
        assert copy is not arm
        assert copy.epoch == arm.epoch
        copy.add_command(0, 0.5)
        copy.pulse_and_wait(timeout=WAIT)


def test_an_inline_frontend_cannot_be_pickled(arm: o80.Frontend) -> None:
    with pytest.raises(TypeError, match="Attach to its segment"):
        pickle.dumps(arm)


def test_a_forked_child_is_told_to_open_its_own(process: o80.robots.Process) -> None:
    with process.frontend() as arm:
        arm.add_command(0, 0.5)
        batch = arm.pulse()
        batch.wait(WAIT)

        assert run_in_child(lambda: use_after_fork(arm, batch)) == 0

        arm.add_command(0, 1.0)
        arm.pulse_and_wait(timeout=WAIT)


def use_after_fork(arm: o80.Frontend, batch: o80.Batch) -> None:
    for use in (arm.latest, arm.pulse, arm.wait_for_next, lambda: batch.statuses):
        with pytest.raises(o80.UsedAfterFork, match="open it again in this process"):
            use()
    with pytest.raises(o80.UsedAfterFork):
        arm.add_command(0, 1.0)
    arm.close()
    with o80.Frontend(arm.segment) as again:
        again.add_command(0, 0.7)
        again.pulse_and_wait(timeout=WAIT)


def test_a_forked_child_leaves_an_inline_robot_to_its_parent(arm: o80.Frontend) -> None:
    arm.burst(1)

    assert run_in_child(arm.close) == 0

    assert arm.alive
    assert arm.burst(1).iteration == 2


def run_in_child(work: object) -> int:
    """Runs it in a forked child; its exit code, 0 if nothing was raised."""
    assert callable(work)
    child = os.fork()
    if child == 0:
        try:
            work()
        except BaseException as error:
            os.write(2, repr(error).encode())
            os._exit(1)
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def test_it_attaches_again_after_the_robot_was_started_anew(segment: str) -> None:
    robot = o80.robots.load("two_joints")
    with robot.start(segment) as process:
        arm = process.frontend()
        epoch = arm.epoch
    assert not arm.alive
    with robot.start(segment):
        with pytest.raises(o80.BackendGone, match=segment):
            arm.wait_for(10**9, timeout=WAIT)
        arm.reattach()
        assert arm.epoch != epoch
        arm.add_command(0, 0.5)
        assert arm.pulse_and_wait(timeout=WAIT).desired[0] == 0.5
        arm.close()


def test_it_refuses_to_attach_again_to_another_robot(segment: str) -> None:
    with o80.robots.load("two_joints").start(segment) as process:
        arm = process.frontend()
    with o80.Backend(segment, ["a"]) as backend:
        backend.publish([0.0])
        with pytest.raises(o80.SchemaMismatch, match="open a new frontend"):
            arm.reattach()
    arm.close()


def test_a_robot_may_have_a_frontend_of_its_own(segment: str) -> None:
    class TwoJoints(o80.Frontend):
        def add_elbow(self, angle: float) -> None:
            self.add_command("elbow", angle)

    o80.register_frontend("two_joints_of_its_own", TwoJoints)
    with o80.Backend(segment, ["elbow"], robot="two_joints_of_its_own") as backend:
        backend.publish([0.0])
        with o80.Frontend(segment) as arm:
            assert isinstance(arm, TwoJoints)
            arm.add_elbow(0.5)
            arm.pulse()
            assert backend.step() == [0.5]


def test_a_group_is_burst_at_once(segment: str) -> None:
    robot = o80.robots.load("two_joints")
    with (
        robot.start(f"{segment}-left", bursting=True) as one,
        robot.inline(f"{segment}-right") as right,
        one.frontend() as left,
    ):
        rows = o80.burst({left: 5, right: 7}, timeout=WAIT)

        assert rows[left].iteration == 5
        assert rows[right].iteration == 7


def test_a_group_with_one_that_cannot_burst_does_not_begin(
    process: o80.robots.Process, segment: str
) -> None:
    with (
        o80.robots.load("two_joints").inline(f"{segment}-still") as still,
        process.frontend() as moving,
    ):
        with pytest.raises(o80.NotBursting, match=process.segment):
            o80.burst({still: 5, moving: 5})

        assert still.latest().iteration == 0


def test_a_backend_by_the_clock_is_not_burst(process: o80.robots.Process) -> None:
    with process.frontend() as arm, pytest.raises(o80.NotBursting, match=process.segment):
        arm.burst(1)


@pytest.mark.parametrize("iterations", [0, -1])
def test_a_burst_has_at_least_one_iteration(arm: o80.Frontend, iterations: int) -> None:
    with pytest.raises(o80.InvalidArgument):
        arm.burst(iterations)


def test_a_burst_may_return_at_once(bursting: o80.robots.Process) -> None:
    with bursting.frontend() as arm:
        burst = arm.burst(10, wait=False)

        assert burst.wait(WAIT).iteration == 10
        assert burst.done


def test_a_frontend_says_what_it_is(arm: o80.Frontend) -> None:
    assert "two_joints" in repr(arm)
    arm.close()
    assert "closed" in repr(arm)
