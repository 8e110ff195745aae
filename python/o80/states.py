"""The states of a robot as type checkers see them."""

from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from o80.record import Record

if TYPE_CHECKING:

    class States(np.ndarray[Any, np.dtype[Any]]):
        """The states of all actuators, of one row or of T rows.

        A robot whose actuators are all alike: a NumPy array, (actuators,) or (T, actuators). Its
        dtype is that of the state: float64, or structured, with `states["position"]` for a field.
        A robot of several groups: an o80.Record, with `states.joints` or `states["joints"]` for a
        group.

        Which of the two is known when the robot is. A type checker takes it for both; at run time
        `isinstance(states, o80.Record)` tells.
        """

        def __getattr__(self, name: str) -> "States": ...
        def keys(self) -> tuple[str, ...]:
            """The names of the groups."""
            ...

else:
    States: TypeAlias = np.ndarray | Record
