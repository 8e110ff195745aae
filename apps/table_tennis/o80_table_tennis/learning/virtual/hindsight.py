"""From motions to transitions for an off-policy learner: those of which balls, and what is stored.

An action of a motion was chosen for the played ball. For another ball it is as good a sample of
what the arm can do: an off-policy learner may learn from it. This is what the paper named in this
package calls hindsight states.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import Float32Array

from .motions import Motion

Balls = NDArray[np.intp]
Selection = Callable[[Motion], Balls]
"""Which balls of a motion a learner learns from."""


@dataclass(frozen=True)
class Transitions:
    """K of them, in the order of the balls, and of the steps of each."""

    observations: Float32Array
    """(K, M)"""
    actions: Float32Array
    """(K, 8)"""
    rewards: Float32Array
    """(K,)"""
    next_observations: Float32Array
    """(K, M)"""
    terminated: NDArray[np.bool_]
    """(K,) an event ended the episode. One that was cut off goes on for the learner."""


def transitions(motion: Motion, balls: Balls) -> Transitions:
    """Transitions of the episodes of some balls of a motion."""
    steps = np.concatenate([np.arange(motion.lengths[ball]) for ball in balls])
    which = np.repeat(balls, motion.lengths[balls])
    last = steps == motion.lengths[which] - 1
    return Transitions(
        motion.observations[steps, which],
        motion.actions[steps],
        motion.rewards[steps, which],
        motion.observations[steps + 1, which],
        last & motion.terminated[which],
    )


def every_ball(motion: Motion) -> Balls:
    """The played ball and all virtual ones."""
    return np.arange(len(motion.lengths))


def best_balls(count: int) -> Selection:
    """The played ball, and the `count` virtual ones that were paid most.

    The reward of the task is ordered: these are the balls that were returned, then those that were
    touched, then those that the racket missed by least. Choosing them by their outcome does not
    bias the values that are learned as long as the outcome of an action is not random.
    """

    def select(motion: Motion) -> Balls:
        # stable: among equals, those that were drawn first
        virtual = 1 + np.argsort(-motion.paid[1:], kind="stable")[:count]
        return np.concatenate([[0], np.sort(virtual)])

    return select
