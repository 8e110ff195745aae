"""Texts about halted, hanging and late backends."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import o80._core as _core
from o80.base.errors import sentence

if TYPE_CHECKING:
    from o80.rows.journal import JournalEntry


def halt_text(
    segment: str, halt: tuple[int, str, int, str, str] | None, *, played: bool = False
) -> str:
    """Returns the reason of a halt and the command that resumes; empty if there is no halt.

    played: the halt is part of a played recording.
    """
    if halt is None:
        return ""
    number, cause, iteration, who, text = halt
    since = "" if iteration < 0 else f" since iteration {iteration}"
    by = f", requested by {who}" if who else ""
    reason = f": {text}" if text else ""
    if played:
        return f"was halted{since} when it was recorded{reason}"
    halted = sentence(f"halted{since} (halt {number}, cause {cause}{by}){reason}")
    return f"{halted} Go on with: o80 resume {segment} {number}"


def running_texts(running: list[tuple[str, int, str, str]]) -> list[str]:
    """Returns a line for each running request."""
    return [
        f"request '{name}' of {who} has been running since iteration {since}"
        + (f": {progress}" if progress else "")
        for name, since, who, progress in running
    ]


def rate_text(rate: float | None, frequency: float) -> str:
    """Formats the reached rate and the requested frequency [1/s]."""
    if rate is None:
        return f"{frequency:g} Hz"
    return f"{rate:.{'0f' if rate >= 100 else '3g'}} of {frequency:g} Hz"


def pace_text(loop: _core.LoopState) -> str:
    """Formats rate, overruns and age of the last row in one line."""
    if loop.bursting:
        return f"bursting: runs when a frontend requests iterations; at row {loop.last}"
    if loop.played and loop.row_age is None:
        return f"a recording of {loop.frequency:g} Hz is played; at row {loop.last}"
    age = "no row yet" if loop.row_age is None else f"last row {age_text(loop.row_age)} ago"
    rate = rate_text(loop.rate, loop.frequency)
    return f"{rate} reached, {loop.overruns} overruns, {loop.skipped} missed ticks, {age}"


def starved_text(starvations: int) -> str:
    """Returns how often a plan of chunks ran out of rows; empty if it never did."""
    times = "once" if starvations == 1 else f"{starvations} times"
    return f"plans of chunks ran out of rows {times} (docs/chunks.md)" if starvations else ""


def clipped_text(entries: "Iterable[JournalEntry | _core.JournalEntry]") -> str:
    """Returns a text with the counts of clipped numbers and of their batches; empty without any."""
    counts = [each.clipped for each in entries if each.kind == "taken" and each.clipped]
    batches = "1 batch" if len(counts) == 1 else f"{len(counts)} batches"
    return f"{sum(counts)} numbers of targets were clipped, in {batches}" if counts else ""


def latency_percentiles(latencies: list[int]) -> dict[str, int]:
    """Returns median, p95 and max of decision latencies [iterations], the number of batches, and
    how many of these have an unknown latency (-1). Empty without batches.
    """
    if not latencies:
        return {}
    known = sorted(each for each in latencies if each >= 0)
    counts = {"batches": len(latencies), "unknown": len(latencies) - len(known)}
    if not known:
        return counts
    last = len(known) - 1
    shares = {"median": 50, "p95": 95, "max": 100}
    return counts | {name: known[-(-last * share // 100)] for name, share in shares.items()}


def latency_text(summary: dict[str, int], period: float) -> str:
    """Formats the decision latency of batches in one line; empty if no batch has a `seen` row.

    summary: from latency_percentiles(). period: [ns].
    """
    if not summary:
        return ""
    known, unknown = summary["batches"] - summary["unknown"], summary["unknown"]
    lacks = f"not known of {unknown} batch{'' if unknown == 1 else 'es'}"
    if not known:
        return f"decision latency {lacks}"
    return (
        f"decision latency of {known} batch{'' if known == 1 else 'es'} in iterations of "
        f"{period * 1e-6:.4g} ms: median {summary['median']}, 95 % {summary['p95']}, largest "
        f"{summary['max']}" + (f"; {lacks}" if unknown else "")
    )


def age_text(seconds: float) -> str:
    """Formats a duration with one unit."""
    for unit, length in (("h", 3600), ("min", 60)):
        if seconds >= 2 * length:
            return f"{seconds / length:.0f} {unit}"
    return f"{seconds:.0f} s" if seconds >= 1 else f"{max(seconds, 0.0) * 1e3:.0f} ms"


def watchdog_text(schema: dict[str, Any]) -> str:
    """Describes the backend's reaction to a commander that hangs or dies."""
    silence, stale = schema["silence"], schema["stale"]
    if silence:
        return f"watchdog: {stale} after {silence} iterations without a sign of life"
    return f"no watchdog (--silence); when a commander dies: {stale}"
