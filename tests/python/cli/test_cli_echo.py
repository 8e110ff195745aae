"""`o80 echo`: which values it shows, what it says beside them, and how it ends."""

import json
import os
import sys
from collections.abc import Iterator
from enum import IntEnum

import pytest
from processes import O80, WAIT, Running, run_o80

import o80
from o80.cli.segment_table import print_segments


class Gear(IntEnum):
    """Values of an enumeration of a sensor."""

    NEUTRAL = 0
    FORWARD = 4


@pytest.fixture
def backend(segment: str) -> Iterator[o80.Backend]:
    """Two joints and a gear box, iterated by hand."""
    with o80.Backend(
        segment,
        actuators=["shoulder", "elbow"],
        extended={"gear": Gear, "force": "f8"},
        bursting=False,
    ) as made:
        made.publish([0.0, 0.5], {"gear": Gear.FORWARD, "force": 1.5})
        yield made


def echo(segment: str, *words: str, fails: bool = False) -> str:
    """Output of `o80 echo`; its errors if it should fail."""
    done = run_o80("echo", segment, *words, code=int(fails))
    return done.stderr if fails else done.stdout


def test_an_enumeration_is_shown_by_name(segment: str, backend: o80.Backend) -> None:
    assert "gear FORWARD force 1.5" in echo(segment, "--count", "1")
    row = json.loads(echo(segment, "--count", "1", "--json"))
    assert row["extended"] == {"gear": "FORWARD", "force": 1.5}


def test_the_actuators_that_commands_drive_are_named(segment: str, backend: o80.Backend) -> None:
    assert echo(segment, "--count", "1").rstrip().endswith("idle")
    with o80.Frontend(segment) as frontend:
        frontend.add_command("elbow", 1.0, iterations=1000)
        frontend.pulse()
        assert backend.step() is not None
        backend.publish([0.0, 0.5], {"gear": Gear.NEUTRAL, "force": 0.0})

        assert echo(segment, "--count", "1").rstrip().endswith("driven elbow")


def test_fields_are_chosen_by_path(segment: str, backend: o80.Backend) -> None:
    expected = {"desired": [0.0, 0.5], "extended.gear": "FORWARD", "active.elbow": False}
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
    segment: str, backend: o80.Backend, path: str, said: str
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


def test_a_table_fits_a_terminal_of_80_columns(
    segment: str,
    backend: o80.Backend,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for name, value in {"COLUMNS": "80", "NO_COLOR": "1"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    print_segments(as_json=False)
    printed = capsys.readouterr().out
    table = [line for line in printed.splitlines() if not line.startswith(segment + ":")]
    assert segment in printed
    assert "rate" in table[0]
    assert max(map(len, table)) <= 80


def test_commands_are_shown_with_their_sender_their_begin_and_their_end(
    segment: str, backend: o80.Backend
) -> None:
    with o80.Frontend(segment) as frontend:
        frontend.add_command("elbow", 1.25, iterations=2)
        frontend.add_purge("shoulder")
        frontend.pulse()
        for _ in range(3):
            backend.step()
            backend.publish([0.0, 0.5], {"gear": Gear.NEUTRAL, "force": 0.0})
        frontend.halt("enough")
        backend.step()
        backend.publish([0.0, 0.5], {"gear": Gear.NEUTRAL, "force": 0.0})
        frontend.add_command("elbow", 2.0)
        frontend.pulse()
        backend.step()
        lines = echo(segment, "--commands", "--count", "6").splitlines()
        entries = [
            json.loads(line)
            for line in echo(segment, "--commands", "--count", "6", "--json").splitlines()
        ]
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
    segment: str, backend: o80.Backend
) -> None:
    with (
        Running(O80, "echo", segment, "--commands", "--count", "1") as echoing,
        o80.Frontend(segment) as frontend,
    ):
        frontend.add_command("elbow", -0.5, duration=0.5)
        frontend.pulse()
        backend.step()
        out, _ = echoing.communicate(timeout=WAIT)
    assert "elbow to -0.5 in 0.5 s" in out


def test_without_commands_a_timeout_says_so(segment: str, backend: o80.Backend) -> None:
    said = echo(segment, "--commands", "--timeout", "0.2", fails=True)
    assert f"'{segment}' decided nothing for 0.2 s" in said
