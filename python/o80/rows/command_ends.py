"""When commands ended, and how, by actuator: in the journal of a backend, and in NotCompleted."""

from collections.abc import Iterable
from typing import NamedTuple

from o80.base.words import Reason, Status
from o80.rows.journal import JournalEntry

ENDS = frozenset(
    {
        Status.COMPLETED,
        Status.LIMITED,
        Status.OVERWRITTEN,
        Status.PURGED,
        Status.INTERRUPTED,
        Status.REJECTED,
        Status.HALTED,
    }
)


class CommandEnd(NamedTuple):
    """The end of a command; of a request if it has no actuators."""

    iteration: int
    status: Status
    actuators: tuple[str, ...]
    reason: Reason = Reason.NONE
    text: str = ""  #: the reason in words; a journal does not have it


def command_ends(entries: Iterable[JournalEntry]) -> list[CommandEnd]:
    """The ends of all commands whose batch is among the entries, in their order."""
    actuators: dict[tuple[int | None, int], tuple[str, ...]] = {}
    ends = []
    for entry in entries:
        commands = [each for each in entry.commands if each.kind == "command"]
        if entry.kind == "rejected":
            ends += [
                CommandEnd(
                    entry.iteration, Status.REJECTED, each.actuators, entry.reason or Reason.NONE
                )
                for each in commands
            ]
            continue
        actuators.update({(entry.lane, each.id): each.actuators for each in commands})
        if entry.kind == "status" and entry.status in ENDS and entry.id is not None:
            named = actuators.pop((entry.lane, entry.id), None)
            if named is not None:
                reason = entry.reason or Reason.NONE
                ends.append(CommandEnd(entry.iteration, entry.status, named, reason))
    return ends
