"""A training from its first decision to its last: updates, checkpoints, curve."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from stable_baselines3.common.callbacks import BaseCallback

import o80
from o80.base.lifecycle import Closeable

from ..players.learned_policy import LearnedPolicy
from . import checkpoint, curve
from .checkpoint import Progress
from .copies import Stopwatch
from .curve import CURVE, CurvePoint
from .episodes import EpisodeCounter
from .learner import (
    begin_anew,
    network_of,
    new_model,
    set_exploration,
    training_environments,
)
from .settings import LearningSettings
from .validation import Validation

POLICY = "policy.npz"
"""The file in the folder of a training."""

Told = Callable[[CurvePoint], None]


class Training(Closeable):
    """Learns in `output`, and resumes there if asked to. Close it."""

    def __init__(self, settings: LearningSettings, output: Path, *, resume: bool = False) -> None:
        self.settings, self.output = settings, output
        self._begun = Progress(0, 0, 0.0, 0.0)
        folder = checkpoint.found(output)
        if resume and folder is None:
            raise o80.InvalidArgument(f"{output} has no checkpoint to resume: leave out --resume")
        output.mkdir(parents=True, exist_ok=True)
        self._watch = Stopwatch()
        self._environments = training_environments(settings, self._watch)
        self._validation = Validation(settings.conditions, settings.evaluated)
        self.model = new_model(settings, self._environments)
        if resume and folder is not None:
            self._begun = checkpoint.load(folder, self.model, self._environments)
            curve.cut(output / CURVE, self._begun.decisions)
        else:
            (output / CURVE).unlink(missing_ok=True)
        self._counter = EpisodeCounter(settings.ppo.environments, episodes=self._begun.episodes)
        self._clock, self._processor = time.monotonic(), time.process_time()
        self._evaluating = 0.0
        self._restarts, self._network_begun = self._begun.restarts, self._begun.begun
        self._stuck = self._begun.stuck

    def close(self) -> None:
        """Ends the environments."""
        self._environments.close()
        self._validation.close()

    @property
    def progress(self) -> Progress:
        """How far it has come."""
        begun = self._begun
        return Progress(
            self.model.num_timesteps,
            self._counter.episodes,
            begun.minutes + (time.monotonic() - self._clock) / 60,
            begun.processor_minutes + (time.process_time() - self._processor) / 60,
            self._restarts,
            self._network_begun,
            self._stuck,
        )

    @property
    def policy(self) -> LearnedPolicy:
        """The deterministic policy, as it is now."""
        progress, settings = self.progress, self.settings
        return LearnedPolicy(
            network_of(self.model, self._environments, settings),
            settings.conditions,
            {
                "seed": settings.seed,
                "blind": settings.blind,
                "decisions": progress.decisions,
                "episodes": progress.episodes,
                "processor_minutes": round(progress.processor_minutes, 2),
                "restarts": progress.restarts,
            },
        )

    def run(self, told: Told = lambda point: None) -> LearnedPolicy:
        """Learns until the decisions or minutes of the settings are spent; returns the policy.

        `told` hears of every update. The checkpoint and the policy are saved also when an exception
        ends the training, such as KeyboardInterrupt.
        """
        left = self.settings.decisions - self.model.num_timesteps
        self._clock, self._processor = time.monotonic(), time.process_time()
        self._evaluating = self._watch.seconds = 0.0
        try:
            if left > 0:
                self.model.learn(left, callback=_Updates(self, told), reset_num_timesteps=False)
        finally:
            self.save()
        return self.policy

    @property
    def environment_share(self) -> float:
        """The environments' share of the processor time since the start or the last resumption,
        without evaluations; NaN if they were not stepped.
        """
        if self._watch.seconds <= 0:
            return math.nan
        spent = time.process_time() - self._processor - self._evaluating
        return self._watch.seconds / spent

    def judge(self) -> None:
        """Notes whether the network has got stuck."""
        self._stuck = self.settings.stuck(
            begun=self._network_begun,
            decisions=self.model.num_timesteps,
            touched=self._counter.shares.touched,
        )

    def replace_if_stuck(self) -> None:
        """Begins with a new network if this one has got stuck; decisions, normalisation and the
        learning rate go on.
        """
        if self._stuck:
            begin_anew(self.model)
            self._restarts += 1
            self._network_begun = self.model.num_timesteps
            self._stuck = False

    def save(self) -> None:
        """Writes checkpoint and policy."""
        checkpoint.save(self.output, self.model, self.progress)
        self.policy.save(self.output / POLICY)

    def point(self, *, evaluate: bool) -> CurvePoint:
        """The curve here, with an evaluation if asked for."""
        progress, shares = self.progress, self._counter.shares
        policy: Any = self.model.policy
        evaluated = {}
        if evaluate:
            network = network_of(self.model, self._environments, self.settings)
            begun = time.process_time()
            seen = self._validation.play(network.act)
            self._evaluating += time.process_time() - begun
            evaluated = {f"evaluated_{name}": value for name, value in seen._asdict().items()}
        return CurvePoint(
            progress.decisions,
            progress.episodes,
            progress.episodes,
            progress.minutes,
            progress.processor_minutes,
            *shares,
            float(policy.log_std.exp().mean().item()),
            progress.restarts,
            self.environment_share,
            **evaluated,
        )


class _Updates(BaseCallback):
    """Callback for all that is not learning: counting, the curve, checkpoints, the end in time."""

    def __init__(self, training: Training, told: Told) -> None:
        super().__init__()
        self._training, self._told = training, told
        every = training.settings.evaluate_every
        self._next = (training.model.num_timesteps // every + 1) * every

    def _on_step(self) -> bool:
        step = self.locals
        self._training._counter.step(step["rewards"], step["dones"], step["infos"])
        spent = self._training.progress.processor_minutes
        return spent < self._training.settings.minutes

    def _on_rollout_start(self) -> None:
        self._training.replace_if_stuck()  # after the last update of the old network
        set_exploration(self._training.model, self._training.settings)

    def _on_rollout_end(self) -> None:
        training = self._training
        settings = training.settings
        training.judge()
        evaluate = self.num_timesteps >= min(self._next, settings.decisions)
        point = training.point(evaluate=evaluate)
        curve.append(training.output / CURVE, point)
        if evaluate:
            self._next += settings.evaluate_every
            training.save()
        self._told(point)
