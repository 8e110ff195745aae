"""Computes report.json from a lab's recording: rates, latencies and errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80
from o80.base.finite import json_text

from ..world.timing import ITERATIONS
from .environment_process import COUNTS, Phase
from .parts import ARM, ENVIRONMENT, LAUNCHER, MOTION_CAPTURE, RATES, TRACKER, LabSettings

Figures = dict[str, Any]
Rows = Mapping[str, Any]
MAX_MISSED = {ARM: 0.1, TRACKER: 1.0, MOTION_CAPTURE: 1.0, ENVIRONMENT: 1.0}
"""Limits of missed periods on a quiet machine [%]."""
SETTLING = 1.0
"""Omitted time at the beginning, while processes still start [s]."""
CAPTURES = (
    ("image to row of the tracker", TRACKER, "image_time"),
    ("frame to row of the motion capture", MOTION_CAPTURE, "capture_time"),
    ("row of the arm to row of the environment", ENVIRONMENT, "arm_time"),
    ("image to row of the environment", ENVIRONMENT, "ball_time"),
)
"""Latencies from capture to row: name, part, field of the capture time."""


def write_report(settings: LabSettings, scheduling: Mapping[str, str]) -> Figures:
    """Writes the report, and returns it. scheduling: class of each process, by name."""
    recording, rows = o80.open(settings.recording), {}
    for part in RATES:
        name = settings.segment(part)
        if name in recording and recording[name].epochs:
            history = recording[name].epochs[-1].history()  # of the last run
            begin = int(np.searchsorted(history.time, history.time[:1] + round(SETTLING * 1e9))[0])
            if len(history) - begin > 2:
                rows[part] = history[begin:]
    processes = {
        name: _regularity(name, history) | {"scheduling": scheduling.get(name, "ended")}
        for name, history in rows.items()
    }
    played = _last(rows, ENVIRONMENT, *COUNTS)
    report = {
        "balls": {name.removeprefix("balls_"): number for name, number in played.items()},
        "processes": processes,
        "latency_ms": {
            what: _latency(rows[part], field) for what, part, field in CAPTURES if part in rows
        },
        "tracking_error_mm": _tracking_error(rows),
        "motion_capture_error_mm": _motion_capture_error(rows),
        "launcher": _last(rows, LAUNCHER, "completed", "rejected", "not_sent", "timed_out"),
        "settings": {"policy": settings.policy, "seed": settings.seed, "balls": settings.balls},
        "wanted": _wanted(processes),
    }
    (settings.folder / "report.json").write_text(json_text(report, indent=2) + "\n")
    return report


def spread(values: NDArray[np.floating[Any]]) -> dict[str, float] | None:
    """Computes mean, 50 %, 95 %, 99 % and maximum of finite numbers; None without any."""
    numbers = values[np.isfinite(values)]
    if len(numbers) == 0:
        return None
    half, many, most = np.percentile(numbers, (50, 95, 99))
    named = {"mean": numbers.mean(), "50%": half, "95%": many, "99%": most, "most": numbers.max()}
    return {name: round(float(value), 4) for name, value in named.items()}


def _last(rows: Rows, part: str, *names: str) -> dict[str, int]:
    return {name: int(rows[part].extended[name][-1]) for name in names if part in rows}


def _regularity(name: str, rows: o80.History) -> Figures:
    """Computes rate, missed periods and jitter: deviation of intervals from the period [us]."""
    between, skipped = np.diff(rows.time), np.asarray(rows.skipped)
    missed = int(skipped[-1]) - int(skipped[0])
    percent = 100.0 * missed / (len(between) + missed)
    if name == ENVIRONMENT:  # the environment skips no step, but catches up after late ones
        percent = 100.0 * float((np.asarray(rows.extended.late) >= ITERATIONS).mean())
    return {
        "asked": RATES[name],
        "measured": float(1e9 / between.mean()),
        "missed_percent": percent,
        "jitter_us": spread(np.abs(between - 1e9 / RATES[name]) * 1e-3),
    }


def _latency(rows: o80.History, field: str) -> Figures | None:
    then = np.asarray(rows.extended[field])
    return spread((rows.time - then)[then > 0] * 1e-6)


def _errors(places: Any, at: Any, times: Any, true: Any, which: Any) -> Figures | None:
    """Distances [mm] of `places[which]` from true places, interpolated at the times `at`."""
    axes = [np.interp(at, times, axis, left=np.nan, right=np.nan) for axis in np.asarray(true).T]
    off = np.linalg.norm(np.asarray(places) - np.stack(axes, axis=1), axis=1)
    return spread(1e3 * off[which])


def _tracking_error(rows: Rows) -> Figures | None:
    """Errors [mm] of the tracker's ball at its images' times, and of the policy's observed ball,
    against the world's ball, interpolated between the environment's rows."""
    if TRACKER not in rows or ENVIRONMENT not in rows:
        return None
    tracker, environment = rows[TRACKER].extended, rows[ENVIRONMENT].extended
    playing, seen = environment.phase == Phase.playing, np.asarray(environment.ball_time) > 0
    if not playing.any():
        return None
    true = environment.arm_time, np.where(playing[:, None], environment.true_ball, np.nan)
    images = np.asarray(tracker.capture_time)
    # an observation is published with the next row of the environment
    observed = environment.observed_ball, environment.observed_at
    return {
        "at the time of the images": _errors(tracker.position, images, *true, images > 0),
        "as observed, flown on to the row of the arm": _errors(*observed, *true, seen),
        "share of the rows with a ball that was seen": round(float(seen[playing].mean()), 4),
    }


def _motion_capture_error(rows: Rows) -> Figures | None:
    """Error of the racket against the arm's rows, interpolated at the capture times [mm]."""
    if MOTION_CAPTURE not in rows or ARM not in rows:
        return None
    system, arm = rows[MOTION_CAPTURE].extended, rows[ARM]
    true = arm.time, arm.extended.racket_position
    racket = system.racket
    return _errors(racket.position, system.capture_time, *true, np.asarray(racket.visible))


def _wanted(processes: Mapping[str, Figures]) -> Figures:
    """Compares this run with the targets for a quiet machine."""
    wanted: dict[str, tuple[Any, ...]] = {}
    for name in (name for name in MAX_MISSED if name in processes):
        most, missed = MAX_MISSED[name], round(processes[name]["missed_percent"], 3)
        wanted[f"{name}: missed periods [%]"] = f"less than {most}", missed, missed < most
    if ARM in processes:
        kind = processes[ARM]["scheduling"]
        wanted["arm: scheduling"] = "fifo", kind, kind.startswith("fifo")
    names = "wanted", "measured", "reached"
    return {what: dict(zip(names, each, strict=True)) for what, each in wanted.items()}
