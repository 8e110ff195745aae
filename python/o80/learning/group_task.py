"""A task on one inline group."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import Space
from numpy.typing import NDArray

from o80.base.arrays import Image
from o80.base.errors import CopyFailed
from o80.groups.gather import Gather
from o80.groups.group_burst import GroupBurst, GroupRequest
from o80.groups.inline_group import InlineGroup
from o80.learning.task import EVERY, Index, Task

if TYPE_CHECKING:
    from o80.view.pictures import Pictures  # needs the extra `record`


class GroupTask(Task):
    """A task on one inline group: a step sends targets and runs a burst.

    A derived class defines `begin` and `judge`; `targets` turns actions into targets. Observations
    are the numbers that `seen` gathers, unless `observe` is overridden. Copies with a raised flag
    of `seen` are judged, or all copies if it has no flags.

    The task closes the group.
    """

    def __init__(
        self,
        group: InlineGroup,
        *,
        burst: GroupBurst,
        seen: Gather,
        observation_space: Space[Any],
        action_space: Space[Any],
        max_steps: int | None = None,
        reset: GroupRequest | None = None,
    ) -> None:
        """burst: the burst of a step, from `group.prepared_burst`.

        seen: observations and flags, from `group.gather`.
        reset: request that begins an episode, from `group.prepared_request`. It is sent after
            `begin`, which may set its fields; if episodes begin while other copies step, in the
            call of their burst.
        max_steps: steps after which an episode is truncated (None: no limit).
        """
        super().__init__(
            group.copies,
            observation_space=observation_space,
            action_space=action_space,
            max_steps=max_steps,
        )
        self.group, self.burst, self.seen, self.reset = group, burst, seen, reset
        self.robots = (group,)
        own = type(self).step, type(self).restart
        self._joins = reset is not None and own == (GroupTask.step, GroupTask.restart)
        self._has_flags = seen.flags.shape[1] > 0
        self._pictures: Pictures | None = None
        if "model" in group[0].schema and type(self).render is GroupTask.render:
            frames = 1 / (group[0].period * burst.rows.shape[1])
            self.metadata = dict(self.metadata) | {
                "render_modes": ["rgb_array"],
                "render_fps": frames,
            }

    def targets(self, actions: Any) -> Any:
        """Converts actions (n, ...) of n copies to targets (n, steps, actuators) of a burst.

        By default these are the actions themselves, clipped into the action space.
        """
        return self.clipped(actions).reshape(len(actions), *self.burst.targets.shape[1:])

    def restart(
        self,
        copies: NDArray[np.intp],
        generators: Sequence[np.random.Generator],
        options: dict[str, Any],
    ) -> None:
        """Calls `begin`, and sends the request `reset`, if there is one."""
        super().restart(copies, generators, options)
        if self.reset is not None:
            self.reset.run(copies)

    @property
    def joins(self) -> bool:
        """Whether `step_others` is possible now: no copy is halted, no method is replaced."""
        return self._joins and not self.group.halted

    def step_others(self, actions: Any, beginning: NDArray[np.bool_]) -> None:
        """Runs a step of all copies but some, and in the same call the request `reset` of these.

        beginning: (copies,) whether a copy begins an episode.
        """
        assert self.reset is not None
        self.burst.targets[...] = self.targets(actions)
        try:
            self.burst.run(instead=(beginning, self.reset))
        except CopyFailed as failed:
            begun = failed.errors.keys().isdisjoint(beginning.nonzero()[0].tolist())
            if not (begun and self.until_halted().__exit__(None, failed, None)):
                raise

    def step(self, actions: Any, copies: Index) -> None:
        """Sends the targets of these copies, and runs a burst of these copies."""
        self.burst.targets[copies] = self.targets(actions)
        with self.until_halted():
            self.burst.run(None if copies is EVERY else copies)

    def observe(self, copies: Index) -> Any:
        """Returns the gathered numbers (n, numbers)."""
        return self.seen.observations[copies]

    def flagged(self) -> NDArray[np.bool_]:
        """Returns (copies,) with a flag raised; all copies if there are no flags."""
        if not self._has_flags:
            return super().flagged()
        flags = self.seen.flags
        raised: NDArray[np.bool_] = flags[:, 0]
        return raised if flags.shape[1] == 1 else np.logical_or.reduce(flags, axis=1)

    def render(self, copy: int) -> Image:
        """Draws a picture (height, width, 3) of the robot's model in the newest row of a copy."""
        if self._pictures is None:
            from o80.view.pictures import Pictures

            self._pictures = Pictures(self.group[copy], model_files=True)
        return self._pictures.draw(self.group[copy].latest())

    def close(self) -> None:
        """Closes the group."""
        if self._pictures is not None:
            self._pictures.close()
        self.group.close()
