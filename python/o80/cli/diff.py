"""``o80 diff``: compares two recordings."""

import math
from typing import Annotated

import numpy as np
import typer

from o80.base.errors import InvalidArgument
from o80.cli.histories import Named, histories
from o80.rows.history import History

GAPS = 10  # gaps that are listed for each run


Ignore = Annotated[
    str, typer.Option(help="Columns to leave out, for example extended,observed.elbow")
]
Tolerance = Annotated[
    list[str] | None,
    typer.Option(help="FIELD=NUMBER: differences up to this number count as equal."),
]


def tolerances_of(texts: list[str] | None) -> dict[str, float]:
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
    ignore: Ignore = "",
    tolerance: Tolerance = None,
) -> None:
    """Compare two recordings row by row, bit for bit.

    Exit code 0: they are identical. 1: they differ. 2: no row differs, but one of them lacks rows
    or the end of a run, which are named.

    Times and counts of late iterations are left out for robots that ran in real time.
    """
    from o80.joining.difference import first_difference

    tolerances = tolerances_of(tolerance)
    left_out = [name for name in ignore.split(",") if name]
    pairs = _pairs(list(histories(one, segment)), list(histories(other, segment)))
    if not pairs:
        raise InvalidArgument(f"{one} and {other} have no segment: no robot ran meanwhile")
    is_different = is_missing = False
    for name, ours, theirs in pairs:
        mine, others = _comparable(ours, theirs), _comparable(theirs, ours)
        found = first_difference(mine, others, ignore=left_out, tolerances=tolerances)
        print(f"{name}: {found or f'{len(mine)} rows, identical'}")
        is_different = is_different or found is not None
        for source, named in ((one, ours), (other, theirs)):
            missing = [*filter(None, [named.interruption]), *named.gaps()]
            for each in missing[:GAPS]:
                print(f"  {source}: {each}")
            if len(missing) > GAPS:
                print(f"  {source}: and {len(missing) - GAPS} more gaps")
            is_missing = is_missing or bool(missing)
    if is_different:
        raise typer.Exit(1)
    if is_missing:
        raise typer.Exit(2)


def _comparable(one: Named, other: Named) -> History:
    """Returns the rows of `one`, without rows that `other` lacks because of a gap."""
    history = one.history
    iteration = history.iteration
    lacks = np.zeros(len(history), bool)
    for gap in other.gaps():
        lacks |= (iteration >= gap.first) & (gap.last is None or iteration <= gap.last)
    lacks &= ~np.isin(iteration, other.history.iteration)
    return History(history._decoder, history.rows[~lacks]) if lacks.any() else history


def _pairs(ours: list[Named], theirs: list[Named]) -> list[tuple[str, Named, Named]]:
    """Pairs the same runs of the same segments; two single runs may have different names."""
    if len(ours) == len(theirs) == 1:
        return [(ours[0].name, ours[0], theirs[0])]
    there = {(each.name, each.number): each for each in theirs}
    lacking = {(each.name, each.number) for each in ours} ^ set(there)
    if lacking:
        names = ", ".join(f"{name} (run {number})" for name, number in sorted(lacking)[:5])
        raise InvalidArgument(f"only one recording has {names}: choose one with --segment")
    return [(each.title, each, there[each.name, each.number]) for each in ours]
