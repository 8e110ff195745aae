"""`o80 echo`: which values it shows, what it says beside them, and how it ends."""

import json
import os
from collections.abc import Iterator
from enum import IntEnum

import pytest
from manual_backend import ManualBackend
from processes import O80, WAIT, Running, run_o80

import o80


class Gear(IntEnum):
    """Values of an enumeration of a sensor."""

    NEUTRAL = 0
    FORWARD = 4


@pytest.fixture
def robot(segment: str) -> Iterator[ManualBackend]:
    """Two joints and a gear box, iterated by hand."""
    sensors = {"gear": Gear, "force": "f8"}
    with ManualBackend(segment, ["shoulder", "elbow"], extended=sensors) as made:
        made.backend.step()
        made.backend.publish([0.0, 0.5], {"gear": Gear.FORWARD, "force": 1.5})
        yield made


def echo(segment: str, *words: str, fails: bool = False) -> str:
    """Output of `o80 echo`; its errors if it should fail."""
    done = run_o80("echo", segment, *words, code=int(fails))
    return done.stderr if fails else done.stdout


def test_an_enumeration_is_shown_by_name(segment: str, robot: ManualBackend) -> None:
    assert "gear FORWARD force 1.5" in echo(segment, "--count", "1")
    row = json.loads(echo(segment, "--count", "1", "--json"))
    assert row["extended"] == {"gear": "FORWARD", "force": 1.5}


def test_the_actuators_that_commands_drive_are_named(segment: str, robot: ManualBackend) -> None:
    assert echo(segment, "--count", "1").rstrip().endswith("idle")
    robot.frontend.add_command("elbow", 1.0, iterations=1000)
    robot.frontend.pulse()
    robot.run()
    assert echo(segment, "--count", "1").rstrip().endswith("driven elbow")


def test_fields_are_chosen_by_path(segment: str, robot: ManualBackend) -> None:
    expected = {"observed": [0.0, 0.5], "extended.gear": "FORWARD", "active.elbow": False}
    chosen = json.loads(echo(segment, "--count", "1", "--json", "--fields", ",".join(expected)))
    del chosen["iteration"], chosen["time"]
    assert chosen == expected


def test_a_field_of_a_larger_state_has_the_path_that_other_commands_take(segment: str) -> None:
    state = {"position": float, "velocity": float}
    with o80.Backend(segment, ["shoulder", "elbow"], state, bursting=True) as backend:
        backend.publish([(0.0, 0.0), (0.5, 0.25)])
        printed = echo(segment, "--count", "1", "--json", "--fields", "observed.elbow.velocity")
    assert json.loads(printed)["observed.elbow.velocity"] == 0.25


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("obsrved", "a row has no number 'obsrved': it has desired.shoulder, desired.elbow"),
        ("observed.elbw", "no number 'observed.elbw'. Did you mean 'observed.elbow'?"),
        ("extended.geer", "no number 'extended.geer'. Did you mean 'extended.gear'?"),
        ("observed.elbow.x", "no number 'observed.elbow.x'. Did you mean 'observed.elbow'?"),
    ],
)
def test_a_field_that_is_not_there_is_answered_with_the_nearest(
    segment: str, robot: ManualBackend, path: str, said: str
) -> None:
    assert said in echo(segment, "--fields", path, fails=True)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        *((f"--rate={each}", f"a positive number, got {each}") for each in ("0", "nan", "inf")),
        ("--count=-1", "'--count'"),
        ("--timeout=nan", "must not be negative, got nan"),
    ],
)
def test_odd_numbers_are_refused(words: str, said: str) -> None:
    printed = run_o80("echo", "nobody", words, code=None).stderr
    assert said in " ".join(printed.replace("│", " ").split())


def test_a_missing_segment_is_said_at_once(segment: str) -> None:
    said = echo(segment, fails=True)
    assert "no segment has that name" in said
    assert "within the time given" not in said, "it waited"
    assert "--wait" in said


def test_it_waits_for_a_robot_if_told_so(segment: str) -> None:
    with Running(O80, "echo", segment, "--wait", "--count", "1", "--json") as waiting:
        assert "waiting; Ctrl-C ends it" in waiting.stderr.readline()
        with o80.Backend(segment, actuators=1) as backend:
            backend.publish([0.25])
            printed, _ = waiting.communicate(timeout=WAIT)
    assert json.loads(printed)["observed"] == [0.25]


def test_echo_says_that_a_backend_waits_for_a_burst(segment: str) -> None:
    with (
        o80.robots.load("two_joints").inline(segment) as frontend,
        Running(O80, "echo", segment, "--count", "2") as watching,
    ):
        said = watching.stderr.readline() + watching.stderr.readline()
        assert "at row 0, waits for a frontend to request iterations" in said
        frontend.burst(1)
        printed, _ = watching.communicate(timeout=WAIT)
    assert watching.returncode == 0
    assert len(printed.splitlines()) == 2


def test_commands_are_shown_with_their_sender_their_begin_and_their_end(
    segment: str, robot: ManualBackend
) -> None:
    frontend = robot.frontend
    frontend.add_command("elbow", 1.25, iterations=2)
    frontend.add_purge("shoulder")
    frontend.pulse()
    robot.run(3)
    frontend.halt("enough")
    robot.run()
    frontend.add_command("elbow", 2.0)
    frontend.pulse()
    robot.run()
    lines = echo(segment, "--commands", "--count", "6").splitlines()
    told = echo(segment, "--commands", "--count", "6", "--json").splitlines()
    entries = [json.loads(line) for line in told]
    sender = f"pid {os.getpid()}"
    assert sender in lines[0]
    assert "elbow to 1.25 in 2 iterations; purge shoulder" in lines[0]
    assert [line.split(maxsplit=1)[1] for line in lines[1:4]] == [
        "purge shoulder: completed",
        "elbow to 1.25 in 2 iterations: begins",
        "elbow to 1.25 in 2 iterations: completed",
    ]
    assert "HALT 1 (frontend by pid" in lines[4]
    assert "enough" in lines[4]
    assert "elbow to 2: rejected (halted)" in lines[5]
    assert [entry["kind"] for entry in entries] == [
        "taken",
        "status",
        "status",
        "status",
        "halt",
        "rejected",
    ]
    assert entries[0]["commands"][0]["targets"] == [1.25]


def test_commands_that_come_later_are_shown_when_they_come(
    segment: str, robot: ManualBackend
) -> None:
    with Running(O80, "echo", segment, "--commands", "--count", "1") as echoing:
        robot.frontend.add_command("elbow", -0.5, duration=0.5)
        robot.frontend.pulse()
        robot.run()
        out, _ = echoing.communicate(timeout=WAIT)
    assert "elbow to -0.5 in 0.5 s" in out


def test_without_commands_a_timeout_says_so(segment: str, robot: ManualBackend) -> None:
    said = echo(segment, "--commands", "--timeout", "0.2", fails=True)
    assert f"'{segment}' decided nothing for 0.2 s" in said
