"""Every budget, what is measured for it, and what it is measured against: the table rows.csv.

| column | what it is |
|---|---|
| name | for --rows |
| program, measured | of programs.py; the name of its sample |
| limit, of | a fixed limit, or a factor of a baseline `of` that the same program measures |
| plain | of USUAL: scales a fixed limit of time by what the plain loop takes here |
| at_least | yes: more is better |
| row, budget | the same in words |
"""

import csv
from dataclasses import dataclass
from pathlib import Path

Limit = float | tuple[float, str]
"""A fixed one, or a factor of a baseline that the same program measures."""

USUAL = {"plain_cpp": 12.0, "plain_python": 34.0}
"""Times of a plain loop on the machine for which fixed limits are meant [ns].

Found in proportion: on another machine, where the copies took 22 ns and the calls 63.5 ns, the
copies of whole histories (baseline of `history`) took 1.9 times as long, and so did `latest`.
"""


@dataclass(frozen=True, kw_only=True)
class Row:
    """One line of the table."""

    name: str
    row: str
    budget: str
    program: str
    measured: str
    limit: Limit
    plain: str | None = None
    at_least: bool = False


def read() -> tuple[Row, ...]:
    """The rows of the table."""
    rows = []
    with Path(__file__).with_suffix(".csv").open(newline="") as file:
        for line in csv.DictReader(file):
            factor, of = float(line.pop("limit")), line.pop("of")
            plain, at_least = line.pop("plain") or None, line.pop("at_least") == "yes"
            limit = (factor, of) if of else factor
            rows.append(Row(**line, limit=limit, plain=plain, at_least=at_least))
    return tuple(rows)


ROWS = read()
