"""Finds tasks by name and makes their vector environments; no other place does."""

import importlib
import inspect
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import FunctionType
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import load_env_creator
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

from o80.base.argument_checks import text, whole
from o80.base.errors import Error, InvalidArgument, exception_text
from o80.base.finite import json_text
from o80.drivers.driver_class import imported, place_of
from o80.learning.task import Task
from o80.learning.vector_environment import VectorEnvironment

SUCCESS = "is_success"
"""Entry of an episode's last info that environments of Gymnasium use for success."""
_KINDS = (type, FunctionType)
_ID = re.compile(r"-v\d+$")


def make_vec(
    task: Any,
    copies: int = 1,
    *,
    autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
    **options: Any,
) -> VectorEnv[Any, Any, Any]:
    """Makes the vector environment of `copies` copies of a task.

    task: one of these, or its name ("module:Class", "file.py:Class"):
      - a class with a class method `make_vec(copies, *, autoreset_mode, **options)`
      - a subclass of `gymnasium.Env`; or the id of a registered environment
      - a subclass of `o80.learning.Task`, or a function `make(copies=N, **options)` that returns a
        Task or a vector environment
    options: parameters of the task.

    Raises InvalidArgument with the name of the task if it cannot be made.
    """
    name = name_of(task)
    copies, mode = whole(copies, "copies", 1), AutoresetMode(autoreset_mode)
    if isinstance(task, str) and not _is_id(name):
        task = imported(name, "task", InvalidArgument, *_KINDS)
    try:
        made = _made(task, copies, mode, options)
    except Error:
        raise
    except (TypeError, ValueError, ImportError, gymnasium.error.Error) as error:
        given = ", ".join(
            f"{key}={value!r}" for key, value in {"copies": copies, **options}.items()
        )
        raise InvalidArgument(
            f"the task '{name}' cannot be made with {given}: {exception_text(error)}"
        ) from error
    if not isinstance(made, VectorEnv) or made.num_envs != copies:
        raise InvalidArgument(
            f"the task '{name}' must make an o80.learning.Task or a vector environment with "
            f"{copies} copies, got {made!r}"
        )
    return made


def _made(task: Any, copies: int, mode: AutoresetMode, options: Mapping[str, Any]) -> Any:
    if isinstance(task, str):
        return _registered(task, copies, mode, options)
    if hasattr(task, "make_vec"):
        return task.make_vec(copies, autoreset_mode=mode, **options)
    if isinstance(task, type) and issubclass(task, gymnasium.Env):
        single: Any = task
        return SyncVectorEnv([lambda: single(**options)] * copies, autoreset_mode=mode)
    made = task(copies=copies, **options)
    return VectorEnvironment(made, autoreset_mode=mode) if isinstance(made, Task) else made


def _registered(
    name: str, copies: int, mode: AutoresetMode, options: Mapping[str, Any]
) -> VectorEnv[Any, Any, Any]:
    """Uses the entry point for vectors if it takes the mode; those of Gymnasium do not."""
    module, _, name = name.rpartition(":")
    if module:
        importlib.import_module(module)
    vector: Any = gymnasium.spec(name).vector_entry_point
    if isinstance(vector, str):
        vector = load_env_creator(vector)
    if vector is not None and "autoreset_mode" in inspect.signature(vector).parameters:
        return gymnasium.make_vec(name, copies, autoreset_mode=mode, **options)
    kind = {"autoreset_mode": mode}
    return gymnasium.make_vec(name, copies, "sync", vector_kwargs=kind, **options)


def _is_id(name: str) -> bool:
    return name in gymnasium.registry or bool(_ID.search(name))


def name_of(task: Any) -> str:
    """Returns the name by which another program finds a task, a rule or a function.

    Names of files become absolute. Raises InvalidArgument if there is no such name.
    """
    if isinstance(task, str):
        where, colon, name = task.rpartition(":")
        if not colon and not _is_id(task):
            raise InvalidArgument(
                f"unknown task '{task}': give the id of a registered environment "
                "(module:mine/Task-v0 imports its module first), module:Class or file.py:Class"
            )
        return f"{Path(where).resolve()}:{name}" if where.endswith(".py") else task
    place = place_of(task) if isinstance(task, _KINDS) else ""
    if not place or "<" in place:
        raise InvalidArgument(
            f"{task!r} cannot be imported by another program: give a class or function at the "
            "top of a module, or its name, such as module:Class or file.py:Class"
        )
    return place


@dataclass(frozen=True)
class NamedTask:
    """A task that another program can make again. Raises InvalidArgument for other tasks."""

    name: Any
    """Any task for `make_vec`; stored as its name."""
    options: Mapping[str, Any] = field(default_factory=dict)
    """Parameters of the task: numbers, texts, and lists and mappings of these."""
    imported: Mapping[str, Any] = field(default_factory=dict)
    """Parameters that are user-defined objects (a reward rule, say), by name: functions, or classes
    without arguments, of which one object is made."""
    success: str = SUCCESS
    """Entry of an episode's last info that is true for a success."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", name_of(self.name))
        for option, value in self.options.items():
            try:
                json_text(value)
            except (TypeError, ValueError):
                raise InvalidArgument(
                    f"option '{option}' must consist of numbers and texts, got {value!r}: give "
                    "objects by the name of their class or function, as imported={...} or --import"
                ) from None
        object.__setattr__(self, "options", json.loads(json_text(dict(self.options))))
        names = {option: name_of(value) for option, value in self.imported.items()}
        object.__setattr__(self, "imported", names)
        text(self.success, "success")

    def objects(self) -> dict[str, Any]:
        """Imports the parameters in `imported`. Raises InvalidArgument if one fails."""
        made = {}
        for option, name in self.imported.items():
            found = imported(name, option, InvalidArgument, *_KINDS)
            try:
                made[option] = found() if isinstance(found, type) else found
            except TypeError as error:
                raise InvalidArgument(
                    f"the {option} '{name}' must be callable without arguments: {error}"
                ) from error
        return made

    def make_vec(self, copies: int, mode: AutoresetMode) -> VectorEnv[Any, Any, Any]:
        """Makes copies for a policy network. Raises InvalidArgument for other spaces or modes."""
        options = {**self.options, **self.objects()}
        made = make_vec(self.name, copies, autoreset_mode=mode, **options)
        seen, acted = made.single_observation_space, made.single_action_space
        made_mode = made.metadata.get("autoreset_mode")
        wrong = ""
        if not isinstance(seen, Box) or len(seen.shape) != 1:
            wrong = f"have observations in a Box of shape (M,), not {seen}"
        elif not isinstance(acted, Box) or len(acted.shape) != 1 or not acted.is_bounded():
            wrong = f"have actions in a Box of shape (A,) with finite limits, not {acted}"
        elif made_mode != mode:
            wrong = f"be made in autoreset mode {mode.value}, not {made_mode}"
        if wrong:
            made.close()
            raise InvalidArgument(f"the task '{self.name}' must {wrong}")
        return made


def spread(actions: Any, space: Any) -> Any:
    """Clips actions (..., A) into [-1, 1] and spreads them over the limits of a Box."""
    share = (np.clip(actions, -1.0, 1.0).astype(np.float64) + 1.0) / 2.0
    spanned = space.low + share * (space.high.astype(np.float64) - space.low)
    return np.clip(spanned, space.low, space.high).astype(space.dtype)
