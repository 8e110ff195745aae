"""An estimate of flying balls from noisy measurements: position, velocity and top spin.

After each measurement the estimate is the last one flown on for a step, by the laws of flight and
bounce, plus gain times what the measurement adds (`filter_gains`). Where a ball was not seen, its
estimate flies on alone. A velocity that no flight and no bounce explains (a racket has met the
ball) makes the filter begin anew. One ball and many get the same bits.
"""

from __future__ import annotations

from o80_mujoco.balls import BallFilter

from ..world.table import TABLE
from .aerodynamics import AERODYNAMICS
from .filter_gains import FilterSettings, gains
from .impact import platform


def ball_filter(settings: FilterSettings, count: int) -> BallFilter:
    """The filter of `count` balls."""
    table = gains(settings)
    return BallFilter(
        count=count,
        air=AERODYNAMICS.air,
        platform=platform(TABLE),
        before=table.before,
        after=table.after,
        step=settings.step,
        mean_spin=settings.mean_spin,
    )
