"""Draws histories: desired and observed together, sensor values, halts, ends of commands."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.base.extras import needed
from o80.base.words import CommandEnd, Status
from o80.rows.columns import Column, chosen, columns_of, is_within
from o80.rows.history import History, values_of
from o80.rows.journal import Decisions
from o80.rows.plans import Planned

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_PANELS = 24
PANEL = (9.0, 1.9)  # width and height [inch]
MAX_OF_MARK = 36  # characters that fit in a panel
MARK_WIDTH = 0.012  # width of the text of a mark, as a share of the axis
END_STYLES = {"COMPLETED": ("|", "tab:green"), "OVERWRITTEN": ("|", "tab:purple")}
STYLES = {"desired": "--", "observed": "-", "extended": "-"}


class Curve(NamedTuple):
    """One number of a robot over time."""

    robot: str
    panel: str  #: curves of one panel have this in common
    column: Column


def plot(
    histories: Mapping[str, History],
    fields: Sequence[str] = (),
    *,
    ends: Mapping[str, Sequence[CommandEnd]] | None = None,
    marks: Mapping[str, Sequence[tuple[str, int]]] | None = None,
    decided: Mapping[str, Decisions] | None = None,
    planned: Mapping[str, Mapping[str, Sequence[Planned]]] | None = None,
    origins: Mapping[str, int] | None = None,
    label: str = "time [s]",
    window: bool = False,
) -> "Figure":
    """Draws a figure with a panel for each number; desired and observed share one panel.

    histories: by name of robot.
    fields: such as "observed.elbow", "elbow" (desired and observed), "extended.force", "extended";
        empty: all states.
    ends, marks, decided, planned: by name of robot, as returned by `command_ends`, `marks_in`,
        `decisions` and `planned_by_chunks`. Robots without known decisions lack their panels.
    origins: row time [ns] at 0 of the axis, by name of robot, as returned by `origins` (None: the
        earliest row of all).
    label: of the time axis.
    window: makes a figure for `matplotlib.pyplot.show`.
    Raises InvalidArgument for an unknown field, MissingExtra without matplotlib.
    """
    needed("matplotlib", "plot", "a plot")
    curves = [
        curve for name, history in histories.items() for curve in _chosen(name, history, fields)
    ]
    panels = list(dict.fromkeys((curve.robot, curve.panel) for curve in curves))
    if not panels:
        raise InvalidArgument(
            "there is nothing to plot: the robot has no actuators. Name sensor values in fields, "
            "for example extended"
        )
    if len(panels) > MAX_PANELS:
        raise InvalidArgument(
            f"{len(panels)} panels are too many for a picture (at most {MAX_PANELS}): name fields"
        )
    late = {name: each for name, each in (decided or {}).items() if len(each.latency)}
    count = len(panels) + len(late)
    figure = _figure(count, window)
    axes = figure.subplots(count, sharex=True, squeeze=False)[:, 0]
    start = min(int(history.time[0]) for history in histories.values() if len(history))
    marked = []
    for ax, panel in zip(axes[: len(panels)], panels, strict=True):
        drawn = [curve for curve in curves if (curve.robot, curve.panel) == panel]
        history = histories[panel[0]]
        zero = start if origins is None else origins[panel[0]]
        times = np.asarray((history.time - zero) * 1e-9, np.float64)
        _draw(ax, drawn, history, times, several=len(histories) > 1)
        _draw_plans(ax, history, times, (planned or {}).get(panel[0], {}).get(panel[1], ()))
        _mark_ends(ax, panel[1], history, times, (ends or {}).get(panel[0], ()))
        marked.append((ax, history, times, (marks or {}).get(panel[0], ())))
        ax.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    for each in marked:
        _draw_marks(*each)
    for ax, (name, taken) in zip(axes[len(panels) :], late.items(), strict=True):
        zero = start if origins is None else origins[name]
        _draw_latency(ax, histories[name], taken, zero)
        ax.set_ylabel(
            f"{name}: decision\nlatency [ms]" if len(histories) > 1 else "decision\nlatency [ms]"
        )
    axes[-1].set_xlabel(label)
    return figure


def _figure(panels: int, window: bool) -> "Figure":
    size = (PANEL[0], 0.8 + PANEL[1] * panels)
    if window:
        from matplotlib import pyplot

        return pyplot.figure(figsize=size, layout="constrained")
    from matplotlib.figure import Figure

    return Figure(figsize=size, layout="constrained")


def _chosen(name: str, history: History, fields: Sequence[str]) -> Iterable[Curve]:
    columns = {column.name: column for column in columns_of(history.schema)}
    wanted = list(columns) if fields else [each for each in columns if _part(each) != "extended"]
    if fields:
        wanted = chosen(name, list(columns), fields)
    for each in wanted:
        panel = each if _part(each) == "extended" else each.partition(".")[2]
        yield Curve(name, panel, columns[each])


def _part(column: str) -> str:
    return column.partition(".")[0]


def _draw(
    ax: "Axes",
    curves: Sequence[Curve],
    history: History,
    times: NDArray[np.float64],
    *,
    several: bool,
) -> None:
    for curve in curves:
        part = _part(curve.column.name)
        color = {"desired": "tab:gray", "observed": "tab:blue"}.get(part, "tab:green")
        values = values_of(history, curve.column)
        ax.plot(times, values, STYLES[part], color=color, label=part, linewidth=1.2)
        if curve.column.labels:
            ax.set_yticks(list(curve.column.labels.values()), list(curve.column.labels))
    first = curves[0]
    title = f"{first.robot}: {first.panel}" if several else first.panel
    unit = first.column.unit
    ax.set_ylabel(f"{title}\n[{unit}]" if unit else title)
    ax.grid(alpha=0.3)
    edges = np.flatnonzero(np.diff(history.halted.astype(np.int8), prepend=0, append=0))
    for i, (begin, end) in enumerate(zip(edges[::2], edges[1::2], strict=True)):
        last, label = times[min(end, len(times) - 1)], "halted" if i == 0 else None
        ax.axvspan(times[begin], last, color="tab:red", alpha=0.15, label=label)
    late = np.flatnonzero(np.diff(history.overruns.astype(np.int64), prepend=history.overruns[:1]))
    if len(late):
        at, shares = np.full(len(late), 0.02), ax.get_xaxis_transform()
        ax.plot(times[late], at, "|", color="tab:orange", transform=shares, label="late iteration")


def _mark_ends(
    ax: "Axes",
    panel: str,
    history: History,
    times: NDArray[np.float64],
    ends: Sequence[CommandEnd],
) -> None:
    """Marks at the upper edge where commands of this actuator ended."""
    if not len(history):
        return
    iterations = history.iteration
    for status in Status:
        places = {
            int(np.searchsorted(iterations, end.iteration))
            for end in ends
            if end.status is status
            and iterations[0] <= end.iteration <= iterations[-1]
            and any(is_within(panel, name) for name in end.actuators)
        }
        if places:
            marker, color = END_STYLES.get(status.name, ("x", "tab:red"))
            at = np.full(len(places), 0.95)
            label = f"command {status.name.lower()}"
            where = times[sorted(places)]
            line = ax.plot(
                where, at, marker, color=color, transform=ax.get_xaxis_transform(), label=label
            )
            line[0].set(markersize=9 if marker == "|" else 6, markeredgewidth=2)


def _draw_plans(
    ax: "Axes", history: History, times: NDArray[np.float64], plans: Sequence[Planned]
) -> None:
    """Draws the plan of each chunk, also the part that a later chunk replaced."""
    iterations = history.iteration
    for i, (begins, places, _) in enumerate(plans):
        rows = np.arange(begins, begins + len(places))
        # behind the last row a plan is drawn by the period
        rows = rows[rows <= iterations[-1] + len(places)]
        at = np.interp(rows, iterations, times)
        if len(iterations) > 1:
            period = (times[-1] - times[0]) / (iterations[-1] - iterations[0])
            at += np.maximum(0, rows - iterations[-1]) * period
        label = "planned by chunks" if i == 0 else None
        ax.plot(at, places[: len(rows)], ":", color="tab:red", linewidth=1.0, label=label)


def _draw_marks(
    ax: "Axes",
    history: History,
    times: NDArray[np.float64],
    marks: Sequence[tuple[str, int]],
) -> None:
    """Draws lines with texts at marks of the recording; near marks share one text."""
    iterations = history.iteration
    labels: list[tuple[float, list[str]]] = []
    low, high = ax.get_xlim()
    for text, iteration in sorted(marks, key=lambda mark: mark[1]):
        if len(history) and iterations[0] <= iteration <= iterations[-1]:
            at = float(times[np.searchsorted(iterations, iteration)])
            ax.axvline(at, color="tab:olive", linewidth=1.0)
            short = text if len(text) <= MAX_OF_MARK else text[: MAX_OF_MARK - 1] + "\u2026"
            if labels and at - labels[-1][0] < MARK_WIDTH * (high - low):
                labels[-1][1].append(short)
            else:
                labels.append((at, [short]))
    place: dict[str, Any] = {"rotation": 90, "fontsize": 6, "va": "top", "ha": "right"}
    place |= {"transform": ax.get_xaxis_transform(), "clip_on": True}
    for at, texts in labels:  # a mark holds any text: none of it is a formula
        ax.text(at, 0.98, ", ".join(texts), parse_math=False, **place)


def _draw_latency(ax: "Axes", history: History, taken: Decisions, zero: int) -> None:
    """Draws a dot for each batch whose seen row and first iteration are in the history."""
    known = taken.since >= 0
    rows, first, since = history.iteration, taken.taken[known], taken.since[known]
    if len(rows):
        there = np.isin(first, rows) & np.isin(since, rows)
        begun = history.time[np.searchsorted(rows, first[there])]
        delay = begun - history.time[np.searchsorted(rows, since[there])]
        ax.plot((begun - zero) * 1e-9, delay * 1e-6, ".", color="tab:brown", markersize=3)
    ax.set_ylim(bottom=0.0)
    ax.grid(alpha=0.3)


APART = 10_000_000_000  # runs further apart have axes of their own [ns]


def origins(runs: Mapping[str, tuple[History, int | None]]) -> tuple[dict[str, int], int]:
    """Returns the row time [ns] at 0 of each run's axis, and the number of axes.

    runs: by name, a history and wall-clock minus row time [ns]; None: not known.

    Runs that overlap on the wall clock, or follow each other within ten seconds, share an axis,
    which begins with their first row. Other runs, and runs of unknown wall-clock time, begin at 0
    each.
    """
    known: list[tuple[int, int, int, str]] = []
    found: dict[str, int] = {}
    for name, (history, offset) in runs.items():
        if not len(history):
            found[name] = 0
        elif offset is None:
            found[name] = int(history.time[0])
        else:
            first, last = int(history.time[0]) + offset, int(history.time[-1]) + offset
            known.append((first, last, offset, name))
    axes = sum(1 for history, offset in runs.values() if offset is None and len(history))
    zero = end = None
    for first, last, offset, name in sorted(known):
        if zero is None or end is None or first > end + APART:
            zero, end = first, last
            axes += 1
        end = max(end, last)
        found[name] = zero - offset
    return found, axes
