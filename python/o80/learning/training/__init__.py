"""Trains any task by one command, `python -m o80.learning`, or from Python.

with Training(TrainingSettings(Reach, decisions=200_000), "build/reach") as training:
    policy = training.run()

Training needs the extra `stable-baselines3`; playing a policy does not. See
docs/learning/training.md.
"""

from typing import TYPE_CHECKING, Any

from o80.base.extras import needed
from o80.learning.training.curve import CurvePoint
from o80.learning.training.evaluation import Evaluation, evaluate, wilson
from o80.learning.training.policy import LearnedPolicy
from o80.learning.training.settings import TrainingSettings
from o80.learning.training.tasks import NamedTask, make_vec

if TYPE_CHECKING:
    from o80.learning.training.session import Training


def __getattr__(name: str) -> Any:
    if name != "Training":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    needed("stable_baselines3", "stable-baselines3", "training")
    from o80.learning.training.session import Training

    return Training


__all__ = [
    "CurvePoint",
    "Evaluation",
    "LearnedPolicy",
    "NamedTask",
    "Training",
    "TrainingSettings",
    "evaluate",
    "make_vec",
    "wilson",
]
