"""Whether a network has got stuck, so that the training continues with a new one.

Some networks learn early to return the balls that fly to one side, and never learn the others.
Longer training does not help them, see docs/results/learning.md. A low share of touched balls shows
this before half of the training is over.
"""

from __future__ import annotations

from .settings import LearningSettings


def stuck(settings: LearningSettings, *, begun: int, decisions: int, touched: float) -> bool:
    """Whether a network that began at the decision `begun` should be replaced now.

    A network is judged once, in the first update after `restart.after` decisions. It is kept if a
    new network could not be judged before the end of the training. A blind network is always kept,
    because it cannot touch so many balls.

    touched: share of the last balls, with exploration.
    """
    restart, ppo = settings.restart, settings.ppo
    age = decisions - begun
    update = ppo.steps * ppo.environments
    judged = restart.after <= age < restart.after + update
    left = settings.decisions - decisions
    enough_left = left >= restart.after
    return judged and enough_left and not settings.blind and touched < restart.touched
