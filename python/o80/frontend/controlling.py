"""How a frontend takes exclusive control of a robot."""

from contextlib import AbstractContextManager
from typing import Self, cast

import o80._core as _core
from o80.frontend.bursting import Bursting


class Controlling(Bursting):
    """The part of o80.Frontend that takes exclusive control."""

    def control(self, timeout: float | None = 5.0) -> AbstractContextManager[Self]:
        """Exclusive control within a `with` block: batches of other frontends are rejected.

        Blocks of one frontend may nest or overlap: control ends with the last of them. An interrupt
        (Ctrl-C) at any moment gives it back too.
        Raises ControlTaken, naming the holder, if another frontend has it.
        """
        return cast(AbstractContextManager[Self], _core.Control(self, timeout))
