"""report.json: what the recording of a lab says about rates, latencies and errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80
from o80.base.arrays import IntArray
from o80.base.finite import json_text

from ..world.timing import ITERATIONS
from .environment_process import COUNTS, Phase
from .parts import ARM, ENVIRONMENT, LAUNCHER, MOTION_CAPTURE, RATES, TRACKER, LabSettings

Figures = dict[str, Any]
MAX_MISSED = {ARM: 0.1, TRACKER: 1.0, MOTION_CAPTURE: 1.0, ENVIRONMENT: 1.0}
"""Periods that may be missed on a quiet machine [%]."""
SETTLING = 1.0
"""Left out at the beginning, while processes still start [s]."""


def write_report(settings: LabSettings, scheduling: Mapping[str, str]) -> Figures:
    """Writes the report, and returns it. scheduling: class of each process, by name."""
    recording, rows = o80.open(settings.recording), {}
    for part in RATES:
        name = settings.segment(part)
        if name in recording and recording[name].epochs:
            history = recording[name].epochs[-1].history()  # of its last run
            begin = int(np.searchsorted(history.time, history.time[:1] + round(SETTLING * 1e9))[0])
            if len(history) - begin > 2:
                rows[part] = history[begin:]
    processes = {
        name: _regularity(name, history) | {"scheduling": scheduling.get(name, "ended")}
        for name, history in rows.items()
    }
    played = _last(rows.get(ENVIRONMENT), *COUNTS)
    report = {
        "balls": {name.removeprefix("balls_"): number for name, number in played.items()},
        "processes": processes,
        "latency_ms": _latencies(rows),
        "tracking_error_mm": _tracking_error(rows.get(TRACKER), rows.get(ENVIRONMENT)),
        "motion_capture_error_mm": _motion_capture_error(rows.get(MOTION_CAPTURE), rows.get(ARM)),
        "launcher": _last(rows.get(LAUNCHER), "completed", "rejected", "not_sent", "timed_out"),
        "settings": {"policy": settings.policy, "seed": settings.seed, "balls": settings.balls},
        "wanted": _wanted(processes),
    }
    (settings.folder / "report.json").write_text(json_text(report, indent=2) + "\n")
    return report


def spread(values: NDArray[np.floating[Any]]) -> dict[str, float] | None:
    """Mean, 50 %, 95 %, 99 % and greatest of numbers; None: there are none."""
    numbers = values[np.isfinite(values)]
    if len(numbers) == 0:
        return None
    half, many, most = np.percentile(numbers, (50, 95, 99))
    named = {"mean": numbers.mean(), "50%": half, "95%": many, "99%": most, "most": numbers.max()}
    return {name: round(float(value), 4) for name, value in named.items()}


def _last(rows: o80.History | None, *names: str) -> dict[str, int]:
    return {} if rows is None else {name: int(rows.extended[name][-1]) for name in names}


def _regularity(name: str, rows: o80.History) -> Figures:
    """Rate, missed periods and jitter: distance of neighbouring rows from the period [us]."""
    between, skipped = np.diff(rows.time), np.asarray(rows.skipped)
    missed = int(skipped[-1]) - int(skipped[0])
    percent = 100.0 * missed / (len(between) + missed)
    if name == ENVIRONMENT:  # it skips no step, but makes up for those that came late
        percent = 100.0 * float((np.asarray(rows.extended.late) >= ITERATIONS).mean())
    return {
        "asked": RATES[name],
        "measured": float(1e9 / between.mean()),
        "missed_percent": percent,
        "jitter_us": spread(np.abs(between - 1e9 / RATES[name]) * 1e-3),
    }


def _latencies(rows: Mapping[str, o80.History]) -> Figures:
    """From capture to the row that shows it [ms]."""
    captures = (
        ("image to row of the tracker", TRACKER, "image_time"),
        ("frame to row of the motion capture", MOTION_CAPTURE, "capture_time"),
        ("row of the arm to row of the environment", ENVIRONMENT, "arm_time"),
        ("image to row of the environment", ENVIRONMENT, "ball_time"),
    )
    found = {}
    for what, part, field in captures:
        if part in rows:
            now, then = rows[part].time, np.asarray(rows[part].extended[field])
            found[what] = spread((now - then)[then > 0] * 1e-6)
    return found


def _between(at: IntArray, times: IntArray, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places (n, 3) at other times, NaN outside."""
    axes = (np.interp(at, times, axis, left=np.nan, right=np.nan) for axis in places.T)
    return np.stack(list(axes), axis=1)


def _tracking_error(tracker: o80.History | None, environment: o80.History | None) -> Figures | None:
    """Errors [mm] of the tracker, at the times of its images against the ball of the world between
    rows of the environment, and of the ball that the policy observed."""
    if tracker is None or environment is None:
        return None
    rows: Any = environment.extended
    playing = rows.phase == Phase.playing
    if not playing.any():
        return None
    times, seen = np.asarray(rows.arm_time), np.asarray(rows.ball_time) > 0
    true = np.where(playing[:, None], rows.true_ball, np.nan)
    images = np.asarray(tracker.extended.capture_time)
    away = np.asarray(tracker.extended.position) - _between(images, times, true)
    # an observation is published with the next row of the environment
    observed = np.asarray(rows.observed_ball) - _between(np.asarray(rows.observed_at), times, true)
    return {
        "at the time of the images": spread(1e3 * np.linalg.norm(away[images > 0], axis=1)),
        "as observed, flown on to the row of the arm": spread(
            1e3 * np.linalg.norm(observed[seen], axis=1)
        ),
        "share of the rows with a ball that was seen": round(float(seen[playing].mean()), 4),
    }


def _motion_capture_error(system: o80.History | None, arm: o80.History | None) -> Figures | None:
    """Error of the racket against the rows of the arm at the same times [mm]."""
    if system is None or arm is None:
        return None
    racket: Any = system.extended.racket
    true = _between(system.extended.capture_time, arm.time, arm.extended.racket_position)
    good = np.asarray(racket.visible)
    return spread(1e3 * np.linalg.norm((np.asarray(racket.position) - true)[good], axis=1))


def _wanted(processes: Mapping[str, Figures]) -> Figures:
    """Targets of a quiet machine, and whether this run has reached them."""
    wanted: Figures = {}

    def want(what: str, target: str, measured: object, *, reached: bool) -> None:
        wanted[what] = {"wanted": target, "measured": measured, "reached": reached}

    for name, most in MAX_MISSED.items():
        if name in processes:
            missed = round(processes[name]["missed_percent"], 3)
            want(f"{name}: missed periods [%]", f"less than {most}", missed, reached=missed < most)
    if ARM in processes:
        kind = processes[ARM]["scheduling"]
        want("arm: scheduling", "fifo", kind, reached=kind.startswith("fifo"))
    return wanted
