"""One training of the comparison: motions, gradient steps, evaluations."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing

import numpy as np

from o80.base.arrays import Float32Array

from ...world.arm import MUSCLES
from ..validation import Validation
from .curves import Point
from .hindsight import transitions
from .learner import Learner
from .motions import Motions, Policy
from .settings import WAYS, VirtualSettings

BALL_SEED = 800_001
"""Seed of the shots of evaluations, which no training plays."""

Told = Callable[[Point], None]


def train(settings: VirtualSettings, told: Told = lambda point: None) -> list[Point]:
    """Learns from scratch; returns the curve. The same settings give the same one."""
    way, conditions = WAYS[settings.way], settings.conditions
    task = conditions.task(ball_seed=settings.seed)
    begin, points = time.process_time(), []
    with (
        closing(Validation(conditions, settings.evaluated, BALL_SEED)) as validation,
        Motions(1 + way.virtual_balls, rig=conditions.rig(), task=task) as motions,
    ):
        practice = _Practice(settings, motions)
        for motion in range(1, settings.motions + 1):
            practice.once(motion)
            if motion % settings.evaluate_every == 0:
                shares = validation.play(practice.learner.act)
                minutes = (time.process_time() - begin) / 60
                points.append(Point(motion, *shares, practice.seen, practice.steps, minutes))
                told(points[-1])
    return points


class _Practice:
    """Motion after motion, with what is learned from each."""

    def __init__(self, settings: VirtualSettings, motions: Motions) -> None:
        self._way, self._motions = WAYS[settings.way], motions
        self._generator = np.random.default_rng(settings.seed)
        random = _random(self._generator)
        self._first = [
            motions.play(random, self._generator) for _ in range(settings.random_motions)
        ]
        self.learner = Learner(settings.sac, self._first, seed=settings.seed)
        self.seen = self.steps = 0
        """Transitions that were kept; gradient steps."""

    def once(self, number: int) -> None:
        """Motion `number`, from 1."""
        random = number <= len(self._first)
        motion = (
            self._first[number - 1]
            if random
            else self._motions.play(self.learner.explore, self._generator)
        )
        new = transitions(motion, self._way.select(motion))
        self.learner.remember(new)
        self.seen += len(new.rewards)
        if not random:
            self.learner.learn(self._way.gradient_steps)
            self.steps += self._way.gradient_steps


def _random(generator: np.random.Generator) -> Policy:
    """Actions as before anything is learned."""

    def act(observation: Float32Array) -> Float32Array:
        return generator.uniform(-1.0, 1.0, MUSCLES).astype(np.float32)

    return act
