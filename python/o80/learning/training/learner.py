"""PPO of Stable-Baselines3 for any task, with its whole state as a checkpoint file."""

import json
import os
import pickle
import random
import warnings
from collections.abc import Callable
from copy import deepcopy
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.vec_env import VecNormalize

from o80.base.errors import InvalidArgument
from o80.base.finite import json_text
from o80.learning.rollouts import GaussianPolicy, Rollout
from o80.learning.rollouts.ppo import CollectorEnv, RolloutPPO
from o80.learning.rollouts.sb3_policy import gaussian_policy
from o80.learning.training.collectors import RepeatableCollector
from o80.learning.training.settings import TrainingSettings

CHECKPOINT = "checkpoint.pt"
"""Checkpoint file in the folder of a training: numbers, texts and tensors."""
_FORMAT = 1
_OURS = ("rollout", "hidden", "log_std", "reward_scale", "last_rate", "learning_rate")


class Learner(RolloutPPO):
    """PPO that learns from the rollouts of a collector, whatever the collector's iteration."""

    reward_scale = 1.0
    """Factor of the rewards before learning."""
    on_rollout: Callable[[Rollout], None]
    """Called with each rollout."""

    def _collected(self, steps: int) -> Rollout:
        rollout = self._collector.collect(self.network(), steps=steps)
        self.on_rollout(rollout)
        return replace(rollout, rewards=self.reward_scale * rollout.rewards)

    def network(self) -> GaussianPolicy:
        """Returns the current policy."""
        return gaussian_policy(self.policy, self._vec_normalize_env)

    def state(self) -> dict[str, Any]:
        """Copies all state that decides the further training: numbers, texts and tensors."""
        numpy_state: Any = np.random.get_state()  # noqa: NPY002 - PPO draws its batches from it
        statistics: Any = self._vec_normalize_env.obs_rms  # type: ignore[union-attr]
        return {
            "decisions": self.num_timesteps,
            "weights": deepcopy(self.policy.state_dict()),
            "optimiser": deepcopy(self.policy.optimizer.state_dict()),
            "mean": torch.tensor(statistics.mean),
            "variance": torch.tensor(statistics.var),
            "count": float(statistics.count),
            "torch": torch.get_rng_state(),
            "numpy": [numpy_state[0], numpy_state[1].tolist(), *numpy_state[2:]],
            "python": random.getstate(),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """Restores a state of this learner and of the random generators of this process."""
        self.num_timesteps = state["decisions"]
        self.policy.load_state_dict(state["weights"])
        self.policy.optimizer.load_state_dict(state["optimiser"])
        statistics: Any = self._vec_normalize_env.obs_rms  # type: ignore[union-attr]
        statistics.mean, statistics.var = state["mean"].numpy(), state["variance"].numpy()
        statistics.count = state["count"]
        torch.set_rng_state(state["torch"])
        name, words, *others = state["numpy"]
        np.random.set_state((name, np.array(words, np.uint32), *others))  # noqa: NPY002
        random.setstate(state["python"])


def new_learner(settings: TrainingSettings, collector: RepeatableCollector) -> Learner:
    """Makes an untrained learner; equal seeds make equal learners."""
    ppo = settings.ppo
    first, last = ppo["learning_rate"], ppo["last_rate"]
    theirs: Any = {name: value for name, value in ppo.items() if name not in _OURS}
    with warnings.catch_warnings():  # the last batch of an update may be smaller
        warnings.filterwarnings("ignore", "You have specified a mini-batch size")
        learner = Learner(
            "MlpPolicy",
            VecNormalize(CollectorEnv(collector), norm_reward=False),
            n_steps=max(1, int(ppo["rollout"]) // settings.copies),
            learning_rate=lambda left: first * (last + (1.0 - last) * max(float(left), 0.0)),
            policy_kwargs={
                "net_arch": [int(ppo["hidden"])] * 2,
                "log_std_init": ppo["log_std"],
                "activation_fn": torch.nn.Tanh,
            },
            seed=settings.seed,
            device="cpu",
            **theirs,
        )
    learner.reward_scale = ppo["reward_scale"]
    return learner


def save(folder: Path, settings: TrainingSettings, state: dict[str, Any]) -> None:
    """Replaces the checkpoint: a kill leaves the old or the new one."""
    new = folder / f"{CHECKPOINT}.new"
    held = {"format": _FORMAT, "settings": json_text(asdict(settings)), "state": state}
    with new.open("wb") as file:
        torch.save(held, file)
        file.flush()
        os.fsync(file.fileno())
    os.replace(new, folder / CHECKPOINT)


def load(folder: Path) -> tuple[TrainingSettings, dict[str, Any]]:
    """Reads a checkpoint without running its code. Raises InvalidArgument if it is unusable."""
    path = folder / CHECKPOINT
    if not path.is_file():
        raise InvalidArgument(f"{folder} has no checkpoint of a training ({CHECKPOINT})")
    try:
        held = torch.load(path, weights_only=True)
        if held["format"] != _FORMAT:
            raise ValueError(f"format {held['format']} is not {_FORMAT}")
        return TrainingSettings.of_json(json.loads(held["settings"])), held["state"]
    except InvalidArgument:
        raise  # about the settings: a rule that cannot be imported
    except (pickle.UnpicklingError, RuntimeError, LookupError, TypeError, ValueError) as error:
        text = str(error).partition("\n")[0]
        raise InvalidArgument(f"{path}: not a checkpoint of this version: {text}") from error
