"""A replay repeats every row of a run bit for bit, and finds the first one that differs."""

import random
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flipped import Flipped
from hypothesis import given, settings
from hypothesis import strategies as st
from mixed_robots import recorded
from processes import run_o80

import o80
from o80.base.machine import this_machine
from o80.difference import Difference, first_difference
from o80.recording.recorder import Recorder
from o80.replaying.recorded_run import FileRun, RecordedRun, runs_in
from o80.replaying.replay import RunReplay
from o80.rows.columns import columns_of

NAMES = ("shoulder", "elbow")


class Commander:
    """Sends what random programs send."""

    def __init__(self, arm: o80.Frontend, seed: int) -> None:
        self.arm, self.random = arm, random.Random(seed)
        self.eyes = random.Random(seed + 1)

    def act(self) -> None:
        for _ in range(self.random.randrange(3)):
            self.command()
        if self.random.random() < 0.05:
            self.arm.add_request(*self.random.choice([("snapshot",), ("home",)]))
        if self.random.random() < 0.05:
            self.arm.add_purge(self.random.choice(["elbow", "shoulder"]))
        later = self.random.random() < 0.1
        self.arm.pulse(
            at=self.arm.published + self.random.randrange(8) if later else None,
            seen=self.arm.latest() if self.eyes.random() < 0.3 else None,
        )
        if self.random.random() < 0.05:
            self.arm.add_request(self.random.choice(["reset", "restore"]))
            self.arm.pulse()

    def command(self) -> None:
        choose = self.random
        how: dict[str, Any] = {
            "iterations": choose.randrange(1, 40),
            "mode": choose.choice(["queue", "overwrite"]),
            "start": choose.choice(["desired", "observed"]),
        }
        if choose.random() < 0.2:
            self.chunk()
        elif choose.random() < 0.3:
            self.arm.add_command(None, [self.target(), self.target()], **how)
        else:
            self.arm.add_command(choose.choice(["elbow", "shoulder"]), self.target(), **how)

    def chunk(self) -> None:
        choose, count = self.random, self.random.randrange(1, 12)
        plan = self.arm.chunks(step=choose.choice([1, 5, 50 / 3]), ease=choose.choice([1, 9]))
        plan.send(
            [[self.target(), self.target()] for _ in range(count)],
            seen=max(0, self.arm.published - choose.randrange(40)),
            first=choose.randrange(count),
            fixed=choose.random() < 0.5,
        )

    def target(self) -> float:
        return self.random.uniform(-2, 2)


def run_bursts(arm: o80.Frontend, seed: int, bursts: int = 150) -> None:
    commander = Commander(arm, seed)
    for _ in range(bursts):
        commander.act()
        arm.burst(commander.random.randrange(1, 20))
        if commander.random.random() < 0.04:
            arm.halt("now and then")
            arm.burst(3)
            arm.resume()


@pytest.mark.parametrize("seed", range(3))
def test_a_run_of_bursts_is_identical(arm: o80.Frontend, seed: int) -> None:
    run_bursts(arm, seed)
    report = o80.replay(arm)

    assert report.identical, report
    (run,) = report
    assert run.rows == arm.published + 1
    kinds = {entry.kind for entry in arm.journal()}
    assert kinds >= {"taken", "scheduled", "fresh_start", "halt", "resume"}


def test_the_first_difference_of_another_option_is_told(segment: str) -> None:
    with o80.robots.load("two_joints").inline(segment, gain=7.5) as arm:
        arm.burst(5)
        arm.add_command("elbow", 0.5)
        arm.burst(5)
        assert o80.replay(arm).identical  # with the options of the run
        found = o80.replay(arm, options={"gain": 7.6}).difference

        assert found is not None
        assert (found.iteration, found.field) == (6, "observed.elbow")
        assert found.values[0] == arm.wait_for(6).observed[1]
        near = {"observed": 0.1, "extended": 0.1}
        assert o80.replay(arm, options={"gain": 7.6}, tolerances=near).identical


def test_a_history_without_row_0_is_not_replayed(segment: str) -> None:
    with o80.robots.load("two_joints").inline(segment, history=20) as arm:
        arm.burst(50)
        report = o80.replay(arm)
        run_o80("replay", segment, code=2)
    assert not report.identical
    assert report.difference is None
    assert "the first recorded row is row 31: a replay begins at row 0" in str(report)
    assert "without --from-now, or with --snapshots 60" in str(report)


@pytest.mark.parametrize("seed", range(2))
def test_a_history_without_row_0_begins_at_a_reset_or_a_snapshot(segment: str, seed: int) -> None:
    with o80.robots.load("two_joints").inline(segment, history=600) as arm:
        arm.request("snapshot", slot=0)
        arm.request("snapshot", slot=2)
        arm.burst(700)
        run_bursts(arm, seed, 20)
        requests: dict[str, dict[str, Any]] = {
            "reset": {},
            "restore": {"slot": 2},
            "snapshot": {"slot": 1},
        }
        for request, fields in requests.items():
            arm.request(request, **fields)
            run_bursts(arm, seed + 10, 10)
        arm.request("restore", slot=1)
        run_bursts(arm, seed + 20, 10)

        (run,) = o80.replay(arm)
        assert (run.difference, run.gap) == (None, "")
        assert run.missing == (f"rows before {run.first} were not compared",)
        assert any("the replay begins with the" in note for note in run.notes)
        fresh = arm.history().iteration[arm.history().rows["fresh"] != 0]
        began = set()
        for row in fresh:
            (run,) = o80.replay(arm, since=int(row))
            assert run.difference is None, (row, run)
            began |= {note.rpartition(" ")[2] for note in run.notes if "begins with" in note}
        assert len(began) > 1


def flood(arm: o80.Frontend) -> None:
    """More than half a mebibyte of commands."""
    for _ in range(100):
        arm.add_trajectory(np.full((1000, 1), 0.1), ["elbow"])
        arm.pulse()
        arm.add_purge("elbow")
        arm.burst(2)
    arm.burst(100)


def test_a_restore_whose_snapshot_is_not_recorded_ends_the_replay(segment: str) -> None:
    with o80.robots.load("two_joints").inline(segment, history=60, journal=0.5) as arm:
        arm.request("snapshot", slot=2)
        flood(arm)
        arm.request("reset")
        arm.burst(5)
        arm.request("restore", slot=2)
        arm.burst(5)
        (run,) = o80.replay(arm)
    assert (run.difference, run.rows) == (None, 6)
    assert "the snapshot in slot 2, which row" in str(run)


def test_a_replay_ends_at_a_gap_of_the_journal(segment: str) -> None:
    with o80.robots.load("two_joints").inline(segment, journal=0.5) as arm:
        flood(arm)
        report = o80.replay(arm)
    assert not report.identical
    assert report.difference is None
    assert "the journal lacks entries 0 to" in str(report)


def file_of(path: Path, arm: o80.Frontend) -> Path:
    """A recording of a random run."""
    with o80.Recording(path, arm) as recording:
        for part in range(5):
            run_bursts(arm, 3 + part, 40)
            recording.flush()
    return path


def test_each_run_of_each_segment_is_replayed(segment: str, path: Path) -> None:
    with o80.Recording(path, [segment, f"{segment}-b"]) as recording:
        for number, gain in enumerate((5.0, 9.0)):
            load = o80.robots.load("two_joints")
            with load.inline(segment, gain=gain) as a, load.inline(f"{segment}-b") as b:
                for arm in (a, b):
                    arm.add_command("elbow", 0.5, iterations=20)
                    arm.burst(30)
                while recording.rows < (number + 1) * 2 * 31:  # until it has attached to both
                    recording.flush()
    o80.clean(f"{segment}-b")
    report = o80.replay(path)

    assert report.identical, report
    names = [run.name for run in report]
    both = [segment, f"{segment}-b"]
    both.sort(key=names.index)  # the recorder may find either first
    assert names == [run for name in both for run in (name, f"{name}/1")]
    assert [run.rows for run in report] == [31] * 4


@pytest.fixture(scope="module")
def run_in_file(tmp_path_factory: pytest.TempPathFactory) -> RecordedRun:
    """A random run of two joints in a file."""
    with o80.robots.load("two_joints").inline() as arm:
        path = file_of(tmp_path_factory.mktemp("run") / "run.mcap", arm)
    return runs_in(o80.open(path))[0]


@given(data=st.data())
@settings(max_examples=15)
def test_a_flipped_bit_is_found_in_its_row_and_field(
    run_in_file: FileRun, data: st.DataObject
) -> None:
    run = run_in_file
    row = data.draw(st.integers(0, run.rows - 1))
    part, actuator = data.draw(st.sampled_from([("desired", 0), ("observed", 1), ("extended", 1)]))
    name = f"extended.effort[{actuator}]" if part == "extended" else f"{part}.{NAMES[actuator]}"
    (place,) = [column.offset for column in columns_of(run.schema) if column.name == name]
    byte = place + data.draw(st.integers(0, 7))
    flipped = Flipped(run, row, byte, 1 << data.draw(st.integers(0, 7)))
    report = RunReplay(flipped).report()  # type: ignore[arg-type]

    assert report.difference is not None
    assert (report.difference.iteration, report.difference.field) == (row, name)


@dataclass(frozen=True)
class FromElsewhere(Flipped):
    """A run with one flipped bit that another build of o80, or another machine, recorded."""

    provenance: Any = None
    machine: Any = None


def test_what_another_build_recorded_is_compared_with_a_tolerance(run_in_file: FileRun) -> None:
    other = replace(run_in_file.provenance, source_hash="0" * 64)
    place = run_in_file.schema["row"]["observed"]
    row = run_in_file.rows - 2
    run = FromElsewhere(run_in_file, row, place, 1, provenance=other)

    report = RunReplay(run).report()  # type: ignore[arg-type]
    assert report.identical, report
    assert any("another build of o80" in note and "1e-09" in note for note in report.notes)
    report = RunReplay(run, tolerances={}).report()  # type: ignore[arg-type]
    assert report.difference is not None
    assert report.difference.iteration == row


def test_another_machine_is_noted(run_in_file: FileRun) -> None:
    machine = run_in_file.machine
    assert machine == this_machine()
    older = replace(machine, libc="glibc 2.1")
    assert "glibc 2.1 recorded it" in older.difference(machine)
    lesser = replace(machine, features=machine.features[1:])
    assert "the processors differ" in lesser.difference(machine)
    run = FromElsewhere(run_in_file, 0, 0, 0, provenance=run_in_file.provenance, machine=older)
    report = RunReplay(run).report()  # type: ignore[arg-type]
    assert report.identical, report
    assert any("glibc 2.1 recorded it" in note for note in report.notes)


def test_the_command_says_whether_a_recording_repeats(arm: o80.Frontend, path: Path) -> None:
    file_of(path, arm)
    done = run_o80("replay", path)
    assert done.stderr == ""
    assert f"{arm.segment}: {arm.published + 1} rows, identical" in done.stdout
    assert "observed." in run_o80("replay", path, "--set", "gain=21", code=1).stdout
    for words, said in (
        (("--set", "gain"), "NAME=VALUE"),
        (("--set", "gian=2"), "'gian'"),
        (("--robot", "./nowhere.so"), "nowhere.so"),
    ):
        assert said in run_o80("replay", path, *words, code=2).stderr


@pytest.mark.filterwarnings("ignore:no snapshot is recorded:RuntimeWarning")  # it often moves
@pytest.mark.parametrize("seed", range(2))
def test_a_recording_whose_beginning_is_missing_is_replayed_from_a_snapshot(
    segment: str, seed: int, tmp_path: Path
) -> None:
    paths, rows = [tmp_path / "with.mcap", tmp_path / "without.mcap"], []
    for path in paths:
        choose = random.Random(seed)
        snapshots = 1e-6 if path is paths[0] else None
        with o80.robots.load("two_joints").inline(segment) as arm:
            arm.add_command("elbow", 0.3, iterations=50)
            arm.burst(80)
            recorder = Recorder(
                path, [segment], from_now=True, split="8k", keep="300k", snapshots=snapshots
            )
            for _ in range(60):
                for _ in range(choose.randrange(3)):
                    iterations = choose.randrange(1, 40)
                    arm.add_command(choose.choice(NAMES), choose.random(), iterations=iterations)
                arm.burst(choose.randrange(1, 60))
                recorder.poll()
            recorder.finish()
            rows.append(arm.history())
    (run,) = o80.replay(paths[0])
    assert (run.difference, run.gap) == (None, ""), run
    assert run.rows > 100
    assert any("begins with the snapshot of row" in note for note in run.notes)
    assert not (paths[0] / "0000.mcap").exists()
    assert not o80.replay(paths[1]).identical
    for column in ("desired", "observed", "active"):  # snapshots disturb nothing
        assert np.array_equal(getattr(rows[0], column), getattr(rows[1], column))


# ----------------------------------------------------------------------------- two runs, row by row


def run_of(target: float, segment: str) -> o80.History:
    with o80.robots.load("two_joints").inline(segment) as arm:
        arm.add_command("elbow", target, iterations=20)
        arm.burst(30)
        return arm.history()


def changed(history: o80.History, row: int, byte: int) -> o80.History:
    """The same with one bit of a row flipped."""
    raw = bytearray(history.rows.tobytes())
    raw[row * history.rows.itemsize + byte] ^= 1
    return o80.History(history._decoder, np.frombuffer(bytes(raw), history.rows.dtype))


def test_a_field_of_the_clock_is_left_out(segment: str) -> None:
    """The description is the only thing that says so: see docs/drivers/simulators.md."""
    history = run_of(0.5, segment)
    other = changed(history, 3, history.schema["row"]["extended"])
    assert first_difference(history, other) is not None
    history.schema["extended"]["fields"][0]["origin"] = "clock"
    assert first_difference(history, other) is None


def test_not_a_number_equals_itself(segment: str) -> None:
    with o80.Backend(segment, {"sensor": float}, bursting=True) as backend:
        backend.publish({"sensor": 1.0})
        with o80.Frontend(segment) as frontend:
            frontend.burst(1, wait=False)
            backend.step()
            backend.publish({"sensor": float("nan")})
            history = frontend.history()

    assert first_difference(history, history) is None
    assert first_difference(history, history, tolerances={"observed": 0.1}) is None


def test_rows_that_one_lacks_are_a_difference(segment: str) -> None:
    history = run_of(0.5, segment)

    assert first_difference(history, history[:20]) == Difference(20, "", (True, False))
    assert first_difference(history[5:], history) == Difference(0, "", (False, True))


def test_columns_are_ignored_and_tolerated(segment: str) -> None:
    one, other = run_of(0.5, segment), run_of(0.5 + 1e-9, segment)

    assert first_difference(one, other) is not None
    parts = {"desired": 1e-8, "observed": 1e-8, "extended": 1e-8}
    assert first_difference(one, other, tolerances=parts) is None
    assert first_difference(one, other, ignore=list(parts)) is None
    found = first_difference(one, other, ignore=["desired", "observed"])
    assert found is not None
    assert str(found).startswith("iteration 1, extended.effort[1]: ")
    with pytest.raises(o80.InvalidArgument, match=r"no column 'desird'.*desired"):
        first_difference(one, other, ignore=["desird"])


def test_different_robots_are_refused(segment: str) -> None:
    with pytest.raises(o80.InvalidArgument, match="the robots differ"):
        first_difference(run_of(0.5, segment), recorded({"hand": "f8"}, None, 1))


def test_a_column_that_one_robot_lacks_may_be_ignored() -> None:
    one = recorded({"hand": "f8"}, {"force": "f8"}, 1)[:1]
    other = recorded({"hand": "f8"}, {"force": "f8", "warm": "?"}, 1)[:1]
    for pair in ((one, other), (other, one)):
        assert first_difference(*pair, ignore=["extended.warm"]) is None
        with pytest.raises(o80.InvalidArgument, match=r"extended\.warm is in one of them"):
            first_difference(*pair, ignore=["extended.force"])


def test_the_command_tells_by_its_exit_code(segment: str, tmp_path: Path) -> None:
    paths = []
    for i, target in enumerate((0.5, 0.5, 0.6)):
        paths.append(tmp_path / f"{i}.mcap")
        with o80.robots.load("two_joints").inline(segment) as arm, o80.Recording(paths[-1], arm):
            arm.add_command("elbow", target, iterations=20)
            arm.burst(25)
    for other, code, said in ((paths[1], 0, "identical"), (paths[2], 1, "desired.elbow")):
        assert said in run_o80("diff", paths[0], other, code=code).stdout
