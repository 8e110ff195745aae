"""``o80 diff``: compares two recordings."""

from __future__ import annotations

import math
from typing import Annotated

import typer

from o80.base.errors import InvalidArgument
from o80.cli.histories import Named, histories
from o80.rows.history import History


def _tolerances(texts: list[str] | None) -> dict[str, float]:
    found = {}
    for text in texts or []:
        field, _, number = text.partition("=")
        try:
            found[field] = float(number)
        except ValueError:
            found[field] = math.nan
        if not found[field] >= 0:
            raise typer.BadParameter(
                f"write FIELD=NUMBER with a number of at least 0, for example "
                f"observed.elbow=1e-6, not '{text}'",
                param_hint="--tolerance",
            )
    return found


def diff(
    one: Annotated[str, typer.Argument(help="A recording (.mcap), or a segment.")],
    other: Annotated[str, typer.Argument(help="Another one.")],
    segment: Annotated[str | None, typer.Option(help="Compare only this segment.")] = None,
    ignore: Annotated[
        str, typer.Option(help="Columns to leave out, for example extended,observed.elbow")
    ] = "",
    tolerance: Annotated[
        list[str] | None,
        typer.Option(help="FIELD=NUMBER: differences up to this number count as equal."),
    ] = None,
) -> None:
    """Compare two recordings row by row, bit for bit; exit code 1 if they differ.

    Times and counts of late iterations are left out for robots that ran in real time.
    """
    from o80.joining.difference import first_difference

    tolerances = _tolerances(tolerance)
    left_out = [name for name in ignore.split(",") if name]
    pairs = _pairs(list(histories(one, segment)), list(histories(other, segment)))
    if not pairs:
        raise InvalidArgument(f"{one} and {other} hold no segment")
    different = False
    for name, mine, others in pairs:
        found = first_difference(mine, others, ignore=left_out, tolerances=tolerances)
        print(f"{name}: {found or f'{len(mine)} rows, identical'}")
        different = different or found is not None
    if different:
        raise typer.Exit(1)


def _pairs(ours: list[Named], theirs: list[Named]) -> list[tuple[str, History, History]]:
    """The same runs of the same segments; two single ones may have different names."""
    if len(ours) == len(theirs) == 1:
        return [(ours[0].name, ours[0].history, theirs[0].history)]
    there = {(each.name, each.number): each for each in theirs}
    lacking = {(each.name, each.number) for each in ours} ^ set(there)
    if lacking:
        names = ", ".join(f"{name} (run {number})" for name, number in sorted(lacking)[:5])
        raise InvalidArgument(f"only one of them has: {names}. Choose one with --segment")
    return [
        (
            each.name if each.number == 0 else f"{each.name}/{each.number}",
            each.history,
            there[each.name, each.number].history,
        )
        for each in ours
    ]
