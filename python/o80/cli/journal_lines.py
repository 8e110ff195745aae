"""Prints the journal of a backend, an entry a line (``o80 echo --commands``)."""

import sys
import time
from dataclasses import asdict
from typing import Any

import numpy as np

import o80._core as _core
from o80.base.errors import Error, TimeoutError
from o80.base.finite import json_text
from o80.base.screen import complain_once, emit, style
from o80.frontend.frontend import Frontend
from o80.frontend.reader import Journal
from o80.rows.journal import JournalEntry
from o80.rows.journal_text import JournalText

_LOOK = 0.05  # interval of polls for new entries [s]
_BEFORE = 10  # entries of a living backend that are printed at the start


def follow(frontend: Frontend, count: int, as_json: bool, timeout: float | None) -> None:
    """Prints the last journal entries, then new ones, `count` in total (0: without an end).

    If the backend is dead, prints its last entries and raises the error with the reason.
    """
    journal = Journal(frontend)
    if not journal.exists:
        raise Error(f"'{frontend.segment}' has no journal: its backend was started without one")
    lines = _Lines(as_json)
    left = count if count else None
    alive = frontend.alive
    found = [lines.line(entry) for entry in journal.read()]
    found = found[-(count or (_BEFORE if alive else 0)) :]
    waited_since = time.monotonic()
    while True:
        for line in found:
            emit(line)
        if not alive:
            frontend.wait_for(frontend.published + 1, timeout=0)  # raises the reason of its end
        if left is not None:
            left -= len(found)
            if not left:
                return
        if found:
            waited_since = time.monotonic()
        elif timeout is not None and time.monotonic() - waited_since >= timeout:
            raise TimeoutError(f"'{frontend.segment}' decided nothing for {timeout:g} s")
        time.sleep(_LOOK)
        alive = frontend.alive
        found = [lines.line(entry) for entry in journal.read()][:left]


def print_recorded(path: str, count: int, as_json: bool) -> None:
    """Prints the entries in a recording; with `count` the last ones of each run of a robot."""
    from o80.recording.reader import open as open_recording

    recording = open_recording(path)
    for name in recording:
        epochs = recording[name].epochs
        for number, epoch in enumerate(epochs):
            lines = _Lines(as_json)
            found = [lines.line(entry) for entry in epoch.journal()]
            if not as_json and (len(recording) > 1 or len(epochs) > 1):
                print(f"{name}, run {number}:", file=sys.stderr, flush=True)
            for line in found[-count:]:  # all of them if count is 0
                emit(line)


class _Lines:
    """Formats entries as lines."""

    def __init__(self, as_json: bool) -> None:
        self._as_json = as_json
        self._text = JournalText(style)

    def line(self, entry: JournalEntry) -> str:
        if self._as_json:
            return json_text(asdict(entry), default=_plain, say=complain_once)
        said = self._text.text(entry)
        parts = [style(f"{entry.iteration:>8}", "bold"), said]
        if entry.missed:
            parts.insert(0, f"({entry.missed} entries before this one are missing)\n")
        return " ".join(parts)


def _plain(value: Any) -> Any:
    if isinstance(value, _core.Seen):
        return {
            name: getattr(value, name) for name in ("epoch", "iteration", "time", "clock", "since")
        }
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)
