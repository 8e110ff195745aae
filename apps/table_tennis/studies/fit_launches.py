"""Fits the launches of recorded shots: `python fit_launches.py SET [OTHER...]`.

The distribution is fitted to one half of the first set. Shots drawn from the distribution are
compared with the other half, and with the other sets, number by number.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from launch_fit import (
    LAUNCH,
    NAMES,
    fitted,
    halves,
    probability_of_same,
    recorded_numbers,
    simulated_numbers,
)
from o80_table_tennis.balls.launches import NormalLaunches
from o80_table_tennis.balls.recordings import load_trajectories
from o80_table_tennis.balls.simulated_shots import drawn_launch

DRAWN = 300
"""Number of compared simulated shots."""

app = typer.Typer(add_completion=False)


@app.command()
def main(
    sets: Annotated[list[Path], typer.Argument(help="recordings, or folders of them")],
) -> None:
    """Fits the distribution of the launches of the first set."""
    first, *others = [recorded_numbers(load_trajectories(path)) for path in sets]
    fit_on, test_on = halves(len(first))
    mean, covariance = fitted(first[fit_on][:, LAUNCH])
    factor = np.linalg.cholesky(covariance)
    print(f"fitted on {len(fit_on)} shots, position [m], velocity [m/s], spin [rad/s]:")
    print("mean  ", ", ".join(f"{value:.4f}" for value in mean))
    for number, row in enumerate(factor):
        print(
            "factor" if number == 0 else "      ", ", ".join(f"{v:.4f}" for v in row[: number + 1])
        )

    rng = np.random.default_rng(0)
    distribution = NormalLaunches(tuple(mean), tuple(map(tuple, factor)))
    drawn = simulated_numbers([drawn_launch(rng, distribution) for _ in range(DRAWN)])
    compared = {"other half": first[test_on]}
    compared |= {path.stem: rows for path, rows in zip(sets[1:], others, strict=True)}
    print("\nmean and standard deviation; p: probability of so large a difference by chance")
    print(f"{'':14} {'simulated':>16}", *(f"{name[:16]:>16}      p" for name in compared))
    for number, name in enumerate(NAMES):
        cells = [f"{drawn[:, number].mean():8.3f} {drawn[:, number].std():7.3f}"]
        for rows in compared.values():
            p = probability_of_same(rows[:, number], drawn[:, number])
            cells.append(f"{rows[:, number].mean():8.3f} {rows[:, number].std():7.3f}  {p:.3f}")
        print(f"{name:14}", *cells)


if __name__ == "__main__":
    app()
