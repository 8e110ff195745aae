"""Describes decisions of a backend in words."""

from collections.abc import Callable
from typing import Any

import numpy as np

from o80.base.finite import json_text
from o80.rows.journal import JournalCommand, JournalEntry

_MAX_NUMBERS = 8  # of a target


class JournalText:
    """Describes entries in words; keeps commands that have not ended, to name them at their end."""

    def __init__(self, style: Callable[[str, str], str] = lambda text, _: text) -> None:
        """style: formats a text, as `o80.base.screen.style`."""
        self._style = style
        self._open: dict[tuple[int | None, int], str] = {}

    def text(self, entry: JournalEntry) -> str:
        """Describes one decision in words."""
        if entry.kind in ("taken", "scheduled", "rejected"):
            return self._batch(entry)
        if entry.kind == "status":
            return self._status(entry)
        if entry.kind == "chunk_begun":
            what = self._open.get((entry.lane, entry.id or 0), f"chunk {entry.id}")
            later = f", {entry.shift} iterations later" if entry.shift else ""
            return f"  {what}: plays from row {entry.row}{later}"
        if entry.kind == "none":
            return f"something of a newer o80 ({entry.unknown})"
        who = f"{_sender(entry)}: "
        if entry.kind in ("halt", "halt_reason"):
            by = f" by {entry.sender}" if entry.sender else ""
            word = "HALT" if entry.kind == "halt" else "reason of halt"
            return (
                self._style(f"{word} {entry.halt}", "yellow")
                + f" ({entry.cause}{by}): {entry.text}"
            )
        if entry.kind == "resume":
            return f"{who}resumed halt {entry.halt}"
        if entry.kind == "burst":
            until = (
                "until its batch has ended" if entry.burst == -1 else f"{entry.burst} iterations"
            )
            return f"{who}burst, {until}"
        if entry.kind == "burst_ended":
            return f"{who}burst ended{' early' if entry.cut else ''}"
        if entry.kind == "interrupted":
            return f"the robot interrupted {entry.actuator}"
        if entry.kind == "snapshot":
            return f"the robot keeps its state in slot {entry.slot}"
        if entry.kind == "ended":
            return "the backend ended" + (f": {entry.text}" if entry.text else "")
        if entry.kind == "fresh_start":
            return "fresh start" + (": idle actuators follow" if entry.follows else "")
        said = {
            "control_taken": f"{who}took control",
            "control_released": f"{who}released control",
            "control_lost": f"{who}lost control",
            "died": f"{who}died",
            "silent": f"{who}gave no sign of life",
            "order_lost": "the ticket counter is damaged",
            "stopping": "stopping: all commands are dropped",
        }
        return said.get(entry.kind, entry.kind)

    def _batch(self, entry: JournalEntry) -> str:
        texts = []
        for command in entry.commands:
            texts.append(command_text(command))
            if entry.kind != "rejected":
                self._open[entry.lane, command.id] = texts[-1]
        what = "; ".join(texts) or ("commands were overwritten" if entry.commands_lost else "burst")
        what += _seen(entry)
        if entry.kind == "rejected":
            return f"{_sender(entry)}: {what}: {self._style(f'rejected ({entry.reason})', 'red')}"
        later = f" (for iteration {entry.at})" if entry.kind == "scheduled" else ""
        return f"{_sender(entry)}: {what}{later}"

    def _status(self, entry: JournalEntry) -> str:
        key = (entry.lane, entry.id or 0)
        command = self._open.get(key)
        if entry.status != "active":
            self._open.pop(key, None)
        return f"  {status_text(entry, command)}"


def status_text(entry: JournalEntry, command: str | None) -> str:
    """Describes the status of a command in words; None: the command is not known."""
    what = command or f"command {entry.id} of lane {entry.lane}"
    status = "begins" if entry.status == "active" else str(entry.status)
    reason = f" ({entry.reason})" if entry.reason not in (None, "none") else ""
    return f"{what}: {status}{reason}"


def _seen(entry: JournalEntry) -> str:
    """Describes the row on which a batch is based: ", decided 12 iterations before"."""
    if entry.seen is None:
        return ""
    if entry.kind == "taken" and entry.seen.since is not None:
        return f", decided {entry.iteration - entry.seen.since} iterations before"
    return f", decided by row {entry.seen.iteration} of run {entry.seen.epoch}"


def _sender(entry: JournalEntry) -> str:
    return entry.sender or f"lane {entry.lane}"


def command_text(command: JournalCommand) -> str:
    """Describes a command in words: "elbow to 0.5 in 2 s"."""
    if command.kind == "purge":
        own = "own commands of " if command.only_own else ""
        return f"purge {own}{', '.join(command.actuators) or 'all'}"
    if command.kind == "request":
        fields = ", ".join(f"{name}={value}" for name, value in (command.fields or {}).items())
        return f"{command.request}({fields})"
    if command.kind == "resume":
        return f"resume halt {command.halt}"
    if command.kind == "mark":
        return "mark " + json_text(command.text, ensure_ascii=False)
    if command.kind == "unknown":
        return f"something of a newer o80 ({command.unknown})"
    if command.kind != "command":
        return command.kind.replace("_", " ")
    parts = [
        f"{name} to {_target(target)}"
        for name, target in zip(command.actuators, command.targets, strict=True)
    ]
    overwrites = command.mode == "overwrite" and command.pace != "chunk"
    overwrite = ", overwriting" if overwrites else ""
    return f"{', '.join(parts)}{_pace(command)}{overwrite}"


def _pace(command: JournalCommand) -> str:
    if command.due:
        first, last = command.due[command.first or 0], command.due[-1]
        end = ", the last of its plan" if command.final else ""
        return f" in a chunk due {first} to {last}, which answers iteration {command.anchor}{end}"
    if command.times:
        return f" in {command.times[-1]:g} s"
    amount = command.amount
    return {
        "duration": f" in {amount} s" if amount is None else f" in {amount:g} s",
        "speed": f" at {amount}/s",
        "until": f" until iteration {amount}",
        "iterations": f" in {amount} iterations each"
        if _is_trajectory(command)
        else f" in {amount} iterations",
        "fastest": " as fast as possible",
    }.get(command.pace, "")


def _is_trajectory(command: JournalCommand) -> bool:
    return any(isinstance(target, np.ndarray) and target.ndim > 0 for target in command.targets)


def _target(target: Any) -> str:
    if isinstance(target, dict):
        return "{" + ", ".join(f"{name}: {_target(value)}" for name, value in target.items()) + "}"
    if isinstance(target, np.ndarray):
        if target.size > _MAX_NUMBERS:
            return f"{len(target)} waypoints, the last {target[-1]}"
        return str(target.tolist())
    return f"{target:g}" if isinstance(target, float) else str(target)
