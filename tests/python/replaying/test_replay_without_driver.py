"""A robot of the world is replayed without its driver: its desired states repeat bit for bit."""

import os
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
import pytest
from flipped import Flipped
from processes import run_o80

import o80
from o80.drivers import Desired, Reading
from o80.replaying.recorded_run import runs_in
from o80.replaying.replay import RunReplay
from o80.rows.actuators import blending

JOINT = {"position": float, "velocity": float}
NAMES = ("shoulder", "elbow", "wrist")


def send_anything(arm: o80.Frontend, choose: random.Random) -> o80.Batch:
    """Commands of every kind, some of them without effect."""
    for _ in range(choose.randrange(1, 3)):
        pace: dict[str, Any] = choose.choice(
            [{}, {}, {"iterations": choose.randrange(1, 9)}, {"duration": 0.0035}, {"speed": 200.0}]
        )
        if not pace and choose.random() < 0.5:
            pace = {"profile": "as_sent"}
        place = choose.choice([-1.0, 0.0, 0.1, choose.uniform(-2.5, 2.5)])
        names = choose.sample(NAMES, 1) if "speed" in pace else choose.sample(NAMES, 2)
        pace["mode"] = choose.choice(["queue", "overwrite"])
        arm.add_command(names, [{"position": place}] * len(names), **pace)
    if choose.random() < 0.2:
        arm.add_purge(choose.choice(NAMES))
    return arm.pulse()


@pytest.mark.parametrize("seed", range(2))
def test_it_begins_at_any_row_in_which_nothing_acts(segment: str, seed: int) -> None:
    choose = random.Random(seed)
    limit = o80.Limits(minimum=-3.0, maximum=3.0, speed=400.0, acceleration=50000.0, jerk=1e8)
    with o80.Backend(
        segment,
        NAMES,
        JOINT,
        limits={"shoulder": {"position": limit}, "elbow": {"position": o80.Limits(speed=300.0)}},
        rests_at={"elbow": {"velocity": 0.0}},
        when_idle={"wrist": "follow"},
    ) as backend:
        place = np.zeros(3, [("position", float), ("velocity", float)])
        backend.publish(place)
        at_rest = []
        calm = 0  # rows until this one
        with o80.Frontend(segment) as arm:
            batches: list[o80.Batch] = []
            for row in range(1, 400):
                if choose.random() < 0.04:
                    batches.append(send_anything(arm, choose))
                if choose.random() < 0.01:
                    backend.interrupt(choose.choice(NAMES))
                place[:] = backend.step()
                place["position"] += choose.choice([0.0, 0.0, choose.gauss(0, 0.01)])
                backend.publish(place)
                batches = [batch for batch in batches if not batch.ended]
                shown = arm.latest()
                masks = shown.active.any() or shown.clamped.any() or shown.braking.any()
                decided = any(entry.iteration == row for entry in arm.journal())
                calm = 0 if batches or masks or decided else calm + 1
                if calm > 1:  # in the first one, a motion may still have an acceleration
                    at_rest.append(row)
        with o80.Frontend(segment, read_only=True, dead=True) as arm:
            for row in choose.sample(at_rest, 20):
                (run,) = o80.replay(arm, since=row)
                assert run.identical, run
                assert f"the replay begins at rest in row {row}" in run.notes
                assert run.rows == 400 - row


def test_it_does_not_begin_between_a_purge_and_a_batch_that_it_still_purges(segment: str) -> None:
    """One for a later iteration. What is left of it acts in rows 20 to 23."""
    with o80.Backend(segment, ["one", "other"]) as backend:
        backend.publish([0.0, 0.0])
        with o80.Frontend(segment) as arm, o80.Frontend(segment) as second:
            arm.add_command(["one", "other"], [1.0, 1.0], iterations=4)
            later = arm.pulse(at=20)
            for row in range(1, 40):
                if row == 8:
                    second.add_purge("other")
                    second.pulse()
                desired = backend.step()
                assert desired is not None
                backend.publish(desired)
            assert later.statuses == [o80.Status.PURGED]
        with o80.Frontend(segment, read_only=True, dead=True) as arm:
            begins = []
            for row in (4, 12, 30):
                (run,) = o80.replay(arm, since=row)
                assert run.identical, run
                begins.append(run.notes[0])
    row_of = "the replay begins at rest in row"
    assert begins == [f"{row_of} 4", f"{row_of} 24", f"{row_of} 30"]


def test_a_recording_that_begins_late_is_replayed_from_where_nothing_acts(
    segment: str, path: Path
) -> None:
    """It moved before, and its first rows were overwritten."""
    with o80.robots.load("two_joints").inline(segment, history=64) as arm:
        arm.add_command("elbow", 0.5, iterations=20)
        arm.burst(300)
        with o80.Recording(path, arm):
            arm.add_command("elbow", 0.1, iterations=20)
            arm.burst(30)
    (recorded,) = runs_in(o80.open(path))
    assert next(recorded.blocks()).iteration[0] > 200
    (run,) = o80.replay(path, driver=False)
    assert (run.difference, run.gap) == (None, "")
    assert not run.identical
    assert run.rows > 60
    assert "--without-driver" in run_o80("replay", path, code=2).stdout
    words = ("replay", path, "--without-driver")
    assert "; rows before 2" in run_o80(*words, code=2).stdout
    run_o80(*words, "--since", run.first)
    assert "not used" in run_o80(*words, "--since", run.first, "--set", "gain=2", code=2).stdout


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a robot of the world: it moves by itself, and jumps when it is asked to."""
    path = tmp_path_factory.mktemp("run") / "run.mcap"
    choose = random.Random(3)
    place = np.zeros(3, [("position", float), ("velocity", float)])
    segment = f"test-{os.getpid()}-world"
    with o80.Backend(segment, NAMES, JOINT, requests={"jump": None}) as backend:
        backend.on("jump", lambda _: o80.StartAfresh(place.copy()))
        backend.publish(place)
        with o80.Frontend(segment) as arm, o80.Recording(path, arm):
            for row in range(400):
                if row % 60 == 59:
                    arm.add_request("jump")
                else:
                    arm.add_command(
                        choose.choice(NAMES),
                        {"position": choose.uniform(-1, 1)},
                        iterations=choose.randrange(1, 9),
                        mode=choose.choice(["queue", "overwrite"]),
                        start=choose.choice(["desired", "observed"]),
                    )
                arm.pulse()
                place[:] = backend.step()
                place["position"] += choose.gauss(0, 0.01)
                backend.publish(place)
    o80.clean(segment)
    return path


def test_a_changed_decision_is_found(recorded: Path) -> None:
    """A recording whose rows show motion that its journal does not explain."""
    (run,) = runs_in(o80.open(recorded))

    class Silent(Flipped):
        def entries(self) -> Iterator[Any]:
            return (entry for entry in self.run.entries() if entry.kind == "status")

    report = RunReplay(Silent(run, 0, 0, 0)).report()  # type: ignore[arg-type]
    assert report.difference is not None or "the journal lacks" in report.gap


def test_it_begins_at_a_fresh_start(recorded: Path) -> None:
    (run,) = runs_in(o80.open(recorded))
    fresh = [
        int(row)
        for block in run.blocks()
        for row in block.iteration[(block.rows["fresh"] != 0) & (block.rows["halted"] == 0)]
    ]
    for row in fresh:
        (found,) = report = o80.replay(recorded, since=row)
        assert report.identical, report
        assert 0 < found.rows < run.rows
        if f"the replay begins with the fresh start of row {row}" in found.notes:
            return
    raise AssertionError("no replay began with a fresh start")


def test_the_command_says_what_was_compared(recorded: Path) -> None:
    done = run_o80("replay", recorded)
    assert done.stderr == ""
    assert "compared: desired states" in done.stdout
    assert "does not declare that it is simulated" in done.stdout


def test_a_nested_type_with_an_interpolation_of_its_own_is_interpolated_by_numbers() -> None:
    turn = {"fields": [], "blends": True}  # only the driver's blend() of a whole state is called
    nested = {"fields": [{"kind": "struct", "type": turn}]}
    actuators = [{"name": "wrist", "group": 0}, {"name": "tool", "group": 1}]
    assert blending({"groups": [{"type": turn}, {"type": nested}], "actuators": actuators}) == [
        "wrist"
    ]


def test_rows_of_another_robot_are_refused(recorded: Path) -> None:
    from o80 import _core

    (run,) = runs_in(o80.open(recorded))
    name = _core.unused_segment_name("replay")
    replay = _core.DriverlessReplay(run.description, name, [], 1_000_000)
    with pytest.raises(o80.InvalidArgument, match="another size"):
        replay.run(b"short")
    block = next(run.blocks())
    with pytest.raises(o80.InvalidArgument, match="not consecutive"):
        replay.run(block.rows[1:3].tobytes())
    replay.close()
    o80.clean(name)


class Limp:
    """A relaxed arm: what it is told is interrupted at once, because nothing would move."""

    actuators = NAMES
    limits: ClassVar = {
        "shoulder": o80.Limits(minimum=-3.0, maximum=3.0, speed=2.0, acceleration=40.0),
        "elbow": o80.Limits(speed=2.0, error=0.3),
        "wrist": o80.Limits(minimum=-3.0, maximum=3.0, speed=2.0),
    }
    requests: ClassVar[dict[str, dict[str, type]]] = {"relax": {}}
    simulated = True

    def __init__(self) -> None:
        self.relaxed = False
        self.commanded: list[int] = []

    def write(self, desired: Desired) -> None:
        self.commanded = np.flatnonzero(desired.active).tolist()

    def read(self, reading: Reading) -> None:
        sinks = 0.001 * (reading.iteration % 50) if self.relaxed else 0.0
        reading.observed = [-sinks, sinks, 0.5 * sinks]
        if self.relaxed:
            reading.follow()
            for i in self.commanded:
                reading.interrupt(i)

    def on_relax(self, _: o80.Record) -> o80.StartAfresh:
        self.relaxed = True
        return o80.StartAfresh()


@pytest.mark.parametrize("kind", ["set-points", "commands", "trajectories", "chunks", "anything"])
def test_nothing_drifts_while_a_driver_follows_and_interrupts(kind: str, path: Path) -> None:
    choose = random.Random(kind)

    def send(arm: o80.Frontend, what: str) -> None:
        modes: list[Literal["queue", "overwrite"]] = ["queue", "overwrite"]
        mode = choose.choice(modes)
        names = choose.sample(NAMES, choose.randrange(1, 4))
        rows = np.linspace([0.0] * len(names), [choose.uniform(-2, 2)] * len(names), 60)
        if what == "set-points":
            arm.add_command(names, list(rows[30]), every=0.01, mode=mode)
        elif what == "commands":
            arm.add_command(names, list(rows[-1]), iterations=choose.randrange(1, 200), mode=mode)
        else:
            arm.add_trajectory(rows, actuators=names, iterations=2, mode=mode)
        arm.pulse()

    with o80.robots.load(Limp).inline(frequency=100.0) as arm, o80.Recording(path, arm):
        arm.burst(5)
        arm.request("relax")
        with arm.chunks(["elbow", "wrist"], step=2) as plan:
            for _ in range(200):
                what = kind
                if kind == "anything":
                    what = choose.choice(["", "set-points", "commands", "trajectories", "chunks"])
                if what == "chunks":
                    plan.send(np.linspace([0.0, 0.0], [2.0, 1.0], 60), seen=plan.wait())
                elif what:
                    send(arm, what)
                arm.burst(choose.randrange(1, 4) if kind == "anything" else 1)
        assert arm.halted is None
        rows = arm.history(since=6)  # the row of the fresh start
    before, last = rows.observed[:-2], rows.observed[1:-1]
    moved, active = np.abs(rows.desired[2:] - last), rows.active[2:]
    assert active.any()
    assert (moved[~active] == 0.0).all()
    # a command begins where its actuator was observed, or was desired because it followed
    assert (moved <= 0.02 + np.abs(last - before) + 1e-9).all(), "one iteration at the speed limit"
    for driver in (True, False):
        report = o80.replay(path, robot=f"{__file__}:Limp", driver=driver)
        assert report.identical, report
