"""How a frontend takes exclusive control of a robot."""

import contextlib
import threading
from collections.abc import Iterator
from typing import Self

from o80 import _core
from o80.errors import BackendGone, Closed, ControlTaken, Error
from o80.frontend.bursting import Bursting
from o80.words import Status


class Controlling(Bursting):
    """The part of o80.Frontend that takes exclusive control."""

    _control_lock: threading.Lock
    _control_blocks: int

    @contextlib.contextmanager
    def control(self, timeout: float | None = 5.0) -> Iterator[Self]:
        """Exclusive control within a `with` block: batches of other frontends are rejected.

        Blocks of one frontend may nest or overlap: control ends with the last of them.
        Raises ControlTaken, naming the holder, if another frontend has it.
        """
        self._check_usable()
        with self._control_lock:
            batch = self._take_control()
            self._control_blocks += 1
        try:
            batch.wait(timeout, check=False)  # ControlTaken says more
        except BaseException:
            # control may still be given later: release it
            with contextlib.suppress(Error):
                self._leave_control()
            raise
        handle = batch.handles[0]
        if handle.status != Status.COMPLETED:
            with self._control_lock:
                self._control_blocks -= 1
            raise ControlTaken(f"no control of '{self.segment}': {handle.text}")
        try:
            yield self
        finally:
            with contextlib.suppress(BackendGone, Closed):
                if (released := self._leave_control()) is not None:
                    released.wait(timeout, check=False)

    def _leave_control(self) -> _core.Batch | None:
        """Ends a block; the last one releases control."""
        self._check_usable()
        with self._control_lock:
            self._control_blocks -= 1
            return self._release_control() if self._control_blocks == 0 else None
