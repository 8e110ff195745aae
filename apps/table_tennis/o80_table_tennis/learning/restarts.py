"""Whether a network has got stuck, so that the training continues with a new one.

Some networks learn early to return the balls of one side and then stay there: the way to the others
leads through worse returns. Longer training does not help them, see docs/learning.md. The share of
touched balls shows it before half of the training is over.
"""

from __future__ import annotations

from .settings import LearningSettings


def stuck(settings: LearningSettings, *, begun: int, decisions: int, touched: float) -> bool:
    """Whether a network that began at the decision `begun` should be replaced now.

    It is judged in one update only, the first after as many decisions as the settings say. It is
    kept if the training ends before a new one could be judged. A blind network is always kept, as
    it cannot touch so many balls.

    touched: share of the last balls, with exploration.
    """
    restart, ppo = settings.restart, settings.ppo
    age = decisions - begun
    update = ppo.steps * ppo.environments
    judged = restart.after <= age < restart.after + update
    left = settings.decisions - decisions
    enough_left = left >= restart.after
    return judged and enough_left and not settings.blind and touched < restart.touched
