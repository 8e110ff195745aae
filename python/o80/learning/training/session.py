"""A whole training: updates, checkpoints, curve and policy."""

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
from gymnasium.vector import AutoresetMode, VectorEnv
from stable_baselines3.common.callbacks import BaseCallback

from o80.base.errors import Closed, InvalidArgument
from o80.base.lifecycle import Closeable
from o80.learning.training import curve, learner
from o80.learning.training.collectors import EpisodeCollector, RepeatableCollector, Scaled
from o80.learning.training.curve import CURVE, CurvePoint, EpisodeWindow
from o80.learning.training.policy import POLICY, LearnedPolicy
from o80.learning.training.settings import TrainingSettings

RENEWED = 50
"""Updates after which the environments restart: a resumed training repeats at most this number
of rollouts, to reach the state in which it was interrupted."""
SAVED = 30.0
"""Time between two checkpoints [s]."""


class Training(Closeable):
    """Trains a policy in a folder, or resumes a training there. Close it.

    An interrupted and resumed training has, bit for bit, the result of an uninterrupted one, if the
    environments depend only on their seeds. torch runs on one thread meanwhile.
    """

    def __init__(
        self,
        settings: TrainingSettings | None,
        folder: str | os.PathLike[str],
        *,
        resume: bool = False,
    ) -> None:
        """settings: None for the settings of the training in the folder.

        Raises InvalidArgument, before anything is written, if the folder has none to resume or one
        with other settings, or holds one although `settings` are given and `resume` is false.
        """
        self.folder = Path(folder)
        saved: dict[str, Any] | None = None
        if resume or settings is None:
            theirs, saved = learner.load(self.folder)
            settings = settings or theirs
            settings.refuse_unless_same(theirs, self.folder)
        elif (self.folder / learner.CHECKPOINT).exists():
            raise InvalidArgument(
                f"{self.folder} holds a training: `python -m o80.learning resume {self.folder}`, "
                "or train in another folder"
            )
        self.settings = settings
        self._ran = False
        self._clock = time.monotonic()
        kind = EpisodeCollector if settings.on_the_clock else RepeatableCollector
        self.collector: RepeatableCollector = kind(
            self._made,
            seed=settings.seed,
            iteration=saved["begun"] if saved else 0,
            infos=[settings.task.success],
        )
        try:
            self._begin(saved)
        except BaseException:
            self.collector.close()
            raise

    def _made(self) -> VectorEnv[Any, Any, Any]:
        on_the_clock, copies = self.settings.on_the_clock, self.settings.copies
        mode = AutoresetMode.DISABLED if on_the_clock else AutoresetMode.SAME_STEP
        environments = self.settings.task.make_vec(copies, mode)
        self._space: Any = environments.single_action_space
        return Scaled(environments)

    def _begin(self, saved: dict[str, Any] | None) -> None:
        self.learner = learner.new_learner(self.settings, self.collector)
        self.learner.on_rollout = self._count
        self.window, self._spent = EpisodeWindow(), {"play": 0.0, "reset": 0.0, "clock": 0.0}
        if saved:
            self.collector.repeat([actions.numpy() for actions in saved["played"]])
            self.learner.restore(saved["learner"])
            self.window = EpisodeWindow(saved["episodes"], saved["window"].numpy())
            self._spent = saved["spent"]
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InvalidArgument(
                f"{self.folder} cannot be written: {error.strerror}. Give another folder"
            ) from None
        curve.cut(self.folder / CURVE, CurvePoint, self.learner.num_timesteps)
        self._keep()
        self.save()

    def _count(self, rollout: Any) -> None:
        self.window.add(rollout.ends, self.settings.task.success)

    def close(self) -> None:
        """Closes the environments; may be called twice."""
        self.collector.close()

    def run(self, report: Callable[[CurvePoint], object] = lambda point: None) -> LearnedPolicy:
        """Learns until the decisions of the settings are made; returns the policy.

        report: called before each update. If an exception such as KeyboardInterrupt ends the
        training, checkpoint and policy are saved as they were before the unfinished rollout.
        """
        if self._ran:
            raise Closed("this training has ended: resume its folder with a new Training")
        self._ran = True
        threads = torch.get_num_threads()
        torch.set_num_threads(1)  # small networks: more threads wait for each other
        try:
            left = self.settings.decisions - self.learner.num_timesteps
            if left > 0:
                updates = _Updates(self, report)
                self.learner.learn(left, updates, reset_num_timesteps=False)
            self._keep()
        finally:
            torch.set_num_threads(threads)
            self.save()
        return self.policy

    def save(self) -> None:
        """Writes checkpoint and policy, as they were between the last two updates."""
        learner.save(self.folder, self.settings, self._state)
        self.policy.save(self.folder / POLICY)
        self._saved_at = time.monotonic()

    def point(self) -> CurvePoint:
        """Returns the current point of the learning curve."""
        policy: Any = self.learner.policy
        spent = self._spent_now()
        return CurvePoint(
            self.learner.num_timesteps,
            self.window.episodes,
            spent["play"] / 3600,
            spent["reset"] / 3600,
            spent["clock"] / 60,
            *self.window.means(),
            float(policy.log_std.exp().mean().item()),
        )

    def before_rollout(self) -> None:
        """Restarts the environments after `RENEWED` updates, and saves periodically."""
        renewed = len(self.collector.played) >= RENEWED
        if renewed:
            self.collector.restart(self.collector.iteration)
        self._keep()
        if renewed or self.settings.on_the_clock or time.monotonic() > self._saved_at + SAVED:
            self.save()

    def _keep(self) -> None:
        """Copies state and policy between two updates, for the next save."""
        window, collector = self.window, self.collector
        self._state = {
            "learner": self.learner.state(),
            "begun": collector.begun,
            "played": [torch.tensor(actions) for actions in collector.played],
            "episodes": window.episodes,
            "window": torch.tensor(window.rows),
            "spent": self._spent_now(),
        }
        training = {
            "seed": self.settings.seed,
            "copies": self.settings.copies,
            "decisions": self.learner.num_timesteps,
            "episodes": window.episodes,
        }
        task = self.settings.task
        self.policy = LearnedPolicy(self.learner.network(), self._space, task, training)
        """The policy without exploration, after the last update."""

    def _spent_now(self) -> dict[str, float]:
        """Returns the times so far [s]."""
        collector, reset = self.collector, self.collector.resetting
        now = {
            "play": collector.seconds - reset,
            "reset": reset,
            "clock": time.monotonic() - self._clock,
        }
        return {name: self._spent[name] + seconds for name, seconds in now.items()}


class _Updates(BaseCallback):
    """Connects the updates of PPO to a training: report, curve and saving."""

    def __init__(self, training: Training, report: Callable[[CurvePoint], object]) -> None:
        super().__init__()
        self._training, self._report = training, report

    def _on_rollout_start(self) -> None:
        self._training.before_rollout()

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        point = self._training.point()
        curve.append(self._training.folder / CURVE, point)
        self._report(point)
