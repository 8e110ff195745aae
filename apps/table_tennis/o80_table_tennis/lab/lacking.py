"""Sentences about what a report lacks: balls that were not played, figures without any row."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .parts import ARM, CAMERAS, ENVIRONMENT, MOTION_CAPTURE, TRACKER

SOURCES = {
    "latency_ms": (TRACKER, MOTION_CAPTURE, ENVIRONMENT),
    "tracking_error_mm": (TRACKER, CAMERAS, ENVIRONMENT),
    "motion_capture_error_mm": (MOTION_CAPTURE, ARM),
}
"""Figures of the report, with the processes whose rows they are computed from."""


def not_played(balls: Mapping[str, int], requested: int) -> list[str]:
    """A sentence if fewer balls were played than asked for (0: no number), or some were given up.

    balls: as the report counts them; empty: the environment left no rows.
    """
    played, given_up = balls.get("played", 0), balls.get("given_up", 0)
    if played >= requested and not given_up:
        return []
    failed = balls.get("launches_failed", 0)
    of = f"{played} of {requested}" if requested else f"{played}"
    return [
        f"balls: {of} were played; {given_up} were given up because the arm or the world ended or "
        f"stood, {failed} launches failed"
    ]


def not_measured(report: Mapping[str, Any]) -> list[str]:
    """A sentence for each figure that no row gives, as on a machine that is much too slow."""
    sentences = []
    for name, parts in SOURCES.items():
        figures = report[name]
        if isinstance(figures, dict) and None not in figures.values():
            continue
        said = []
        for part in parts:
            process = report["processes"].get(part)
            share = None if process is None else process["missed_percent"]
            missed = "did not run" if share is None else f"{share:.0f} % missed"
            said.append(f"{part} {missed}")
        lacking = [key for key, value in (figures or {name: None}).items() if value is None]
        what = f"no row tells {', '.join(lacking)}"
        sentences.append(f"{name}: {what}; of the periods: {', '.join(said)}")
    return sentences
