"""A Gymnasium vector environment of a task with any number of copies."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space, create_empty_array
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.base.lifecycle import Closeable
from o80.learning import episodes, halts, infos
from o80.learning.batches import checked_actions, put, rows
from o80.learning.environment import checked_render_mode
from o80.learning.generators import Generators, Seed
from o80.learning.group_task import GroupTask
from o80.learning.task import EVERY, Index, Task

Mask = NDArray[np.bool_]
Numbers = NDArray[np.intp]
StepResult = tuple[Any, NDArray[np.float64], Mask, Mask, infos.Info]

_NOBODY: Numbers = np.zeros(0, np.intp)


class VectorEnvironment(gymnasium.vector.VectorEnv[Any, Any, NDArray[Any]], Closeable):
    """All copies of a task as one vector environment.

    The results equal, bit for bit, those of Gymnasium's SyncVectorEnv with as many single
    `Environment`s in the same autoreset mode: copy i is seeded with seed + i, and all arrays are
    fresh. An exception in `step` leaves only some copies stepped: call `reset` before the next one.

    CopyFailed for halts that a reset may not end names the copies that then have no episode. All
    other copies are reset: they continue as soon as the named copies were reset.

    Closing the environment, or leaving its `with` block, closes the task.
    """

    def __init__(
        self,
        task: Task,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
    ) -> None:
        """autoreset_mode: when the next episode of a copy begins: NextStep, SameStep, Disabled.

        render_mode: one of `metadata["render_modes"]` of the task.
        """
        self.task = task
        self.num_envs = task.copies
        self.autoreset_mode = _checked_mode(autoreset_mode)
        self.metadata = dict(task.metadata) | {"autoreset_mode": self.autoreset_mode}
        self.render_mode = checked_render_mode(task, render_mode)
        self.single_observation_space = task.observation_space
        self.single_action_space = task.action_space
        self.observation_space = batch_space(task.observation_space, task.copies)
        self.action_space = batch_space(task.action_space, task.copies)

        self._everybody: Numbers = np.arange(task.copies)
        self._generators = Generators(task.copies)
        self._observations: Any = create_empty_array(task.observation_space, task.copies)
        self._final: Any = None  # observations before the resets of the last step, if it had any
        self._unbegun: Numbers = self._everybody  # copies that need a reset before they can step
        self._ended: Numbers = _NOBODY  # copies whose episode ended in the last step

    # ------------------------------------------------------------------ reset

    def reset(
        self, *, seed: Seed = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, infos.Info]:
        """Begins an episode of every copy, or of copies in `options["reset_mask"]` (copies,).

        seed: seed of copy 0, copy i gets seed + i; or one seed for each copy.
        """
        options = dict(options or {})
        copies = self._everybody
        if "reset_mask" in options:
            copies = np.flatnonzero(_checked_mask(options.pop("reset_mask"), self.num_envs))
        self._generators.seed(seed, copies)
        others = np.setdiff1d(self._unbegun, copies)
        self._unbegun, self._final = np.union1d(self._unbegun, copies), None
        self._ended = np.setdiff1d(self._ended, copies)
        info: infos.Info = {}
        self._begin(copies, options, info, others)
        return rows(self._observations, EVERY), info

    def _begin(
        self, copies: Numbers, options: dict[str, Any], info: infos.Info, unbegun: Numbers
    ) -> None:
        """Begins an episode of some copies; stores their observations and adds their info.

        unbegun: other copies without an episode. Raises CopyFailed for copies that stay halted.
        """
        failed = halts.resume(self.task.robots, copies, self.num_envs, self.task.resumes)
        if failed:
            refused = np.array([*failed.errors], np.intp)
            copies, unbegun = np.setdiff1d(copies, refused), np.union1d(unbegun, refused)
        if copies.size:
            begun = episodes.begin(self.task, copies, self._generators.of(copies), options)
            put(self._observations, copies, begun.observations)
            infos.add(info, begun.info, copies, self.num_envs)
        self._unbegun = unbegun
        if failed:
            raise failed

    # ------------------------------------------------------------------ step

    def step(self, actions: Any) -> StepResult:
        """Executes the actions (copies, ...), and resets copies by the autoreset mode."""
        actions = checked_actions(self.single_action_space, actions, self.num_envs)
        self._refuse_unless_ready()
        beginning, self._ended, self._final = self._ended, _NOBODY, None
        self._unbegun = self._everybody  # until the end of the step: it may raise
        info: infos.Info = {}
        if not beginning.size:
            stepped = episodes.step(self.task, actions, EVERY)
            self._observations = stepped.observations
            result = self._after(stepped, info)
        else:
            result = self._step_others(actions, beginning, info)
        self._unbegun = _NOBODY
        return result

    def _refuse_unless_ready(self) -> None:
        waiting = self._unbegun
        if self.autoreset_mode is AutoresetMode.DISABLED and not waiting.size:
            waiting = self._ended
        if waiting.size:
            raise ResetNeeded(
                f"{_named(waiting, self.num_envs)} without an episode: call reset() before step()"
                + ("" if waiting is self._unbegun else ", with options={'reset_mask': ...}")
            )

    def _after(self, stepped: episodes.Stepped, info: infos.Info) -> StepResult:
        """Returns the result of a step of all copies; begins new episodes in SAME_STEP mode."""
        if not stepped.judged.size:
            infos.add(info, stepped.info, EVERY, self.num_envs)
            return self._result(stepped, info)
        over = stepped.terminated | stepped.truncated
        self._ended = ended = over.nonzero()[0]
        if ended.size and self.autoreset_mode is AutoresetMode.SAME_STEP:
            self._add_finals(stepped, over, info)
            self._final, self._ended = stepped.observations, _NOBODY
            self._observations = rows(stepped.observations, EVERY)
            self._begin(ended, {}, info, _NOBODY)
        else:
            self._report(stepped, EVERY, info)
        return self._result(stepped, info)

    def _add_finals(self, stepped: episodes.Stepped, over: Mask, info: infos.Info) -> None:
        """Adds `final_obs` and `final_info` of ended copies, and the usual info of the others."""
        count = self.num_envs
        final_info: infos.Info = {}
        final_obs = np.full(count, None, object)
        for copy in over.nonzero()[0].tolist():
            final_obs[copy] = rows(stepped.observations, copy)
        infos.add_split(final_info, info, stepped.info, over)
        if stepped.judged_info:
            for chosen, where in ((over, final_info), (~over, info)):
                among = chosen[stepped.judged]
                if among.any():
                    judged = infos.some(stepped.judged_info, among)
                    infos.add(where, judged, stepped.judged[among], count)
        if stepped.halted.size:
            infos.add(final_info, stepped.halt_info, stepped.halted, count)
        info.update(final_obs=final_obs, _final_obs=over.copy())
        info.update(final_info=final_info, _final_info=over.copy())

    def _step_others(self, actions: Any, beginning: Numbers, info: infos.Info) -> StepResult:
        """Steps all copies except some, which begin an episode instead."""
        if isinstance(task := self.task, GroupTask) and task.joins:
            generators = self._generators.of(beginning)
            stepped = episodes.step_others(task, actions, beginning, generators)
            self._observations = stepped.observations
            return self._after(stepped, info)
        others = np.ones(self.num_envs, np.bool_)
        others[beginning] = False
        stepping = others.nonzero()[0]
        if stepping.size:
            stepped = episodes.step(self.task, rows(actions, stepping), stepping)
            put(self._observations, stepping, stepped.observations)
            self._report(stepped, stepping, info)
        else:
            stepped = episodes.no_step(self.task)
        self._ended = (stepped.terminated | stepped.truncated).nonzero()[0]
        self._begin(beginning, {}, info, _NOBODY)
        return self._result(stepped, info)

    def _report(self, stepped: episodes.Stepped, copies: Index, info: infos.Info) -> None:
        infos.add(info, stepped.info, copies, self.num_envs)
        if stepped.judged.size:
            infos.add(info, stepped.judged_info, stepped.judged, self.num_envs)
        if stepped.halted.size:
            infos.add(info, stepped.halt_info, stepped.halted, self.num_envs)

    def _result(self, stepped: episodes.Stepped, info: infos.Info) -> StepResult:
        observations = rows(self._observations, EVERY)
        return observations, stepped.rewards, stepped.terminated, stepped.truncated, info

    # ------------------------------------------------------------------ beside the episodes

    @property
    def final_observations(self) -> Any:
        """Returns observations (copies, ...) after the last step, before the resets in it; fresh.

        In SAME_STEP mode they include `infos["final_obs"]` of ended copies, as one array for all
        copies, to estimate the value of final states.
        """
        return rows(self._observations if self._final is None else self._final, EVERY)

    @property  # type: ignore[misc]
    def np_random(self) -> tuple[np.random.Generator, ...]:  # type: ignore[override]
        """The random generators of the copies."""
        return tuple(self._generators.of(self._everybody))

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seeds of the copies' random generators."""
        return tuple(self._generators.seeds_of(self._everybody))

    def render(self) -> tuple[Any, ...] | None:
        """Returns a picture of each copy, if a render mode was chosen."""
        if self.render_mode is None:
            gymnasium.logger.warn("no render mode was chosen: make it with render_mode=...")
            return None
        return tuple(self.task.render(copy) for copy in range(self.num_envs))

    def close_extras(self, **_: Any) -> None:
        """Closes the task."""
        self.task.close()


def _checked_mode(mode: AutoresetMode | str) -> AutoresetMode:
    try:
        return mode if isinstance(mode, AutoresetMode) else AutoresetMode(mode)
    except ValueError:
        words = ", ".join(f"'{each.value}'" for each in AutoresetMode)
        raise InvalidArgument(f"autoreset_mode must be one of {words}, got {mode!r}") from None


def _checked_mask(mask: Any, copies: int) -> Mask:
    """Returns the mask. Raises InvalidArgument unless it holds at least one of the copies."""
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (copies,):
        raise InvalidArgument(f"reset_mask must be an array of {copies} bools, got {mask!r}")
    if not mask.any():
        raise InvalidArgument("reset_mask must be true for at least one copy")
    return mask


def _named(copies: Numbers, count: int) -> str:
    if copies.size == count:
        return "all copies are"
    first = ", ".join(map(str, copies[:5].tolist())) + (", ..." if copies.size > 5 else "")
    return f"copy {first} is" if copies.size == 1 else f"copies {first} are"
