"""Registers tasks with Gymnasium, which then makes their environments by id."""

from collections.abc import Callable
from typing import Any

import gymnasium

from o80.learning.environment import Environment
from o80.learning.task import Task
from o80.learning.vector_environment import VectorEnvironment


def register(name: str, make: Callable[..., Task]) -> None:
    """Registers a task for `gymnasium.make` and `gymnasium.make_vec`.

    name: the id, such as "mine/Reach-v0".
    make: the class of the task, or a function that makes one: `make(copies=N, **options)`.

    Keyword arguments of `gymnasium.make` and `make_vec` are passed to `make`, except `render_mode`
    and, for `make_vec`, `autoreset_mode`.
    """

    def single(*, render_mode: str | None = None, **options: Any) -> Environment:
        return Environment(make(copies=1, **options), render_mode=render_mode)

    def vector(
        num_envs: int,
        autoreset_mode: Any = gymnasium.vector.AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **options: Any,
    ) -> VectorEnvironment:
        task = make(copies=num_envs, **options)
        return VectorEnvironment(task, autoreset_mode=autoreset_mode, render_mode=render_mode)

    maker: Any = vector  # the protocol of Gymnasium names no parameters
    gymnasium.register(id=name, entry_point=single, vector_entry_point=maker)
