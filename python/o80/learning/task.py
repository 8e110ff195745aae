"""Tasks: actions, observations and rewards of copies of a robot in episodes."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from gymnasium import Space
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from o80.base.argument_checks import whole
from o80.base.errors import BackendHalted, CopyFailed, InvalidArgument, NotCompleted
from o80.frontend.frontend import Frontend
from o80.groups.inline_group import InlineGroup
from o80.learning.halts import halts_of

Index = slice | NDArray[np.intp]
"""Index of some copies in arrays over all copies: an array of numbers, or `EVERY`."""
EVERY = slice(None)  #: all copies, as an index


@dataclass(frozen=True)
class Outcome:
    """Outcome of a step for the n judged copies: one entry for each, or one for all."""

    reward: ArrayLike = 0.0
    terminated: ArrayLike = False  #: the task ended the episode
    truncated: ArrayLike = False
    """Something outside the task ended the episode, such as a time limit."""
    info: Mapping[str, Any] = field(default_factory=dict)
    """Further entries of Gymnasium's info, for these copies only."""


class _UntilHalted(AbstractContextManager[None]):
    def __init__(self, task: "Task") -> None:
        self._task = task

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> bool:
        if error is None or not isinstance(error, BackendHalted | CopyFailed | NotCompleted):
            return False
        halted = halts_of(self._task.robots, self._task.copies).keys()
        failed = error.errors.keys() if isinstance(error, CopyFailed) else halted
        return bool(halted) and failed <= halted


class Task(ABC):
    """Task of `copies` copies of a robot in episodes: written once for one copy and for many.

    `Environment` makes a Gymnasium environment of a task with one copy, `VectorEnvironment` of a
    task with any number of copies. Both call, in each step: `step`, `flagged`, `judge` for the
    flagged copies, `info` and `observe`; and `begin` for copies that begin an episode.

    Copies are independent: the results of a copy may depend only on its own actions, and on random
    numbers of its own generator. Then a vector environment equals single ones, bit for bit.

    An argument `copies` of a method is an index of arrays over all copies.
    """

    robots: Sequence[InlineGroup | Frontend] = ()
    """Robots that the task moves. The halt of a robot ends the episode, and the next reset resumes
    it: see docs/learning.md. A frontend belongs to all copies. Without robots a halt raises."""
    resumes: bool = True  #: whether a reset resumes robots that run by their own clock
    halts: Mapping[int, str] = {}
    """Texts of the halts of copies that are halted after the last step, by copy."""
    metadata: Mapping[str, Any] = {"render_modes": []}
    """Metadata of the environments: modes of rendering, among others."""

    def __init__(
        self,
        copies: int,
        *,
        observation_space: Space[Any],
        action_space: Space[Any],
        max_steps: int | None = None,
    ) -> None:
        """observation_space, action_space: spaces of one copy.

        max_steps: steps after which an episode is truncated (None: no limit).
        """
        self.copies = whole(copies, "copies", 1)
        for name, space in (
            ("observation_space", observation_space),
            ("action_space", action_space),
        ):
            if not isinstance(space, Space):
                raise InvalidArgument(f"{name} must be a space of Gymnasium, got {space!r}")
        self.observation_space = observation_space
        self.action_space = action_space
        self.max_steps = None if max_steps is None else whole(max_steps, "max_steps", 1)
        self.steps: NDArray[np.int64] = np.zeros(self.copies, np.int64)
        """(copies,) steps of each episode so far; counted by the environment."""
        self._bounds: tuple[Any, Any, Any] = None, None, None  # a space, and those of all copies

    def restart(
        self,
        copies: NDArray[np.intp],
        generators: Sequence[np.random.Generator],
        options: dict[str, Any],
    ) -> None:
        """Begins episodes for an environment: calls `begin`; kinds of tasks extend it."""
        self.begin(copies, generators, options)

    def outcome(self, copies: NDArray[np.intp]) -> Outcome:
        """Judges a step for an environment: calls `judge`; kinds of tasks extend it."""
        return self.judge(copies)

    def shown(self, copies: Index) -> tuple[Any, Mapping[str, Any]]:
        """Returns observations and infos for an environment; kinds of tasks extend it."""
        info = self.info(copies)
        return self.observe(copies), info

    @abstractmethod
    def begin(
        self,
        copies: NDArray[np.intp],
        generators: Sequence[np.random.Generator],
        options: dict[str, Any],
    ) -> None:
        """Begins an episode of these copies.

        generators: one per copy; random numbers of a copy must come from its own generator.
        options: options of the call of `reset`; empty in an automatic reset.
        """

    @abstractmethod
    def step(self, actions: Any, copies: Index) -> None:
        """Executes the actions (n, ...) of these n copies."""

    def until_halted(self) -> AbstractContextManager[None]:
        """Encloses a burst of a group in `step`: the step continues although copies are halted."""
        return _UntilHalted(self)

    def clipped(self, actions: Any) -> Any:
        """Clips actions (n, ...) into the action space. Raises InvalidArgument if it is no Box."""
        space = self.action_space
        if not isinstance(space, Box):
            raise InvalidArgument(
                f"{type(self).__name__} has actions of {space}: define targets(actions)"
            )
        of, low, high = self._bounds
        if of is not space:
            shape = self.copies, *space.shape
            # NumPy is slow where it repeats the bounds of one copy, and np.clip is slower
            low, high = (np.broadcast_to(each, shape).copy() for each in (space.low, space.high))
            self._bounds = space, low, high
        if getattr(actions, "shape", None) != low.shape:
            low, high = space.low, space.high
        return np.minimum(np.maximum(actions, low), high)

    @abstractmethod
    def observe(self, copies: Index) -> Any:
        """Returns observations (n, ...) of these n copies; the environment copies them."""

    def flagged(self) -> NDArray[np.bool_]:
        """Returns (copies,) the copies to pass to `judge` after a step; by default all.

        Other copies get reward 0, and their episodes continue. Called in every step: keep it cheap.
        """
        return np.ones(self.copies, np.bool_)

    @abstractmethod
    def judge(self, copies: NDArray[np.intp]) -> Outcome:
        """Judges the step of these copies: flagged ones, ones in `halts`, and ones at the end of
        `max_steps`. The episode of a copy in `halts` terminates in any case.
        """

    def info(self, copies: Index) -> Mapping[str, Any]:
        """Returns entries of Gymnasium's info in each step and reset: arrays (n, ...), mappings."""
        return {}

    def render(self, copy: int) -> Any:
        """Draws a picture of one copy."""
        raise NotImplementedError(f"{type(self).__name__} has no pictures: define render(copy)")

    def close(self) -> None:  # noqa: B027
        """Closes everything that the task has started; may be called twice."""
