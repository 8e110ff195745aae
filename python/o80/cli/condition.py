"""What is to be said of a backend that does not simply run: halted, hanging, late."""

from __future__ import annotations

from typing import Any

from o80 import _core


def halt_text(segment: str, halt: tuple[int, str, int, str, str] | None) -> str:
    """Why it is halted, and how to go on; empty if it is not."""
    if halt is None:
        return ""
    number, cause, iteration, who, text = halt
    since = "" if iteration < 0 else f" since iteration {iteration}"
    by = f", asked for by {who}" if who else ""
    reason = f": {text}" if text else ""
    return (
        f"halted{since} (halt {number}, cause {cause}{by}){reason}. "
        f"Go on with: o80 resume {segment} {number}"
    )


def running_texts(running: list[tuple[str, int, str, str]]) -> list[str]:
    """The requests that take time and have not ended."""
    return [
        f"request '{name}' of {who} has been running since iteration {since}"
        + (f": {progress}" if progress else "")
        for name, since, who, progress in running
    ]


def rate_text(rate: float | None, frequency: float) -> str:
    """The rate that is reached [1/s], beside the one that was asked for."""
    return f"{frequency:g} Hz" if rate is None else f"{_rounded(rate)} of {frequency:g} Hz"


def _rounded(rate: float) -> str:
    return f"{rate:.0f}" if rate >= 100 else f"{rate:.3g}"


def pace_text(loop: _core.LoopState) -> str:
    """How the loop does, in one line."""
    if loop.bursting:
        return f"bursting: runs when a frontend asks for iterations; at row {loop.last}"
    age = "no row yet" if loop.row_age is None else f"last row {age_text(loop.row_age)} ago"
    rate = rate_text(loop.rate, loop.frequency)
    return f"{rate} reached, {loop.overruns} overruns, {loop.skipped} missed ticks, {age}"


def age_text(seconds: float) -> str:
    """A time that has passed, as short as it can be."""
    for unit, length in (("h", 3600), ("min", 60)):
        if seconds >= 2 * length:
            return f"{seconds / length:.0f} {unit}"
    return f"{seconds:.0f} s" if seconds >= 1 else f"{max(seconds, 0.0) * 1e3:.0f} ms"


def watchdog_text(schema: dict[str, Any]) -> str:
    """What follows when a commander hangs or dies."""
    silence, stale = schema["silence"], schema["stale"]
    if silence:
        return f"watchdog: {silence} iterations without life, then {stale}"
    return f"no watchdog (--silence); when a commander dies: {stale}"
