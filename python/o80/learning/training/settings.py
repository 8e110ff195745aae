"""Settings of a training: frozen values, which the checkpoint stores."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

from o80.base.argument_checks import number, whole
from o80.base.errors import InvalidArgument
from o80.learning.training.tasks import NamedTask

PPO: Mapping[str, float] = {
    "rollout": 2048,  # decisions of all copies between two updates; on the clock the least number
    "hidden": 64,  # units of each of two hidden layers, of the policy and of the value
    "log_std": -0.5,  # logarithm of the exploration in actions of [-1, 1] at the start
    "reward_scale": 1.0,  # factor of the rewards before learning: returns of 1 to 10 are best
    "last_rate": 0.05,  # share of the learning rate at the end, to which it falls linearly
    # names of Stable-Baselines3
    "batch_size": 512,
    "n_epochs": 5,
    "learning_rate": 1e-3,
    "gamma": 0.99,
    "gae_lambda": 0.95,
    "clip_range": 0.2,
    "ent_coef": 0.0,
    "vf_coef": 0.5,
    "max_grad_norm": 0.5,
}
"""Settings of PPO with their defaults."""


@dataclass(frozen=True)
class TrainingSettings:
    """Settings of a whole training. Raises InvalidArgument for wrong ones."""

    task: Any
    """A NamedTask, or anything that `make_vec` takes."""
    seed: int = 1
    copies: int = 32
    """Copies to step together. With one copy rollouts are whole episodes, and updates run between
    two episodes, as needed for a robot with a clock."""
    decisions: int = 1_000_000
    """Decisions of all copies after which the training ends."""
    ppo: Mapping[str, float] = field(default_factory=dict)
    """Values that replace those of `PPO`."""

    def __post_init__(self) -> None:
        for name, least in (("seed", 0), ("copies", 1), ("decisions", 1)):
            whole(getattr(self, name), name, least)
        for name, value in self.ppo.items():
            if name not in PPO:
                raise InvalidArgument(f"ppo has no '{name}': there are {', '.join(PPO)}")
            whole(value, name, 1) if isinstance(PPO[name], int) else number(value, name)
            if not (name == "log_std" or 0 <= value < math.inf):
                raise InvalidArgument(f"{name} must be a finite number of at least 0, got {value}")
        object.__setattr__(self, "ppo", {**PPO, **self.ppo})
        if not isinstance(self.task, NamedTask):
            object.__setattr__(self, "task", NamedTask(self.task))
        self.task.objects()  # raises an error before the training starts

    @property
    def on_the_clock(self) -> bool:
        """Whether rollouts are whole episodes."""
        return self.copies == 1

    @classmethod
    def of_json(cls, values: dict[str, Any]) -> "TrainingSettings":
        """Makes settings from `asdict` values. Raises TypeError for values of another version."""
        return cls(**{**values, "task": NamedTask(**values["task"])})

    @classmethod
    def of_file(cls, name: str) -> "TrainingSettings":
        """Reads FILE.json, or module:FILE.json of a package. Raises InvalidArgument if it fails."""
        package, _, file = name.rpartition(":")
        try:
            path = files(package) / file if package else Path(file)
            return cls.of_json(json.loads(path.read_text()))
        except (LookupError, TypeError, ValueError, OSError, ImportError) as error:
            raise InvalidArgument(f"{name}: not settings of a training: {error}") from error

    def refuse_unless_same(self, saved: "TrainingSettings", where: object) -> None:
        """Raises InvalidArgument with the names of settings that differ from a saved training.

        `decisions` may differ, to make a training longer.
        """
        ours, theirs = _flat(self), _flat(replace(saved, decisions=self.decisions))
        differ = [
            f"{name} ({theirs[name]!r}, not {value!r})"
            for name, value in ours.items()
            if value != theirs[name]
        ]
        if differ:
            raise InvalidArgument(
                f"{where} was trained with another {', '.join(differ)}: resume it without these, "
                "or train in another folder"
            )


def _flat(settings: TrainingSettings) -> dict[str, Any]:
    values = asdict(settings)
    return {**values.pop("task"), **values.pop("ppo"), **values}
