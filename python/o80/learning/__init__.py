"""Gymnasium environments over copies of a robot in this process: a task is written once.

class Reach(o80.learning.GroupTask): ...

environment = o80.learning.Environment(Reach(copies=1))
environments = o80.learning.VectorEnvironment(Reach(copies=16))

Needs the extra `gym`. See docs/learning.md.
"""

from typing import TYPE_CHECKING

from o80.base.extras import needed

needed("gymnasium", "gym", "o80.learning")

from o80.learning.environment import Environment  # noqa: E402
from o80.learning.group_task import GroupTask  # noqa: E402
from o80.learning.registration import register  # noqa: E402
from o80.learning.task import EVERY, Index, Outcome, Task  # noqa: E402
from o80.learning.vector_environment import VectorEnvironment  # noqa: E402

if TYPE_CHECKING:
    from o80.learning.stable_baselines3_env import StableBaselines3Env, WhichInfos


def stable_baselines3(
    environments: VectorEnvironment, *, infos: "WhichInfos" = "all"
) -> "StableBaselines3Env":
    """Makes a vector environment in SAME_STEP mode usable for learners of Stable-Baselines3.

    infos: "all" or "ends": include the task's info in every step, or only for ended episodes.

    Needs the extra `stable-baselines3`.
    """
    needed("stable_baselines3", "stable-baselines3", "o80.learning.stable_baselines3")
    from o80.learning.stable_baselines3_env import StableBaselines3Env

    return StableBaselines3Env(environments, infos=infos)


__all__ = [
    "EVERY",
    "Environment",
    "GroupTask",
    "Index",
    "Outcome",
    "Task",
    "VectorEnvironment",
    "register",
    "stable_baselines3",
]
