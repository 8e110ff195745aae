"""Inline groups: copies of one robot in this process (o80.InlineGroup)."""

import os
import pickle
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from processes import run_python

import o80
from o80.rows.layout import with_padding

COPIES = 5


@pytest.fixture
def group() -> Iterator[o80.InlineGroup]:
    with o80.robots.load("two_joints").inline(copies=COPIES, threads=2) as group:
        yield group


def files() -> list[str]:
    folder = Path(os.environ.get("O80_DIRECTORY", "/dev/shm"))
    return [file.name for file in folder.glob("o80-*")]


def test_a_burst_is_followed_by_one_whose_targets_are_its_rows(group: o80.InlineGroup) -> None:
    with o80.robots.load("two_joints").inline(copies=COPIES, threads=group) as mirror:
        assert mirror.threads == group.threads == 2
        first = group.prepared_burst(4, mode="overwrite", delay=1)
        second = mirror.prepared_burst(4, steps=4)
        both = first.then(second, "observed")
        assert both.rows is second.rows
        both.targets = np.random.default_rng(5).uniform(-2, 2, (COPIES, 1, 2))
        both.run([4, 1, 2])
        assert first.rows["iteration"][:, 0].tolist() == [0, 1, 1, 0, 1]
        for copy in (1, 2, 4):
            assert (first.rows["desired"][copy, 1:] == both.targets[copy]).all()
            assert (second.targets[copy] == first.rows["observed"][copy]).all()
            assert (second.rows["desired"][copy] == second.targets[copy]).all()
        both.run()
        assert mirror.latest()["iteration"].tolist() == [4, 8, 8, 4, 8]


def test_what_cannot_follow_a_burst_is_said_when_it_is_made(group: o80.InlineGroup) -> None:
    robot = o80.robots.load("two_joints")
    first = group.prepared_burst(4)
    with (
        robot.inline(copies=COPIES, threads=group) as mirror,
        robot.inline(copies=COPIES, threads=2) as stranger,
    ):
        second = mirror.prepared_burst(4, steps=4)
        both = first.then(second, "observed")
        wrong: list[tuple[o80.GroupBurst, o80.GroupBurst, Any, str]] = [
            (first, stranger.prepared_burst(4, steps=4), "observed", "share its threads"),
            (first, group.prepared_burst(4, steps=4), "observed", "share its threads"),
            (first, mirror.prepared_burst(4, steps=2), "observed", "one step for each, got 2"),
            (first, second, "extended.speed", r"no path in a row 'extended\.speed'"),
            (first, second, "iteration", "must have a float64 for each of 2"),
            (first, second, {"position": "observed"}, "no field of the targets 'position'"),
            (first, second, 5, "numbers must be a mapping from fields to"),
            (both, second, "observed", "followed already"),
            (first, both, "observed", "followed already"),
        ]
        for one, other, numbers, words in wrong:
            with pytest.raises(o80.InvalidArgument, match=words):
                one.then(other, numbers)


def test_a_failed_copy_is_named_and_the_others_are_done(group: o80.InlineGroup) -> None:
    burst = group.prepared_burst(4)
    burst.targets = np.zeros((COPIES, 1, 2))
    burst.targets[3, 0, 1] = np.nan
    group[1].halt("a test")
    with pytest.raises(o80.CopyFailed, match=r"copy 1 of 'two_joints' failed.*a test") as failed:
        burst.run()
    assert set(failed.value.errors) == {1, 3}
    assert isinstance(failed.value.errors[1], o80.BackendHalted)
    assert isinstance(failed.value.errors[3], o80.InvalidArgument)
    assert failed.value.__cause__ is failed.value.errors[1]
    assert burst.rows["iteration"][[0, 2, 4], -1].tolist() == [4, 4, 4]
    again = pickle.loads(pickle.dumps(failed.value))
    assert str(again) == str(failed.value)
    assert set(again.errors) == {1, 3}

    burst.targets[3] = 0
    burst.run([True, False, True, True, True])
    assert burst.rows["iteration"][[0, 2, 3, 4], -1].tolist() == [8, 8, 4, 8]


def test_gathers_what_numpy_would(group: o80.InlineGroup) -> None:
    gather = group.gather(
        [
            o80.Gathered("observed", offset=[0.1, 0.2], scale=3, clip=(-0.5, 0.5)),
            "desired.elbow",
            o80.Gathered("extended.effort", scale=[0.5, 2]),
        ],
        {"far": ("observed.elbow", ">", 0.25), "moves": "extended.effort[0]"},
    )
    assert gather.names == [
        "observed.shoulder",
        "observed.elbow",
        "desired.elbow",
        "extended.effort[0]",
        "extended.effort[1]",
    ]
    assert not gather.flags.any()
    burst = group.prepared_burst(7)
    burst.targets = np.random.default_rng(1).uniform(-2, 2, (COPIES, 1, 2))
    for _ in range(4):
        burst.run()
    rows = burst.rows[:, -1]
    expected = np.concatenate(
        [
            np.clip((rows["observed"] - [0.1, 0.2]) * 3, -0.5, 0.5),
            rows["desired"][:, 1:],
            rows["extended"]["effort"] * [0.5, 2],
        ],
        axis=1,
    ).astype(np.float32)
    assert np.array_equal(gather.observations, expected)
    assert np.array_equal(gather["far"], rows["observed"][:, 1] > 0.25)
    assert gather["moves"].all()

    group.request("reset", copies=[1, 2])
    reset = np.array([False, True, True, False, False])
    assert not gather["moves"][reset].any()
    assert np.array_equal(gather.observations[~reset], expected[~reset])


def test_gathers_at_the_paths_that_rows_have() -> None:
    class ArmAndGripper:
        """At rest."""

        joint = np.dtype([("position", "f8"), ("torque", "f4")])
        actuators = {"joints": (joint, ["left", "right"]), "gripper": float}  # noqa: RUF012
        simulated = True

        def read(self, reading: Any) -> None:
            reading.observed["joints"], reading.observed["gripper"] = [(1, 2), (3, 4)], 5

    paths = ["observed.left.position", "observed.gripper", "observed.right", "observed.joints"]
    with o80.robots.load(ArmAndGripper).inline(copies=1) as group:
        gather = group.gather(paths)
        burst = group.prepared_burst(1)
        burst.targets = np.zeros_like(burst.targets)
        burst.run()
        assert gather.observations.tolist() == [[1, 5, 3, 4, 1, 2, 3, 4]]
        row = group[0].latest()
        assert np.hstack([row[path] for path in paths]).tolist() == gather.observations[0].tolist()


def test_a_prepared_request_does_what_a_request_does_bit_for_bit(group: o80.InlineGroup) -> None:
    with o80.robots.load("two_joints").inline(copies=COPIES, threads=1) as other:
        for each in (group, other):
            burst = each.prepared_burst(10)
            burst.targets = np.linspace(-1, 1, burst.targets.size).reshape(burst.targets.shape)
            burst.run()
        before = group.latest()
        reset = group.prepared_request("reset", seed=4)
        assert (reset.fields["seed"] == 4).all()
        reset.fields["seed"][[1, 3]] = [8, 9]
        reset.run([3, 0])
        other.request("reset", copies=[3, 0], seed=[9, 4])
        assert group.latest().tobytes() == other.latest().tobytes()
        assert with_padding(reset.rows)[[0, 3]].tobytes() == other.latest([0, 3]).tobytes()
        assert not reset.rows["iteration"][[1, 2, 4]].any()
        assert group.latest([1, 2, 4]).tobytes() == with_padding(before)[[1, 2, 4]].tobytes()
        reset.run()
        other.request("reset", seed=[4, 8, 4, 9, 4])
        assert reset.rows.tobytes() == other.latest().tobytes()


def test_a_request_instead_of_the_burst_is_both_calls_in_one(group: o80.InlineGroup) -> None:
    with o80.robots.load("two_joints").inline(copies=COPIES, threads=1) as other:
        bursts = [each.prepared_burst(10) for each in (group, other)]
        resets = [each.prepared_request("reset", seed=4) for each in (group, other)]
        for others in ([1, 4], np.array([False, True, False, False, True])):
            for burst in bursts:
                burst.targets = np.linspace(-1, 1, burst.targets.size).reshape(burst.targets.shape)
            bursts[0].run(instead=(others, resets[0]))
            bursts[1].run([0, 2, 3])
            resets[1].run([1, 4])
            assert group.latest().tobytes() == other.latest().tobytes()
            rows = [with_padding(burst.rows) for burst in bursts]
            assert rows[0][[0, 2, 3]].tobytes() == rows[1][[0, 2, 3]].tobytes()
            newest = with_padding(group.latest([1, 4]))[:, np.newaxis]
            assert rows[0][[1, 4]].tobytes() == np.repeat(newest, 10, axis=1).tobytes()
        with pytest.raises(o80.InvalidArgument, match="of the same group"):
            bursts[0].run(instead=([1], resets[1]))
        for wrong, words in (([5], "copies 0 to 4"), (np.array([True, False]), r"shape \(5,\)")):
            with pytest.raises(o80.InvalidArgument, match=words):
                bursts[0].run(instead=(wrong, resets[0]))
        with pytest.raises(o80.InvalidArgument, match=r"copies \[3\] of `instead` must be among"):
            bursts[0].run([0, 1], instead=([1, 3], resets[0]))
        before = group.latest([4])["iteration"]
        bursts[0].run(instead=(np.eye(COPIES, dtype=bool)[:, 4], resets[0]))  # not contiguous
        assert group.latest([4])["iteration"] == before + 1
        restore = group.prepared_request("restore", slot=9)  # there are slots 0 to 7
        with pytest.raises(o80.CopyFailed, match="copy 2 of 'two_joints' failed"):
            bursts[0].run(instead=([2], restore))
        done = bursts[0].rows["iteration"][:, -1] == group.latest()["iteration"]
        assert done[[0, 1, 3, 4]].all(), "all other copies are done"


def test_a_prepared_request_refuses_what_a_request_refuses(group: o80.InlineGroup) -> None:
    with pytest.raises(o80.InvalidArgument, match=r"'rest'.*Did you mean 'reset'"):
        group.prepared_request("rest")
    with pytest.raises(o80.InvalidArgument, match="seeds"):
        group.prepared_request("reset", seeds=3)
    reset = group.prepared_request("reset", seed=1)
    with pytest.raises(o80.InvalidArgument, match="copies 0 to 4"):
        reset.run([5])
    restore = group.prepared_request("restore", slot=9)  # there are slots 0 to 7
    with pytest.raises(o80.CopyFailed, match="copy 2 of 'two_joints' failed"):
        restore.run([2])
    with pytest.raises(TypeError, match="pickle"):
        pickle.dumps(reset)
    group.close()
    with pytest.raises(o80.Closed):
        reset.run()


@pytest.mark.parametrize(
    ("numbers", "flags", "words"),
    [
        (["observed.elbo"], {}, "Did you mean 'observed.elbow'"),
        (["nothing"], {}, "a row has no number 'nothing': it has desired.shoulder"),
        ([o80.Gathered("observed", scale=[1, 2, 3])], {}, "one for each of its 2 numbers"),
        ([o80.Gathered("observed", clip=(1, 0))], {}, r"must be \(low, high\)"),
        ([], {"far": "observed"}, "must compare one number, and 'observed' has 2"),
        ([], {"far": ("observed.elbow", "~", 1)}, "comparison of a flag must be one of "),
        ([], {"far": ("observed.elbow", "==", "open")}, "has no label 'open'"),
        ("observed", {}, "must be a list"),
    ],
)
def test_says_what_cannot_be_gathered(
    group: o80.InlineGroup, numbers: list[str], flags: dict[str, str], words: str
) -> None:
    with pytest.raises(o80.InvalidArgument, match=words):
        group.gather(numbers, flags)


def test_refuses_wrong_arguments(group: o80.InlineGroup) -> None:
    robot: Any = o80.robots.load("two_joints")
    burst = group.prepared_burst(4)
    burst.targets = np.zeros((5, 1, 2))
    wrong: list[tuple[Callable[[], object], str]] = [
        (lambda: robot.inline(copies=0), "copies must be at least 1, got 0"),
        (lambda: robot.inline(threads=2), "give copies too"),
        (lambda: robot.inline("arm", copies=2), "leave out segment"),
        (lambda: group.prepared_burst(65), "history=65"),
        (lambda: group.prepared_burst(5, delay=5), "delay of a burst of 5 iterations must be"),
        (lambda: setattr(burst, "targets", np.zeros((5, 2))), r"steps, actuators\) = \(5, 1, 2\)"),
        (lambda: burst.run([5]), "copies 0 to 4"),
        (lambda: burst.run([-1]), "copies 0 to 4"),
        (lambda: burst.run([1, 1]), "named twice"),
        (lambda: burst.run([True]), "must have the shape"),
        (lambda: burst.run([0.5]), "list of numbers"),
        (lambda: burst.run(3), "list of numbers"),
        (lambda: group.request("reset", seed=[1, 2]), "seed of request 'reset' has 2 entries"),
        (lambda: group.request("rest"), "'rest'.*Did you mean 'reset'"),
    ]
    for call, words in wrong:
        with pytest.raises(o80.InvalidArgument, match=words):
            call()
    burst.run([])
    assert not burst.rows["iteration"].any()
    with pytest.raises(IndexError, match="copies 0 to 4"):
        group[5]
    for thing in (burst, group):
        with pytest.raises(TypeError, match="cannot be pickled, it belongs to this process"):
            pickle.dumps(thing)


def test_knows_each_halt_of_a_copy(group: o80.InlineGroup) -> None:
    def halted() -> set[int]:
        assert {i for i in range(len(group)) if group[i].halted} == {*group.halted}
        return {*group.halted}

    assert halted() == set()
    group[1].halt("by a frontend of the copy")
    assert halted() == {1}
    group.resume()
    name = f"test-{os.getpid()}-copy"
    group.publish(3, name)
    assert halted() == set()
    with o80.Frontend(name) as other:  # as another process would
        other.halt("by another frontend")
    assert halted() == {3}, "before the copy runs again"
    group.resume([3])
    assert halted() == set()


def test_a_group_that_is_never_closed_is_warned_about_and_stopped() -> None:
    held = [o80.robots.load("two_joints").inline(copies=2)]
    held[0].publish(0, "forgotten")
    with pytest.warns(ResourceWarning, match="the inline group of 'two_joints' was never closed"):
        held.clear()
    assert files() == []


CTRL_C = """
import os, signal, sys, threading, time
import o80
group = o80.robots.load("two_joints").inline(copies=4, threads=4)
burst = group.prepared_burst(30)
burst.targets[...] = 0.5
for _ in range(10):
    burst.run()
def interrupt():
    while group[3].published < 301:  # the long request of the last copy has begun
        time.sleep(0.001)
    os.kill(os.getpid(), signal.SIGINT)
threading.Thread(target=interrupt, daemon=True).start()
try:
    group.request("home", speed=1e-9)  # takes years
except KeyboardInterrupt:
    reached = group.latest()["iteration"].copy()
    for i in range(4):
        group[i].burst(5)
    assert (group.latest()["iteration"] == reached + 5).all()
    print("interrupted")
"""


def test_ctrl_c_ends_a_call_between_two_iterations() -> None:
    ended = run_python("-W", "ignore", "-c", CTRL_C, code=None)
    assert ended.stdout == "interrupted\n", ended.stderr


def test_a_slice_names_copies(group: o80.InlineGroup) -> None:
    burst = group.prepared_burst(3)
    burst.targets = np.zeros((COPIES, 1, 2))
    burst.run(slice(None))
    burst.run(slice(None, None, 2))
    assert [row["iteration"] for row in group.latest()] == [6, 3, 6, 3, 6]
