"""Plots of episodes and of how well an experiment kept its time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from o80.base.arrays import FloatArray

from ..world.table import NET_HEIGHT, TABLE
from .episode_summary import EpisodeSummary
from .recorded_episodes import RecordedEpisode

RESOLUTION = 110
"""[dots per inch]"""
BALL, RACKET, TOUCH = "tab:orange", "tab:red", "tab:green"


def plot_motion(path: Path, episode: RecordedEpisode) -> None:
    """Joint angles and velocities, and the pressures of all muscles, over time."""
    figure = Figure(figsize=(10, 9), layout="constrained")
    angles, velocities, pressures = figure.subplots(3, 1, sharex=True)
    figure.suptitle(_title(episode, "motion of the arm"))
    times, motion = episode.times, episode.arm.extended

    for joint in range(motion.joint_positions.shape[1]):
        label, colour = f"joint {joint + 1}", f"C{joint}"
        angles.plot(times, motion.joint_positions[:, joint], color=colour, label=label)
        velocities.plot(times, motion.joint_velocities[:, joint], color=colour, label=label)
        for muscle, style, name in ((2 * joint, "-", "agonist"), (2 * joint + 1, "--", "antag.")):
            pressures.plot(
                times,
                episode.arm.observed[:, muscle] / 1000,
                style,
                color=colour,
                label=f"{name} {joint + 1}",
            )
    angles.set_ylabel("angle [rad]")
    velocities.set_ylabel("velocity [rad/s]")
    pressures.set_ylabel("pressure [1000 raw units]")
    pressures.set_xlabel("time since the first step [s]")
    touch = _touch_time(episode)
    for axes in (angles, velocities, pressures):
        axes.grid(alpha=0.3)
        if touch is not None:
            axes.axvline(touch, color=TOUCH, linewidth=1, label="touch")
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    figure.savefig(path, dpi=RESOLUTION)


def plot_paths(path: Path, episode: RecordedEpisode) -> None:
    """Ball and racket seen from the side and from above."""
    figure = Figure(figsize=(10, 7.5), layout="constrained")
    side, above = figure.subplots(2, 1)
    figure.suptitle(_title(episode, "paths of ball and racket"))
    _draw_paths(side, episode, vertical=2)
    _draw_paths(above, episode, vertical=0)

    near, far = _edges(1)
    side.add_patch(
        Rectangle((near, TABLE.top - TABLE.size[2]), far - near, TABLE.size[2], color="tab:blue")
    )
    side.plot(
        [TABLE.centre[1]] * 2, [TABLE.top, TABLE.top + NET_HEIGHT], color="black", label="net"
    )
    left, right = _edges(0)
    above.add_patch(
        Rectangle((near, left), far - near, right - left, facecolor="tab:blue", alpha=0.3)
    )
    above.plot([TABLE.centre[1]] * 2, [left, right], color="black", label="net")
    side.set_ylabel("z, up [m]")
    above.set_ylabel("x, across [m]")
    above.set_xlabel("y, towards the opponent [m]")
    along = (
        min(side.get_xlim()[0], above.get_xlim()[0]),
        max(side.get_xlim()[1], above.get_xlim()[1]),
    )
    for axes in (side, above):
        axes.set_xlim(along)
        axes.set_aspect("equal")
        axes.grid(alpha=0.3)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    figure.savefig(path, dpi=RESOLUTION)


def plot_jitter(path: Path, lateness: FloatArray, periods: FloatArray, *, period: float) -> None:
    """How late the iterations of the arm began, and how long they lasted; all in [us]."""
    figure = Figure(figsize=(10, 4), layout="constrained")
    late, long = figure.subplots(1, 2)
    figure.suptitle(f"the arm in real time: {len(lateness)} iterations")
    _histogram(late, lateness, "beginning after its due time [us]")
    _histogram(long, periods - period, f"period less {period:.0f} us [us]")
    late.set_ylabel("iterations")
    figure.savefig(path, dpi=RESOLUTION)


def plot_overview(
    path: Path, episodes: Mapping[str, Sequence[EpisodeSummary]], rates: Mapping[str, float]
) -> None:
    """Rewards and returns of the episodes of each mode, and how many steps a second it reached."""
    figure = Figure(figsize=(10, 4.5), layout="constrained")
    rewards, speed = figure.subplots(1, 2, width_ratios=(3, 2))
    figure.suptitle("episodes of each mode")
    for row, (mode, played) in enumerate(episodes.items()):
        returned = sum(episode.returned for episode in played)
        values = np.array([episode.reward for episode in played])
        back = np.array([episode.returned for episode in played], dtype=bool)
        numbers = np.arange(len(played)) + 0.2 * row
        label = f"{mode}: {returned} of {len(played)} returned"
        rewards.plot(numbers[~back], values[~back], "x", color=f"C{row}")
        rewards.plot(numbers[back], values[back], "o", markersize=5, color=f"C{row}", label=label)
    rewards.set_xlabel("episode (o: returned, x: not)")
    rewards.set_ylabel("reward")
    rewards.xaxis.set_major_locator(MaxNLocator(integer=True))
    rewards.grid(alpha=0.3)
    rewards.legend(fontsize=8)

    bars = speed.barh(list(rates), list(rates.values()), color=[f"C{i}" for i in range(len(rates))])
    speed.bar_label(bars, fmt="%.0f", padding=3)
    speed.set_xscale("log")
    speed.set_xlim(min(rates.values()) / 10, max(rates.values()) * 5)
    speed.set_xlabel("steps a second, policy included [1/s]")
    speed.invert_yaxis()
    figure.savefig(path, dpi=RESOLUTION)


def _draw_paths(axes: Axes, episode: RecordedEpisode, *, vertical: int) -> None:
    ball, racket = episode.balls[:, 0], episode.arm.extended.racket_position
    axes.plot(ball[:, 1], ball[:, vertical], ".-", markersize=2, color=BALL, label="ball")
    axes.plot(ball[0, 1], ball[0, vertical], "o", color=BALL, label="first row")
    axes.plot(racket[:, 1], racket[:, vertical], color=RACKET, label="racket centre")
    touch = _touch_row(episode)
    if touch is not None:
        place = ball[touch, 1], ball[touch, vertical]
        axes.plot(*place, "*", markersize=12, color=TOUCH, label="touch")


def _touch_row(episode: RecordedEpisode) -> int | None:
    """The row in which the racket met the ball: the largest change of its velocity to the front."""
    if not episode.summary.touched:
        return None
    velocities = episode.twin.observed.balls["velocity"]
    return int(np.argmax(np.diff(velocities[:, 0, 1]))) + 1


def _touch_time(episode: RecordedEpisode) -> float | None:
    row = _touch_row(episode)
    return None if row is None else float(episode.times[row])


def _histogram(axes: Axes, values: FloatArray, label: str) -> None:
    low, high = np.percentile(values, [0.1, 99.9])
    axes.hist(np.clip(values, low, high), bins=60, log=True, color="tab:blue")
    axes.set_title("beyond 0.1 % and 99.9 %: in the outermost bars", fontsize=8)
    for percentile, colour in ((50, "tab:green"), (99, "tab:red")):
        value = float(np.percentile(values, percentile))
        axes.axvline(value, color=colour, label=f"{percentile} %: {value:.1f} us")
    axes.set_xlabel(label)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, title=f"largest: {values.max():.0f} us")


def _edges(axis: int) -> tuple[float, float]:
    half = TABLE.size[axis] / 2
    return TABLE.centre[axis] - half, TABLE.centre[axis] + half


def _title(episode: RecordedEpisode, what: str) -> str:
    summary = episode.summary
    return f"{what}: episode {summary.number}, {summary.end}, reward {summary.reward:.2f}"
