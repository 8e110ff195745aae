"""Fits lift and grip to recorded bounces: `python fit_bounces.py SET...`.

Each set is a recording or a folder of recordings. The printed table compares predictions of the
velocity along the table after each bounce: without spin, with the application's constants, and
with constants fitted to the other sets.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from bounce_fit import Law, RecordedBounce, errors, fitted
from o80.base.arrays import FloatArray
from o80_table_tennis.balls.recordings import load_trajectories
from o80_table_tennis.balls.trajectories import BallTrajectory
from o80_table_tennis.physics.aerodynamics import AERODYNAMICS
from o80_table_tennis.world.table import TABLE

SPINLESS = Law(
    air=replace(AERODYNAMICS, lift_coefficient=1e9, lift_saturation=0.0),
    table=replace(TABLE, tangential_restitution=0.70),
)
"""Law without spin: every ball keeps 0.70 of its horizontal velocity, as in earlier
twins."""


@dataclass(frozen=True, eq=False)
class BounceSet:
    """Bounces of one recording."""

    name: str
    shots: int
    bounces: list[RecordedBounce]


def bounce_set(name: str, shots: Sequence[BallTrajectory]) -> BounceSet:
    """Collects the first bounce of each shot with one."""
    found = [RecordedBounce.of(shot.fit, shot.stamps) for shot in shots]
    return BounceSet(name, len(shots), [bounce for bounce in found if bounce is not None])


def rms(values: FloatArray) -> float:
    """Computes the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


app = typer.Typer(add_completion=False)


@app.command()
def main(
    sets: Annotated[list[Path], typer.Argument(help="recordings, or folders of them")],
) -> None:
    """Fits lift and grip to recorded bounces."""
    read = [bounce_set(path.stem, load_trajectories(path)) for path in sets]
    bounces = [bounce for each in read for bounce in each.bounces]
    if not bounces:
        raise SystemExit("no bounce in these recordings: give some that bounce on the table")
    lift, saturation, grip = fitted(bounces).tolist()
    print(f"lift {lift:.2f}, saturation {saturation:.2f}, grip {grip:.3f}, fitted to all\n")

    print(f"{'':20} shots bounces  kept  spin  RMS of the velocity along the table [m/s]")
    print(f"{'':20} {'':13}      [rad/s] no spin  constants  left out")
    for each in read:
        if not each.bounces:
            print(f"{each.name:20} {each.shots:5} {0:7}")
            continue
        others = [bounce for other in read if other is not each for bounce in other.bounces]
        without = f"{rms(errors(Law.of(fitted(others)), each.bounces)):8.3f}" if others else ""
        kept = np.median([bounce.after[1] / bounce.before[1] for bounce in each.bounces])
        spin = np.median([Law().spin(bounce)[0] for bounce in each.bounces])
        print(
            f"{each.name:20} {each.shots:5} {len(each.bounces):7} {kept:5.2f} {spin:5.0f} "
            f"{rms(errors(SPINLESS, each.bounces)):8.3f} {rms(errors(Law(), each.bounces)):10.3f} "
            f"{without:>9}"
        )


if __name__ == "__main__":
    app()
