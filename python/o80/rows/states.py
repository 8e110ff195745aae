"""The type of a robot's states for type checkers."""

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from o80.rows.record import Record

if TYPE_CHECKING:

    class States(np.ndarray[Any, np.dtype[Any]]):
        """The states of all actuators, of one row or of T rows.

        For a robot with one group of actuators: a NumPy array, (actuators,) or (T, actuators), with
        the dtype of the state: float64, or structured, with `states["position"]` for a field. For a
        robot with several groups: an o80.Record, with `states.joints` or `states["joints"]` for a
        group.

        A type checker accepts both uses, because the robot is known only at run time; there
        `isinstance(states, o80.Record)` distinguishes them.
        """

        def __getattr__(self, name: str) -> "States": ...
        def keys(self) -> tuple[str, ...]:
            """The names of the groups."""
            ...

else:
    States: TypeAlias = np.ndarray | Record
