"""Batches that say by which row they were decided: `pulse(seen=row)`, and what it gives."""

import json
import pickle
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from manual_backend import ManualBackend
from processes import run_o80

import o80
from o80.frontend.backend_texts import latency_percentiles
from o80.joining.plot import plot
from o80.rows.journal import decisions, latencies_of


def decide(arm: o80.Frontend, delays: list[int]) -> list[o80.Batch]:
    """So many batches, each taken so many iterations after the row by which it was decided."""
    batches = []
    for number, delay in enumerate(delays):
        seen = arm.latest()
        if delay > 1:
            arm.burst(delay - 1)
        arm.add_command("elbow", 0.01 * number)
        batches.append(arm.pulse(seen=seen))
        arm.burst(1)
    return batches


def test_a_batch_tells_the_latency_of_its_decision(arm: o80.Frontend) -> None:
    arm.burst(3)
    seen = arm.latest()
    arm.burst(5)
    arm.add_command("elbow", 0.1)
    batch = arm.pulse(seen=seen)
    assert batch.seen is not None
    assert (batch.seen.epoch, batch.seen.iteration) == (seen.epoch, 3)
    assert (batch.seen.time, batch.seen.clock, batch.seen.since) == (seen.time, "simulated", 3)
    assert batch.decision_latency is None
    arm.burst(1)
    assert batch.decision_latency is not None
    arm.add_command("elbow", 0.1)  # type: ignore[unreachable]
    plain = arm.pulse()
    arm.burst(1)
    assert (plain.seen, plain.decision_latency) == (None, None)


def test_every_way_to_send_takes_it(arm: o80.Frontend, segment: str) -> None:
    seen = arm.latest()
    burst = arm.prepared_burst(2, ["elbow"])
    burst.targets = [[0.1]]
    burst.run(seen=seen)
    arm.add_command(0, 0.1)
    arm.pulse_and_wait(seen=seen)
    arm.add_command(0, 0.1)
    arm.burst(1, seen=seen)
    arm.add_command(0, 0.1)
    arm.burst(1, wait=False, seen=seen).wait()
    arm.request("reset", seen=seen)  # a field of it: the reset of this robot has the field `seed`
    o80.burst({arm: 1}, seen=seen)
    taken = [entry for entry in arm.journal() if entry.kind == "taken"]

    assert [entry.seen and entry.seen.iteration for entry in taken] == [0] * 6
    assert {entry.seen.epoch for entry in taken if entry.seen} == {seen.epoch}
    assert [len(entry.commands) for entry in taken] == [1, 1, 1, 1, 1, 0]


SCRIPTS: list[Callable[[o80.Frontend, int], int]] = [
    lambda arm, i: arm.add_command(i % 2, 0.1 * (i % 7), iterations=i % 5 + 1),
    lambda arm, i: arm.add_command(None, [0.1, 0.01 * i], mode="overwrite"),
    lambda arm, i: arm.add_purge(i % 2),
    lambda arm, i: arm.add_request("reset"),
]


# rule B11
def test_it_changes_no_motion(segment: str) -> None:
    def rows(*, say: bool) -> o80.History:
        choose = np.random.default_rng(5)
        with o80.robots.load("two_joints").inline(segment) as arm:
            for i in range(200):
                for _ in range(choose.integers(1, 4)):
                    SCRIPTS[choose.choice(4, p=[0.7, 0.2, 0.07, 0.03])](arm, i)
                at = arm.published + int(choose.integers(1, 9)) if choose.random() < 0.2 else None
                arm.pulse(at=at, seen=arm.latest() if say else None)
                arm.burst(int(choose.integers(1, 5)), seen=arm.latest() if say else None)
            assert any(entry.seen for entry in arm.journal()) is say
            return arm.history()

    silent, told = rows(say=False), rows(say=True)
    assert len(silent) > 300
    assert silent.rows.tobytes() == told.rows.tobytes()


def test_the_journal_says_it_and_echo_prints_it(arm: o80.Frontend, path: Path) -> None:
    with o80.Recording(path, arm):
        decide(arm, [1, 4, 2])
    taken = [entry for entry in arm.journal() if entry.kind == "taken" and entry.commands]
    assert [len(entry.commands) for entry in taken] == [1, 1, 1]
    (recorded,) = o80.open(path)[arm.segment].epochs
    for entries in (arm.journal(), recorded.journal(), recorded.native_journal()):
        found = decisions(entries)
        assert found.iteration.tolist() == [0, 1, 5]
        assert found.latency.tolist() == [1, 4, 2]
        assert set(found.epoch.tolist()) == {arm.latest().epoch}
    assert latency_percentiles(latencies_of(arm.journal())) == {
        "batches": 3,
        "unknown": 0,
        "median": 2,
        "p95": 4,
        "max": 4,
    }
    refused = run_o80("echo", str(path), code=1).stderr
    assert "is a recording: `o80 echo --commands" in " ".join(refused.split())
    lines = run_o80("echo", "--commands", str(path)).stdout
    assert "elbow to 0.01, decided 4 iterations before" in lines
    said = run_o80("echo", "--commands", "--json", str(path)).stdout.splitlines()
    seen = [entry["seen"] for entry in map(json.loads, said) if entry["seen"]]
    assert [each["iteration"] for each in seen] == [0, 1, 5]


def test_info_and_plot_show_it(arm: o80.Frontend, path: Path) -> None:
    with o80.Recording(path, arm):
        decide(arm, [2] * 37 + [5, 5, 9])
    said = "decision latency of 40 batches in iterations of 1 ms: median 2, 95 % 5, "
    assert said + "largest 9" in run_o80("info", str(path)).stdout
    assert said in run_o80("info", arm.segment).stdout
    assert f"{arm.segment}: {said}" in run_o80("list").stdout
    (listed,) = json.loads(run_o80("list", "--json").stdout)
    (run,) = json.loads(run_o80("info", "--json", str(path)).stdout)
    assert run["decision_latency"]["max"] == 9
    assert listed["decision_latency"] == run["decision_latency"]
    history, found = arm.history(), decisions(arm.journal())
    figure = plot({"arm": history}, decided={"arm": found})
    *_, panel = figure.axes
    x, y = panel.lines[0].get_data()
    assert np.asarray(y).tolist() == pytest.approx([2.0] * 37 + [5.0, 5.0, 9.0])
    assert np.asarray(x).tolist() == pytest.approx((found.taken * arm.period).tolist())
    assert len(plot({"arm": history}, decided={"arm": decisions([])}).axes) == 2


@pytest.mark.parametrize(
    "wrong", [3, "row", np.zeros(2), "history", "array", object()], ids=lambda each: str(type(each))
)
def test_what_is_no_observation_is_refused(arm: o80.Frontend, wrong: object) -> None:
    wrong = {"history": arm.history(), "array": arm.history().rows[0]}.get(str(wrong), wrong)
    arm.add_command("elbow", 0.1)
    with pytest.raises(o80.InvalidArgument, match=r"seen must be the observation by which you"):
        arm.pulse(seen=wrong)  # type: ignore[arg-type]
    assert arm.added == 1
    with pytest.raises(o80.InvalidArgument, match="seen must be"):
        arm.request("reset", seen=wrong)  # type: ignore[arg-type]
    for epoch, iteration in ((0, 3), (5, -1), (5, 2**62)):
        with pytest.raises(o80.InvalidArgument, match=f"row {iteration} of run {epoch} is not a"):
            arm.pulse(seen=o80.Seen(epoch, iteration, -1, "monotonic"))
    with pytest.raises(o80.InvalidArgument, match="clock must be 'monotonic' or 'simulated'"):
        o80.Seen(5, 3, -1, "wall")
    assert arm.added == 1


def test_rows_know_their_run_wherever_they_went(
    arm: o80.Frontend, segment: str, path: Path
) -> None:
    with o80.Recording(path, arm):
        arm.burst(3)
    epoch = arm.latest().epoch
    assert epoch != 0
    recorded = o80.open(path)[segment].history()
    for row in (
        arm.history()[-1],
        pickle.loads(pickle.dumps(arm.latest())),
        pickle.loads(pickle.dumps(arm.history()))[-1],
        recorded[-1],
    ):
        assert row.epoch == epoch
        arm.add_command("elbow", 0.1)
        told = arm.pulse(seen=row).seen
        arm.add_command("elbow", 0.2)
        again = arm.pulse(seen=pickle.loads(pickle.dumps(told))).seen  # what another batch says
        assert told is not None
        assert again is not None
        assert (told.iteration, told.epoch) == (again.iteration, again.epoch) == (3, epoch)


def test_after_a_reattach_rows_are_of_the_new_run(segment: str) -> None:
    arm = o80.robots.load("two_joints")
    first = arm.start(segment, bursting=True)
    with o80.Frontend(segment) as frontend:
        before = frontend.latest().epoch
        first.stop()
        with arm.start(segment, bursting=True):
            frontend.reattach()
            row = frontend.burst(1)
            assert row.epoch == frontend.history().epoch == frontend.history()[-1].epoch
            assert row.epoch != before
            frontend.add_command("elbow", 0.1)
            batch = frontend.pulse(seen=row)
            frontend.burst(1)
            assert batch.decision_latency is not None
            assert batch.decision_latency.iterations == 1


def test_a_device_s_row_counts_from_its_capture(segment: str) -> None:
    sensor = {"capture_time": np.int64, "x": np.float64}
    with (
        ManualBackend(segment, ["a"]) as robot,
        o80.Backend(f"{segment}-camera", 0, extended=sensor) as camera,
    ):
        camera.publish()
        arm, eye = robot.frontend, o80.Frontend(f"{segment}-camera")
        captured = arm.latest().time
        robot.run(4)

        def decided(capture_time: int) -> o80.Batch:
            camera.step()
            camera.publish(None, {"capture_time": capture_time, "x": 1.0})
            arm.add_command("a", 1.0)
            return arm.pulse(seen=eye.latest())

        known, nothing = decided(captured), decided(0)
        robot.run()
        joined = o80.align({"arm": arm, "camera": eye}, by="seen")["camera"]
        assert joined.iteration[-1] == 2  # the newest batch; that row captured nothing
        assert np.isnan(joined.age).all()
        assert known.decision_latency is not None
        assert known.decision_latency.iterations == 5
        delay = (arm.latest().time - captured) * 1e-9
        assert known.decision_latency.seconds == pytest.approx(delay)
        assert nothing.decision_latency is not None
        assert nothing.decision_latency.iterations is None
        assert nothing.decision_latency.seconds is None
        eye.close()
