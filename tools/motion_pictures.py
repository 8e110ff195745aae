"""Draws the pictures of docs/commands.md and docs/streaming.md."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import o80
from o80.drivers import Desired, Reading

FREQUENCY = 500.0
LIMITS = o80.Limits(speed=2.0, acceleration=15.0, jerk=500.0)
FAST = o80.Limits(speed=6.0, acceleration=200.0, jerk=20000.0)
TARGET = 0.1
PACES: dict[str, dict[str, Any]] = {
    "a set-point": {},
    "iterations=50": {"iterations": 50},
    "duration=0.3": {"duration": 0.3},
    "speed=1.0": {"speed": 1.0},
    "duration=0.3,\nprofile='linear'": {"duration": 0.3, "profile": "linear"},
}
EVERY = 0.02  # [s]


class Joints:
    """One joint without limits, two with; observed positions equal the desired ones."""

    actuators = ("free", "limited", "fast")
    limits = {"limited": LIMITS, "fast": FAST}  # noqa: RUF012
    simulated = True

    def __init__(self) -> None:
        self.states = np.zeros(3)

    def write(self, desired: Desired) -> None:
        self.states = np.array(desired.states)

    def read(self, reading: Reading) -> None:
        reading.observed = self.states


def draw_paces(path: Path) -> None:
    """Draws each pace to the same target, without and with limits."""
    figure = Figure(figsize=(11, 4.6), layout="constrained")
    axes = figure.subplots(2, len(PACES), sharex=True, sharey="row")
    for column, (title, options) in enumerate(PACES.items()):
        with o80.robots.load(Joints).inline(frequency=FREQUENCY) as arm:
            arm.burst(10)
            for actuator in ("free", "limited"):
                arm.add_command(actuator, TARGET, **options)
            arm.pulse()
            arm.burst(190)
            desired = arm.history(200).desired
        times = (np.arange(200) - 9) / FREQUENCY
        place, speed = axes[:, column]
        place.axhline(TARGET, color="gray", linestyle=":", label="target")
        for joint, name in enumerate(("without limits", "with limits")):
            place.plot(times, desired[:, joint], color=f"C{joint}", label=name)
        speed.plot(times[1:], np.diff(desired[:, 1]) * FREQUENCY, color="C1")
        if "speed" in options:
            speed.axhline(options["speed"], color="gray", linestyle=":", label="asked")
            speed.legend(fontsize=8)
        speed.axhline(LIMITS.speed, color="C3", linestyle="--")
        if column == 0:
            speed.text(0.36, 1.88, "limit", color="C3", ha="right", va="top", fontsize=8)
        speed.set_ylim(-0.1, 2.2)
        place.set_title(title, fontsize=9, family="monospace" if options else None)
        speed.set_xlabel("time [s]")
    axes[0, 0].set_ylabel("desired position [rad]")
    axes[1, 0].set_ylabel("speed with limits [rad/s]")
    axes[0, 0].legend(fontsize=8, loc="center right")
    figure.savefig(path, dpi=80)


def streamed(actuator: str, sent: list[float], **options: Any) -> np.ndarray:
    """Returns desired positions during a stream of targets, and as long again after its end."""
    with o80.robots.load(Joints).inline(frequency=FREQUENCY) as arm:
        step = round(EVERY * FREQUENCY)
        for target in sent:
            arm.add_command(actuator, target, **options)
            arm.burst(step)
        arm.burst(step * len(sent))
        joint = Joints.actuators.index(actuator)
        return arm.history(2 * step * len(sent)).desired[:, joint].copy()


def draw_streaming(path: Path) -> None:
    """Draws a stream of set-points that stops, for an arm with narrow and with wide limits."""
    sent_at = np.arange(0.0, 0.6, EVERY)
    sent = [0.1 * (1.0 - np.cos(7.0 * time)) for time in sent_at]
    figure = Figure(figsize=(10, 4.6), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True, sharey="row")
    for column, (actuator, limits) in enumerate((("limited", LIMITS), ("fast", FAST))):
        place, speed = axes[:, column]
        place.step(sent_at, sent, color="gray", where="post", label="targets")
        for name, options in {"without every": {}, "every=0.02": {"every": EVERY}}.items():
            desired = streamed(actuator, sent, **options)
            times = np.arange(1, len(desired) + 1) / FREQUENCY
            color = "C0" if options else "C1"
            place.plot(times, desired, color=color, label=name)
            speed.plot(times[1:], np.diff(desired) * FREQUENCY, color=color, label=name)
        rates = f"{limits.speed:g} rad/s, {limits.acceleration:g} rad/s², {limits.jerk:g} rad/s³"
        place.set_title(f"limits {rates}", fontsize=9)
        speed.set_xlabel("time [s]")
    axes[0, 0].set_ylabel("desired position [rad]")
    axes[1, 0].set_ylabel("speed [rad/s]")
    axes[0, 0].legend(fontsize=8)
    figure.savefig(path, dpi=80)
