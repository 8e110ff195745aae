"""Decisions of the backend, as a frontend reads them, also about commands of others."""

import contextlib

import numpy as np

import o80
from o80.frontend.reader import Journal
from o80.rows.journal import JournalEntry

WAIT = 30.0  # [s] longer than any wait should take


def of_kind(entries: list[JournalEntry], *kinds: str) -> list[JournalEntry]:
    return [entry for entry in entries if entry.kind in kinds]


def test_shows_who_sent_what_and_when_it_began_and_ended(arm: o80.Frontend) -> None:
    arm.add_command(1, 0.5, iterations=3, profile="linear")
    arm.pulse()
    arm.burst(5)
    entries = arm.journal()
    (taken,) = of_kind(entries, "taken")[:1]
    (command,) = taken.commands
    assert taken.sender.startswith("pid ")
    assert command.actuators == (arm.actuators[1].name,)
    assert (command.pace, command.amount, command.mode) == ("iterations", 3, "queue")
    begin, end = [entry for entry in entries if entry.kind == "status" and entry.id == command.id]
    assert (begin.status, end.status) == ("active", "completed")
    assert end.iteration == begin.iteration + 2
    assert begin.iteration == taken.iteration


def test_targets_have_the_fields_that_were_given(segment: str) -> None:
    joint = np.dtype([("position", "f8"), ("gains", "f8", (2,)), ("enabled", "?")])
    with o80.Backend(segment, ["a", "b"], joint) as backend:
        backend.publish()
        with o80.Frontend(segment) as frontend:
            frontend.add_command("a", {"position": 0.25})
            frontend.add_command("b", {"gains": [1.0, 2.0], "enabled": True})
            frontend.pulse()
            backend.step()
            first, second = of_kind(frontend.journal(), "taken")[0].commands
    assert first.targets == ({"position": 0.25},)
    (target,) = second.targets
    assert set(target) == {"gains", "enabled"}
    assert target["gains"].tolist() == [1.0, 2.0]
    assert target["enabled"] is True


def test_a_trajectory_has_all_its_rows(segment: str) -> None:
    with o80.Backend(segment, ["a", "b"]) as backend:
        backend.publish()
        with o80.Frontend(segment) as frontend:
            rows = np.linspace([0.0, 1.0], [1.0, 0.0], 20)
            frontend.add_trajectory(rows, iterations=2)
            frontend.pulse()
            backend.step()
            commands = of_kind(frontend.journal(), "taken")[0].commands
    targets = {
        name: target
        for command in commands
        for name, target in zip(command.actuators, command.targets, strict=True)
    }
    assert np.array_equal(np.stack([targets["a"], targets["b"]], axis=1), rows)


def test_goes_on_behind_the_entries_that_were_read(segment: str) -> None:
    with o80.Backend(segment, ["a"]) as backend:
        backend.publish()
        with o80.Frontend(segment) as frontend:
            journal = Journal(frontend)
            new = Journal(frontend, new=True)
            seen: list[int] = []
            for target in range(5):
                frontend.add_command("a", float(target))
                frontend.pulse()
                backend.step()
                backend.publish([0.0])
                entries = journal.read()
                assert [entry.missed for entry in entries] == [0] * len(entries)
                assert entries == new.read()
                assert entries == frontend.journal(since=seen[-1] + 1 if seen else None)
                seen += [entry.number for entry in entries]
            assert journal.read() == []
            assert len(of_kind(frontend.journal(), "taken")) == 5
            assert sorted(set(seen)) == seen


def test_a_halt_and_a_rejected_batch_say_why(segment: str) -> None:
    with o80.Backend(segment, ["a"]) as backend:
        backend.publish()
        with o80.Frontend(segment) as frontend:
            frontend.halt("the ball is on the floor")
            backend.step()
            backend.publish([0.0])
            frontend.add_command("a", 1.0)
            frontend.pulse()
            backend.step()
            halt, rejected = frontend.journal()
    assert (halt.kind, halt.halt, halt.cause) == ("halt", 1, "frontend")
    assert halt.text == "the ball is on the floor"
    assert (rejected.kind, rejected.reason) == ("rejected", "halted")
    assert rejected.commands[0].targets == (1.0,)


def test_of_a_backend_that_has_failed_the_journal_is_still_there(segment: str) -> None:
    with contextlib.suppress(ValueError), o80.Backend(segment, ["a"]) as backend:
        backend.publish()
        raise ValueError("it broke")
    with o80.Frontend(segment, dead=True) as late:
        assert late.journal()[-1].kind == "ended"
        assert "it broke" in late.journal()[-1].text


def test_a_batch_for_later_says_for_which_iteration(segment: str) -> None:
    with o80.Backend(segment, ["a"]) as backend:
        backend.publish()
        with o80.Frontend(segment) as frontend:
            frontend.add_command("a", 1.0)
            frontend.pulse(at=2)
            for _ in range(2):
                backend.step()
                backend.publish([0.0])
            scheduled, taken = of_kind(frontend.journal(), "scheduled", "taken")
    assert (scheduled.iteration, scheduled.at) == (1, 2)
    assert (taken.iteration, taken.at) == (2, None)


def test_a_request_comes_with_its_values(arm: o80.Frontend) -> None:
    arm.request("reset", seed=7)
    (taken,) = [
        entry
        for entry in of_kind(arm.journal(), "taken")
        if entry.commands and entry.commands[0].kind == "request"
    ]
    assert taken.commands[0].request == "reset"
    assert taken.commands[0].fields == {"seed": 7}


def test_there_is_nothing_after_the_newest_entry(arm: o80.Frontend) -> None:
    assert arm.journal(since=2**80) == []


def test_a_mark_is_noted_at_the_iteration_in_which_it_is_taken(arm: o80.Frontend) -> None:
    arm.burst(7)
    mark = arm.mark("the cup is full: \u00bd l")
    assert len(mark) == 1
    assert arm.latest().iteration == 7
    arm.burst(2)
    mark.wait(WAIT)
    (taken,) = [entry for entry in of_kind(arm.journal(), "taken") if entry.commands]
    (command,) = taken.commands
    assert (command.kind, command.text) == ("mark", "the cup is full: \u00bd l")
    assert mark[0].status == "completed"
    assert taken.iteration == mark[0].iteration == 8
