"""A robot of the world is replayed without its driver: its desired states repeat bit for bit."""

import os
import random
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_replay import Flipped, o80_replay

import o80
from o80.replaying.recorded_run import runs_in
from o80.replaying.replay import replay_runs

WAIT = 30.0  # [s] longer than any wait should take
JOINT = {"position": float, "velocity": float}
NAMES = ("shoulder", "elbow", "wrist")


class World:
    """A program with an embedded backend, whose robot does what nobody can predict."""

    def __init__(self, segment: str, seed: int) -> None:
        self.random = random.Random(seed)
        limit = o80.Limits(minimum=-3.0, maximum=3.0, speed=400.0, acceleration=50000.0)
        self.backend = o80.Backend(
            segment,
            NAMES,
            JOINT,
            extended={"force": float},
            requests={"home": None, "jump": None, "look": None, "wait": None},
            limits={"shoulder": {"position": limit}, "elbow": {"position": o80.Limits(error=2.5)}},
            rests_at={name: {"velocity": 0.0} for name in NAMES},
            when_idle={"wrist": "follow"},
            history=200_000,
            journal=64,
            stale="purge",
        )
        self.place = np.zeros((3, 2))
        self.backend.on("home", lambda _: o80.Running("on the way"))
        self.backend.on("jump", self.jump)
        self.backend.on("look", self.look)
        self.backend.on("wait", lambda _: None)

    def jump(self, _: Any) -> o80.StartAfresh:
        self.place[:, 0] = [self.random.uniform(-1, 1) for _ in NAMES]
        desired = None
        if self.random.random() < 0.3:  # it knows better than its sensors
            desired = self.states(self.place + 0.125)
        return o80.StartAfresh(self.states(self.place), desired=desired)

    def look(self, _: Any) -> None:
        if self.random.random() < 0.5:
            raise o80.RequestRejected("it is dark")

    def states(self, numbers: Any) -> Any:
        states = np.zeros(3, [("position", float), ("velocity", float)])
        states["position"], states["velocity"] = numbers[:, 0], numbers[:, 1]
        return states

    def publish(self) -> None:
        force = {"force": self.random.gauss(0, 1)}
        self.backend.publish(self.states(self.place), force)

    def run(self) -> None:
        self.publish()
        chance = self.random.random
        while (desired := self.backend.step()) is not None:
            noise = [[self.random.gauss(0, 0.01), self.random.gauss(0, 1)] for _ in NAMES]
            self.place[:, 0] += 0.5 * (np.asarray(desired["position"]) - self.place[:, 0])
            self.place += noise
            if chance() < 0.002:
                self.backend.interrupt(self.random.choice(NAMES))
            if chance() < 0.001:
                self.backend.halt(f"slipped {self.random.randrange(3)}")
            if chance() < 0.001:
                self.place[1, 0] += 3.0  # a collision: beyond the error limit
            if self.backend.running("home") and chance() < 0.05:
                fresh = o80.StartAfresh(self.states(self.place)) if chance() < 0.5 else None
                self.backend.end_request("home", fresh)
            self.publish()
            if chance() < 0.002:
                self.backend.interrupt(self.random.choice(NAMES))  # before the next step

    @contextmanager
    def running(self) -> Iterator[None]:
        thread = threading.Thread(target=self.run)
        thread.start()
        try:
            yield
        finally:
            self.backend.stop()
            thread.join()


def act(arm: o80.Frontend, choose: random.Random) -> None:
    """Sends what random programs send."""
    for _ in range(choose.randrange(3)):
        actuators = choose.choice([["shoulder"], ["elbow"], ["wrist"], ["shoulder", "elbow"]])
        arm.add_command(
            actuators if len(actuators) > 1 else actuators[0],
            [{"position": choose.uniform(-1.5, 1.5)} for _ in actuators]
            if len(actuators) > 1
            else {"position": choose.uniform(-1.5, 1.5)},
            iterations=choose.randrange(2, 60),
            mode=choose.choice(["queue", "overwrite"]),
            start=choose.choice(["desired", "observed"]),
            profile=choose.choice(["linear", "minimum_jerk"]),
        )
    if choose.random() < 0.3:
        for request in choose.sample(["home", "jump", "look", "wait"], choose.randrange(1, 3)):
            arm.add_request(request)
    if choose.random() < 0.1:
        arm.add_purge(choose.choice(NAMES))
    later = choose.random() < 0.2
    arm.pulse(at=arm.published + choose.randrange(30) if later else None)


def drive(arm: o80.Frontend, seed: int, actions: int = 100) -> None:
    choose = random.Random(seed)
    for _ in range(actions):
        if arm.halted:
            with suppress(o80.BackendHalted):  # another halt came meanwhile
                arm.resume(timeout=WAIT)
        act(arm, choose)
        if choose.random() < 0.03:
            arm.halt("now and then")
        arm.wait_for(arm.published + choose.randrange(1, 30), timeout=WAIT)


def test_an_actuator_that_left_a_command_because_of_its_reading_leaves_it_again(
    segment: str, tmp_path: Path
) -> None:
    path = tmp_path / "run.mcap"
    limits = {"follower": o80.Limits(speed=2.0, noise=0.03)}
    with o80.Backend(
        segment, ["follower", "other"], limits=limits, when_idle={"follower": "follow"}
    ) as backend:

        def run(iterations: int, place: float = 0.0) -> None:
            for _ in range(iterations):
                assert backend.step() is not None
                backend.publish([place, 0.0])

        backend.publish([0.0, 0.0])
        with o80.Frontend(segment) as arm, o80.Recording(path, arm):
            run(3)
            arm.add_command("other", 1.0, iterations=10)
            arm.add_command(["follower", "other"], [0.004, 2.0], iterations=5)
            batch = arm.pulse()
            run(9)
            run(1, 1e6)
            run(10)
            assert batch.statuses == [o80.Status.COMPLETED, o80.Status.INTERRUPTED]
            assert "'follower' was read at 1e+06" in batch[1].text
            assert arm.latest().desired.tolist() == [0.0, 2.0]
    report = o80.replay(path)
    assert report.identical, report


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


@pytest.mark.parametrize("seed", range(3))
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
    segment: str, tmp_path: Path
) -> None:
    """It moved before, and its first rows were overwritten."""
    path = tmp_path / "run.mcap"
    with o80.robots.load("two_joints").inline(segment, history=64) as arm:
        arm.add_command("elbow", 0.5, iterations=20)
        arm.burst(300)
        with o80.Recording(path, arm):
            arm.add_command("elbow", 0.1, iterations=20)
            arm.burst(30)
    (recorded,) = runs_in(o80.open(path))
    assert next(recorded.blocks()).iteration[0] > 200
    (run,) = o80.replay(path, driver=False)
    assert run.identical, run
    assert run.rows > 60
    done = o80_replay(str(path))
    assert "--without-driver" in done.stdout, done.stdout


def test_the_journal_says_that_nothing_acts_however_much_is_written(
    segment: str, tmp_path: Path
) -> None:
    """Bursts without commands fill its ring more than once."""
    path = tmp_path / "run.mcap"
    with o80.robots.load("two_joints").inline(segment, history=64, journal=0.5) as arm:
        arm.add_command("elbow", 0.5, iterations=20)
        arm.burst(100)
        first = arm.journal()[0].number
        while arm.journal()[0].number < first + 30_000:
            for _ in range(1000):
                arm.burst(1)
        with o80.Recording(path, arm):
            arm.add_command("elbow", 0.1, iterations=20)
            arm.burst(30)
    (run,) = o80.replay(path, driver=False)
    assert run.identical, run
    assert run.rows > 60


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a robot of the world."""
    path = tmp_path_factory.mktemp("run") / "run.mcap"
    segment = f"test-{os.getpid()}-world"
    world = World(segment, 3)
    with (
        world.backend,
        world.running(),
        o80.Frontend(segment) as arm,
        o80.Recording(path, arm),
    ):
        drive(arm, 3)
    o80.clean(segment)
    return path


@pytest.mark.parametrize("seed", range(2))
def test_desired_states_of_a_robot_of_the_world_repeat(segment: str, seed: int) -> None:
    world = World(segment, seed)
    with world.backend:
        with world.running(), o80.Frontend(segment) as arm:
            drive(arm, seed)
            kinds = {(entry.kind, entry.cause) for entry in arm.journal()}
        with o80.Frontend(segment, read_only=True, dead=True) as arm:
            (run,) = o80.replay(arm)
    assert run.identical, run
    assert run.rows > 200
    assert {kind for kind, _ in kinds} >= {"taken", "fresh_start", "halt", "interrupted", "resume"}
    (note,) = (note for note in run.notes if "compared" in note)
    assert "compared: desired states" in note
    assert "not repeated: readings of the world" in note


def test_a_changed_desired_state_is_found_at_its_row_and_field(recorded: Path) -> None:
    (run,) = runs_in(o80.open(recorded))
    fresh = np.concatenate([block.rows["fresh"] for block in run.blocks()])
    choose = random.Random(1)
    size = 16  # of a state [bytes]
    for _ in range(6):
        row = choose.choice(np.flatnonzero(fresh == 0).tolist())
        actuator = choose.randrange(2)
        byte = run.schema["row"]["desired"] + size * actuator + choose.randrange(8)
        flipped = Flipped(run, row, byte, 1 << choose.randrange(8))
        (report,) = replay_runs([flipped])
        assert report.difference is not None
        found = (report.difference.iteration, report.difference.field)
        assert found == (row, f"desired.{NAMES[actuator]}.position")


def test_a_changed_decision_is_found(recorded: Path) -> None:
    """A recording whose rows show motion that its journal does not explain."""
    (run,) = runs_in(o80.open(recorded))

    class Silent(Flipped):
        def entries(self) -> Iterator[Any]:
            return (entry for entry in self.run.entries() if entry.kind == "status")

    (report,) = replay_runs([Silent(run, 0, 0, 0)])
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
    done = o80_replay(str(recorded))
    assert (done.returncode, done.stderr) == (0, "")
    assert "compared: desired states" in done.stdout
    assert "does not serve the requests of a simulation" in done.stdout


def test_any_recording_can_be_replayed_without_its_robot(segment: str, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with o80.robots.load("two_joints").inline(segment) as arm, o80.Recording(path, arm):
        arm.add_command("elbow", 0.5, iterations=20)
        arm.burst(30)
        arm.request("reset", seed=3)
        arm.add_command("elbow", 0.5, iterations=20)
        arm.burst(30)
    done = o80_replay(str(path), "--without-driver")
    assert (done.returncode, done.stderr) == (0, "")
    assert "it was asked for" in done.stdout


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
