"""Adapts a vector environment to Stable-Baselines3."""

import time
from collections.abc import Iterable, Sequence
from typing import Any, Literal

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from o80.base.errors import InvalidArgument
from o80.learning.batches import rows
from o80.learning.vector_environment import VectorEnvironment

Info = dict[str, Any]
Indices = int | Iterable[int] | None
WhichInfos = Literal["all", "ends"]


class StableBaselines3Env(VecEnv):
    """The copies of a vector environment in SAME_STEP mode, for the learners of Stable-Baselines3.

    It behaves like DummyVecEnv with single environments in a Monitor. The info of a copy whose
    episode has ended has `terminal_observation`, `TimeLimit.truncated`, and `episode`: sum of
    rewards `r`, number of steps `l` and time since the start `t` [s].
    """

    actions: Any

    def __init__(self, environments: VectorEnvironment, *, infos: WhichInfos = "all") -> None:
        """infos: "all" or "ends": the task's info in every step, or only for ended episodes."""
        if environments.autoreset_mode is not AutoresetMode.SAME_STEP:
            raise InvalidArgument(
                "Stable-Baselines3 begins the next episode in the step of an end, and this vector "
                f"environment has autoreset_mode '{environments.autoreset_mode.value}': make it "
                "with autoreset_mode='SameStep'"
            )
        if infos not in ("all", "ends"):
            raise InvalidArgument(f"infos must be 'all' or 'ends', got {infos!r}")
        self.environments = environments
        self._infos = infos
        self._rewards = np.zeros(environments.num_envs)
        self._lengths = np.zeros(environments.num_envs, np.int64)
        self._started_at = time.time()
        super().__init__(
            environments.num_envs,
            environments.single_observation_space,
            environments.single_action_space,
        )

    def reset(self) -> Any:
        """Begins an episode of every copy, with the seeds and options that were set before."""
        options = self._options[0]
        if any(each != options for each in self._options):
            raise InvalidArgument("all copies must have the same options")
        observations, infos = self.environments.reset(seed=self._seeds, options=options)
        self.reset_infos = [_of_copy(infos, copy) for copy in range(self.num_envs)]
        self._rewards[:], self._lengths[:] = 0.0, 0
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: Any) -> None:
        """Stores the actions for `step_wait`."""
        self.actions = actions

    def step_wait(self) -> tuple[Any, NDArray[np.float32], NDArray[np.bool_], list[Info]]:
        """Executes the actions."""
        stepped = self.environments.step(self.actions)
        observations, rewards, terminated, truncated, infos = stepped
        self._rewards += rewards
        self._lengths += 1
        over = terminated | truncated
        found: list[Info]
        if self._infos == "all":
            found = [_of_copy(infos, copy) for copy in range(self.num_envs)]
        else:
            found = [{} for _ in range(self.num_envs)]
        for info in found:
            info["TimeLimit.truncated"] = False
        for copy in np.flatnonzero(over).tolist():
            self.reset_infos[copy] = _of_copy(infos, copy)
            found[copy] = self._last_info(infos, copy)
            found[copy]["TimeLimit.truncated"] = bool(truncated[copy] and not terminated[copy])
        return observations, rewards.astype(np.float32), over, found

    def _last_info(self, infos: Info, copy: int) -> Info:
        """Returns the info of a copy after the end of its episode; resets its sums."""
        info = _of_copy(infos["final_info"], copy)
        info["terminal_observation"] = infos["final_obs"][copy]
        info["episode"] = {
            "r": round(float(self._rewards[copy]), 6),
            "l": int(self._lengths[copy]),
            "t": round(time.time() - self._started_at, 6),
        }
        self._rewards[copy], self._lengths[copy] = 0.0, 0
        return info

    def close(self) -> None:
        """Closes the vector environment."""
        self.environments.close()

    def get_images(self) -> Sequence[Any]:
        """Returns a picture of each copy."""
        return self.environments.render() or [None] * self.num_envs

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Returns an attribute of the vector environment or its task, once for each copy."""
        return [self._found(attr_name)] * self._count(indices)

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Sets an attribute of the task for all copies. Raises InvalidArgument for only some."""
        if self._count(indices) != self.num_envs:
            raise InvalidArgument(f"all copies share '{attr_name}': set it for all of them")
        setattr(self.environments.task, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Calls a method of the vector environment or its task once; returns a result per copy."""
        result = self._found(method_name)(*method_args, **method_kwargs)
        return [result] * self._count(indices)

    def env_is_wrapped(self, wrapper_class: Any, indices: Indices = None) -> list[bool]:
        """Returns whether it replaces this wrapper of single environments: True for Monitor."""
        from stable_baselines3.common.monitor import Monitor

        return [issubclass(Monitor, wrapper_class)] * self._count(indices)

    def _found(self, name: str) -> Any:
        there = self.environments if hasattr(self.environments, name) else self.environments.task
        return getattr(there, name)

    def _count(self, indices: Indices) -> int:
        return len(list(self._get_indices(indices)))


def _of_copy(infos: Info, copy: int) -> Info:
    """Returns the entries that a copy has."""
    return {
        name: _of_copy(value, copy) if isinstance(value, dict) else rows(value, copy)
        for name, value in infos.items()
        if not name.startswith("_") and name not in _FINAL and infos[f"_{name}"][copy]
    }


_FINAL = ("final_obs", "final_info")
