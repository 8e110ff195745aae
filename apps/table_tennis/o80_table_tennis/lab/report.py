"""report.json: what the recording of a lab says about rates, latencies and errors."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80
from o80.base.arrays import IntArray
from o80.base.finite import json_text

from ..world.timing import ITERATIONS, PERIOD
from .environment_row import Phase
from .loops import Loop
from .parts import (
    ARM,
    CAMERAS,
    ENVIRONMENT,
    LAUNCHER,
    MOTION_CAPTURE,
    RATES,
    TRACKER,
    WORLD,
    LabSettings,
)

REPORT = "report.json"

MAX_MISSED = {ARM: 0.1} | dict.fromkeys((CAMERAS, TRACKER, MOTION_CAPTURE, ENVIRONMENT), 1.0)
"""Periods that may be missed on a quiet machine [%]."""
SETTLING = 1.0
"""Left out at the beginning, while processes still start [s]."""


def write_report(
    settings: LabSettings,
    loops: Mapping[str, Loop],
    usage: Mapping[str, float],
    seconds: float,
) -> dict[str, Any]:
    """Writes the report, and returns what it holds."""
    rows = _Rows(settings)
    processes = {name: _process(name, loop, rows, usage.get(name)) for name, loop in loops.items()}
    report = {
        "balls": _balls(rows),
        "processes": processes,
        "processor_percent": {name: round(used, 1) for name, used in usage.items()},
        "processors": os.cpu_count(),
        "latency_ms": _latencies(rows),
        "tracking_error_mm": _tracking_error(rows),
        "motion_capture_error_mm": _motion_capture_error(rows),
        "launcher": _launcher(rows),
        "seconds": round(seconds, 1),
        "settings": {"policy": settings.policy, "seed": settings.seed, "balls": settings.balls},
        "wanted": _wanted(processes),
        "wall_clock": time.strftime("%Y-%m-%d %H:%M:%S"),
        "kernel": os.uname().version,
    }
    path = settings.folder / REPORT
    path.write_text(json_text(report, indent=2) + "\n")
    return report


class _Rows:
    """The recorded rows of each part; None: there are none."""

    def __init__(self, settings: LabSettings) -> None:
        self._recording = o80.open(settings.recording)
        self._settings = settings

    def of(self, part: str) -> o80.History | None:
        """Rows of the last run of a part, without its beginning."""
        name = self._settings.segment(part)
        if name not in self._recording:
            return None
        epochs = self._recording[name].epochs
        history = epochs[-1].history() if epochs else None
        if history is None or len(history) < 2:
            return None
        begin = history.time[0] + round(SETTLING * 1e9)
        settled = history[int(np.searchsorted(history.time, begin)) :]
        return settled if len(settled) > 2 else history

    def whole(self, part: str) -> o80.History | None:
        """All rows of the last run of a part."""
        name = self._settings.segment(part)
        if name not in self._recording or not self._recording[name].epochs:
            return None
        history: o80.History = self._recording[name].epochs[-1].history()
        return history if len(history) > 1 else None


def _process(name: str, loop: Loop, rows: _Rows, usage: float | None) -> dict[str, Any]:
    """Rate, missed periods and jitter: by its rows, or without them by its counters."""
    found: dict[str, Any] = {
        "asked": RATES.get(name),
        "measured": loop.rate,
        "missed_percent": loop.missed_percent,
        "scheduling": loop.scheduling,
        "processor_percent": None if usage is None else round(usage, 1),
        "from": "counters",
    }
    history = rows.of(name)
    if name not in RATES or history is None:
        return found
    found |= regularity(history.time, history.skipped, 1e9 / RATES[name])
    if name == ENVIRONMENT:  # it skips no step, but makes up for those that came late
        late = np.asarray(history.extended.late) >= ITERATIONS
        found["missed_percent"] = 100.0 * float(late.mean())
    return found


def regularity(times: IntArray, skipped: NDArray[np.uint32], period: float) -> dict[str, Any]:
    """Regularity of rows, from their times and counts of skipped periods; period [ns]."""
    between = np.diff(times)
    missed = int(skipped[-1]) - int(skipped[0])
    return {
        "from": "rows",
        "rows": len(times),
        "measured": float(1e9 / between.mean()),
        "missed_percent": 100.0 * missed / (len(between) + missed),
        "jitter_us": spread(np.abs(between - period) * 1e-3),
    }


def spread(values: NDArray[np.floating[Any]]) -> dict[str, float] | None:
    """Mean, 50 %, 95 %, 99 % and greatest of numbers; None: there are none."""
    numbers = values[np.isfinite(values)]
    if len(numbers) == 0:
        return None
    half, many, most = np.percentile(numbers, (50, 95, 99))
    named = {"mean": numbers.mean(), "50%": half, "95%": many, "99%": most, "most": numbers.max()}
    return {name: round(float(value), 4) for name, value in named.items()}


def _balls(rows: _Rows) -> dict[str, int]:
    history = rows.of(ENVIRONMENT)
    if history is None:
        return {}
    last = history.extended
    names = ("played", "touched", "returned", "given_up")
    found = {name: int(last[f"balls_{name}"][-1]) for name in names}
    return found | {"launches_failed": int(last.launches_failed[-1])}


def _latencies(rows: _Rows) -> dict[str, Any]:
    """From capture to the row that shows it [ms]."""
    found: dict[str, Any] = {}
    if (tracker := rows.of(TRACKER)) is not None:
        taken = np.asarray(tracker.extended.image_time)
        found["image to row of the tracker"] = _ages(tracker.time, taken)
    if (system := rows.of(MOTION_CAPTURE)) is not None:
        taken = np.asarray(system.extended.capture_time)
        found["frame to row of the motion capture"] = _ages(system.time, taken)
    if (environment := rows.of(ENVIRONMENT)) is not None:
        seen = environment.extended
        found["row of the arm to row of the environment"] = _ages(
            environment.time, np.asarray(seen.arm_time)
        )
        found["image to row of the environment"] = _ages(
            environment.time, np.asarray(seen.ball_time)
        )
    return found


def _ages(now: IntArray, then: IntArray) -> dict[str, float] | None:
    """Ages at `now` of captures at `then` (0: none), in [ns]; returned in [ms]."""
    return spread((now - then)[then > 0] * 1e-6)


def _tracking_error(rows: _Rows) -> dict[str, Any] | None:
    """Errors of the tracker against the ball of the world when the images were taken [mm], and
    of the ball that the policy observed against the world at the same time."""
    tracker, world, environment = rows.of(TRACKER), rows.whole(WORLD), rows.of(ENVIRONMENT)
    if tracker is None or world is None or environment is None:
        return None
    played, seen = environment.extended, tracker.extended
    playing = (played.phase == Phase.playing) & (played.world_row >= 0)
    # the world mirrors five rows of the arm for each row of the environment
    row_at, time_at = np.asarray(played.world_row)[playing], np.asarray(played.arm_time)[playing]
    at = np.asarray(seen.capture_time)
    found = np.searchsorted(time_at, at)
    good = (at > 0) & (found < len(time_at))
    found, at = found[good], at[good]
    back = (time_at[found] - at) / (1e9 * PERIOD)
    first = int(world.iteration[0])
    place = row_at[found] - back - first
    good_place = (back < ITERATIONS) & (place >= 0) & (place <= len(world) - 1)
    balls = world.rows["observed"]["balls"].reshape(len(world), -1)[:, 0]["position"]
    below = np.floor(place[good_place]).astype(int)
    share = (place[good_place] - below)[:, None]
    true = (1 - share) * balls[below] + share * balls[np.minimum(below + 1, len(world) - 1)]
    away = np.asarray(seen.position)[good][good_place] - true
    # an observation is published with the next row of the environment
    when, seen_then = np.asarray(played.observed_at), np.asarray(played.seen)
    then = np.minimum(np.searchsorted(played.arm_time, when), len(when) - 1)
    seen_then = seen_then & (np.asarray(played.arm_time)[then] == when)
    observed = np.asarray(played.observed_ball) - np.asarray(played.true_ball)[then]
    in_play = np.asarray(played.seen)[played.phase == Phase.playing]
    return {
        "at the time of the images": spread(1e3 * np.linalg.norm(away, axis=1)),
        "as observed, flown on to the row of the arm": spread(
            1e3 * np.linalg.norm(observed[np.asarray(played.seen)], axis=1)
        ),
        "share of the rows with a ball that was seen": round(float(np.mean(in_play)), 4)
        if len(in_play) > 0
        else None,
    }


def _motion_capture_error(rows: _Rows) -> dict[str, float] | None:
    """Error of the racket against the rows of the arm at the same times [mm]."""
    system, arm = rows.of(MOTION_CAPTURE), rows.of(ARM)
    if system is None or arm is None:
        return None
    racket = system.extended.racket
    at = np.asarray(system.extended.capture_time)
    good = np.asarray(racket.visible) & (at > arm.time[0]) & (at < arm.time[-1])
    true = np.stack(
        [np.interp(at[good], arm.time, axis) for axis in arm.extended.racket_position.T], axis=1
    )
    away = np.asarray(racket.position)[good] - true
    return spread(1e3 * np.linalg.norm(away, axis=1))


def _launcher(rows: _Rows) -> dict[str, int]:
    history = rows.of(LAUNCHER)
    if history is None:
        return {}
    names = ("completed", "rejected", "not_sent", "timed_out")
    return {name: int(history.extended[name][-1]) for name in names}


def _wanted(processes: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Targets of a quiet machine, and whether this run has reached them."""
    wanted: dict[str, Any] = {}
    for name, most in MAX_MISSED.items():
        if name in processes:
            missed = processes[name]["missed_percent"]
            wanted[f"{name}: missed periods [%]"] = {
                "most": most,
                "measured": round(missed, 3),
                "reached": bool(missed < most),
            }
    if ARM in processes:
        scheduling = processes[ARM]["scheduling"]
        wanted["arm: scheduling"] = {
            "wanted": "fifo",
            "measured": scheduling,
            "reached": scheduling.startswith("fifo"),
        }
    return wanted
