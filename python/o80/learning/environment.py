"""A Gymnasium environment of a task with one copy."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded

from o80.base.errors import InvalidArgument
from o80.learning import episodes, halts, infos
from o80.learning.batches import batch_of_one, rows
from o80.learning.task import EVERY, Task

_ONLY = np.zeros(1, np.intp)


class Environment(gymnasium.Env[Any, Any]):
    """The environment of a task with one copy.

    Closing the environment, or leaving its `with` block, closes the task.
    """

    def __init__(self, task: Task, *, render_mode: str | None = None) -> None:
        """render_mode: one of `metadata["render_modes"]` of the task."""
        if task.copies != 1:
            raise InvalidArgument(
                f"an Environment has one copy, and the task has {task.copies}: make a "
                "VectorEnvironment, or a task with copies=1"
            )
        self.task = task
        self.metadata = dict(task.metadata)
        self.render_mode = checked_render_mode(task, render_mode)
        self.observation_space = task.observation_space
        self.action_space = task.action_space
        self._ready = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, infos.Info]:
        """Begins an episode. Raises CopyFailed if the robot is halted and may not be resumed."""
        super().reset(seed=seed)
        self._ready = False
        if failed := halts.resume(self.task.robots, _ONLY, 1, self.task.resumes):
            raise failed
        begun = episodes.begin(self.task, _ONLY, [self.np_random], options)
        self._ready = True
        return rows(begun.observations, 0), infos.of_one(begun.info)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, infos.Info]:
        """Executes an action; returns observation, reward, terminated, truncated and info."""
        if not self._ready:
            raise ResetNeeded("no episode runs: call reset() before step()")
        actions = batch_of_one(self.action_space, action)
        self._ready = False
        stepped = episodes.step(self.task, actions, EVERY)
        info = infos.of_one(stepped.info)
        if stepped.judged_info:
            info |= infos.of_one(stepped.judged_info)
        if stepped.halted.size:
            info |= infos.of_one(stepped.halt_info)
        terminated, truncated = bool(stepped.terminated[0]), bool(stepped.truncated[0])
        self._ready = not (terminated or truncated)
        observation = rows(stepped.observations, 0)
        return observation, float(stepped.rewards[0]), terminated, truncated, info

    def render(self) -> Any:
        """Returns a picture, if a render mode was chosen."""
        if self.render_mode is None:
            gymnasium.logger.warn("no render mode was chosen: make it with render_mode=...")
            return None
        return self.task.render(0)

    def close(self) -> None:
        """Closes the task; may be called twice."""
        self.task.close()


def checked_render_mode(task: Task, render_mode: str | None) -> str | None:
    """Returns the mode. Raises InvalidArgument unless it is None or a mode of the task."""
    modes = task.metadata.get("render_modes", [])
    if render_mode is not None and render_mode not in modes:
        raise InvalidArgument(
            f"render_mode must be None or one of the task's "
            f"({', '.join(modes) or 'it has none'}), got {render_mode!r}"
        )
    return render_mode
