"""``o80 halt``: halts a robot, even if other parts of the call or the terminal are broken.

It parses its words itself: an option parser would refuse unknown options, and takes long to
import.
"""

import contextlib
import os
import sys
from typing import TextIO

import o80._core as _core
from o80.base.errors import Error, InvalidArgument

_ALIVE = ("starting", "running")
_USAGE = """\
Usage: o80 halt SEGMENT [TEXT...]
       o80 halt --all [TEXT...]

Halt a robot: commands end, it brakes, and nothing moves until o80 resume.

SEGMENT  exact name of a segment; see o80 list
--all    as the first word: every running robot
TEXT     the reason, which others can read: all further words, also those that begin with a dash

Not a safety function: keep an emergency stop that needs no computer.
"""


def halt(segment: str, text: list[str]) -> None:
    """Halt a robot: commands end, it brakes, and nothing moves until it is resumed."""
    sys.exit(halt_words([segment, *text]))


def halt_words(words: list[str]) -> int:
    """Halts by the words after ``o80 halt``; returns the exit code."""
    if not words or words[0] in ("--help", "-h"):
        print(_USAGE, end="", file=sys.stdout if words else sys.stderr)
        return 0 if words else 2
    name, text = words[0], _core.printable(" ".join(words[1:]))  # also for words not in UTF-8
    if name == "--all":
        return _halt_all(text)
    failed = not _halt(name, text)
    for other in _names_in(words[1:], name):
        _complain(f"'{other}' was not halted, it is part of the text: `o80 halt {other}` halts it")
        failed = True
    return int(failed)


def _halt(name: str, text: str) -> bool:
    try:
        number = _core.halt(name, text, 0.0)
    except InvalidArgument as error:
        _complain(f"{error}. Nothing was halted: the first word must be the name of a segment")
    except Error as error:
        _complain(f"{error} Nothing was halted.")
    else:
        _print(f"halt {number} of {name}; go on with: o80 resume {name} {number}\n", sys.stdout)
        return True
    return False


def _halt_all(text: str) -> int:
    entries = [entry for entry in _core.list_segments() if not entry.played]
    running = [entry.name for entry in entries if entry.life in (*_ALIVE, "unknown")]
    if not running:
        problem = _core.directory_problem()
        _complain(problem or "nothing runs, so nothing was halted")
        return int(bool(problem))
    halted = [_halt(name, text) for name in running]  # each, also after one that failed
    return int(not all(halted))


def _names_in(words: list[str], halted: str) -> list[str]:
    """Returns the names of other running robots at the begin of a text."""
    running: set[str] = set()
    with contextlib.suppress(Exception):
        running = {entry.name for entry in _core.list_segments() if entry.life in _ALIVE}
    names: list[str] = []
    for word in " ".join(words).split():
        if word not in running:
            break
        if word != halted:
            names.append(word)
    return list(dict.fromkeys(names))


def _complain(text: str) -> None:
    _print(f"o80: {_core.printable(text)}\n", sys.stderr)


def _print(text: str, stream: TextIO | None) -> None:
    """Prints past the stream's buffer: at exit Python would report text that it cannot write."""
    if stream is None:  # closed when the program began: its number may be that of another file
        return
    with contextlib.suppress(OSError, ValueError):
        try:
            descriptor = stream.fileno()
        except (OSError, ValueError):  # captured by the program that calls this
            stream.write(text)
            return
        os.write(descriptor, text.encode(stream.encoding or "ascii", "backslashreplace"))
