"""What is to be said of a backend that does not simply run: halted, hanging, late."""

from __future__ import annotations

import time
from typing import Any

import o80

_SLOW = 1.0  # a verb, or a row, that takes longer is worth a word [s]


def halt_text(frontend: o80.Frontend) -> str:
    """Why it is halted, and how to go on; empty if it is not."""
    halt = frontend.halted
    if halt is None:
        return ""
    since = "" if halt.iteration is None else f" since iteration {halt.iteration}"
    who = f", asked for by {halt.who}" if halt.who else ""
    reason = f": {halt.text}" if halt.text else ""
    return (
        f"halted{since} (halt {halt.number}, cause {halt.cause}{who}){reason}. "
        f"Go on with: o80 resume {frontend.segment} {halt.number}"
    )


def running_texts(frontend: o80.Frontend) -> list[str]:
    """The requests that take time and have not ended."""
    if not frontend.alive:
        return []
    return [
        f"request '{request.name}' of {request.who} has been running since iteration "
        f"{request.since}" + (f": {request.progress}" if request.progress else "")
        for request in frontend.running_requests
    ]


def start_text(started_at: int) -> str:
    """What is wrong with a backend that is starting since then [s since 1970]; or nothing."""
    age = time.time() - started_at
    if age <= _SLOW + 1:  # the start is known in whole seconds
        return ""
    return f"start, or the first read of its driver, has not returned for {age:.0f} s"


def loop_text(frontend: o80.Frontend) -> str:
    """What is wrong with its loop: a driver that hangs, no rows, late iterations; or nothing."""
    if not frontend.alive or frontend.published < 0:
        return ""
    said = []
    slow = frontend._slow_verb
    if slow is not None and slow[1] > _SLOW:
        said.append(f"{slow[0]} has not returned for {slow[1]:.0f} s")
    if not frontend.bursting:
        rows = frontend.history(max(2, round(frontend.frequency)))
        age = (time.monotonic_ns() - rows[-1].time) * 1e-9
        if age > max(_SLOW, 2 * frontend.period):
            said.append(f"no row for {age:.0f} s")
        late = rows[-1].overruns - rows[0].overruns
        if late:
            seconds = (rows[-1].time - rows[0].time) * 1e-9
            rate = (rows[-1].iteration - rows[0].iteration) / seconds if seconds > 0 else 0.0
            said.append(
                f"{late} of the last {len(rows)} iterations were late: {rate:.0f} Hz reached of "
                f"{frontend.frequency:g}"
            )
    return "; ".join(said)


def watchdog_text(schema: dict[str, Any]) -> str:
    """What follows when a commander hangs or dies."""
    silence, stale = schema["silence"], schema["stale"]
    if silence:
        return f"watchdog: {silence} iterations without life, then {stale}"
    return f"no watchdog (--silence); when a commander dies: {stale}"
