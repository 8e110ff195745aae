"""Copies of one robot in this process, stepped together by threads of C++.

with o80.robots.load("two_joints").inline(copies=64) as group:
    burst = group.prepared_burst(10)
    burst.targets[...] = 0.5
    burst.run()
    burst.rows["observed"]
"""

import contextlib
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base import lifecycle
from o80.base.argument_checks import whole
from o80.base.errors import InvalidArgument, UsedAfterFork
from o80.base.lifecycle import Closeable
from o80.base.words import ModeWord, ProfileWord, StartWord
from o80.frontend.frontend import Frontend
from o80.frontend.results import Halt, halt_of
from o80.groups.gather import Comparison, Gather, Gathered, flags_from, numbers_from
from o80.groups.group_burst import Copies, GroupBurst, GroupRequest, chosen_copies
from o80.rows.enumerations import labelled
from o80.rows.layout import Layout, dtype_of_type, labels_of_type


class InlineGroup(Closeable):
    """Copies of one robot in this process; made by `Robot.inline(copies=...)`.

    Each copy does what a single inline robot does, bit for bit, with any number of threads. A call
    runs the copies in all threads of the group, without the GIL. If a copy fails, the call raises
    CopyFailed with its number after all other copies are done. Ctrl-C ends a call within about
    50 ms and leaves each copy between two iterations.

    One thread at a time may call the group. In a forked child its calls raise UsedAfterFork.
    """

    def __init__(self, group: _core.InlineGroup) -> None:
        self._group = group
        self._layout = Layout(group.description)
        self._all = np.arange(group.copies, dtype=np.uint32)
        self._frontends: dict[int, Frontend] = {}
        self._closed = False
        lifecycle.close_later(self)

    @property
    def copies(self) -> int:
        """Number of copies."""
        return self._group.copies

    @property
    def threads(self) -> int:
        """Number of threads that run them, the calling one included."""
        return self._group.threads

    @property
    def robot(self) -> str:
        """Name of the robot."""
        return self._group.robot

    @property
    def closed(self) -> bool:
        """True after `close`."""
        return self._closed

    def __len__(self) -> int:
        return self.copies

    def __getitem__(self, copy: int) -> Frontend:
        """Returns a frontend of one copy: to inspect the robot, and to command, halt or read it.

        A burst of this frontend runs that copy alone, in the calling thread.
        """
        number = self._number(copy)
        found = self._frontends.get(number)
        if found is None or found.closed:
            found = Frontend._of(self._group.attach(number), unnamed=False)
            self._frontends[number] = found
        return found

    def prepared_burst(
        self,
        iterations: int = 1,
        actuators: int | str | Sequence[int | str] | None = None,
        *,
        steps: int = 1,
        each: int = 1,
        mode: ModeWord = "queue",
        profile: ProfileWord = "linear",
        start: StartWord = "desired",
        delay: int = 0,
    ) -> GroupBurst:
        """Prepares a repeatable burst of the copies: it sends targets and returns all rows.

        iterations: number of iterations of each burst.
        actuators: indices or names of the actuators that get targets (None: all; []: none, for
            copies that run commands sent earlier). Their states may be of several types, see
            `GroupBurst`.
        steps: number of targets of each actuator in a burst.
        each: iterations to reach each target.
        mode, profile, start: as in `Frontend.add_command`.
        delay: iterations of the burst before the targets are taken.

        Raises InvalidArgument, also if the history is too short for so many rows.
        """
        self._group.check_usable()
        chosen, _ = self[0]._chosen(actuators)
        options = iterations, steps, each, mode, profile, start, whole(delay, "delay", 0)
        return GroupBurst(self._group, self._all, self._layout, (self.copies,), chosen, *options)

    def request(
        self, name: str, /, *, copies: Copies = None, timeout: float | None = None, **fields: Any
    ) -> None:
        """Sends a request to copies and runs each until its request has ended.

        name: name of the request.
        copies: numbers of the copies, a slice, or a mask (None: all).
        timeout: for all copies together [s].
        fields: fields of the request. A value with one dimension more than the field has one entry
            for each of these copies: `seed=[3, 4]`.

        Raises CopyFailed for requests that were not completed, TimeoutError, InvalidArgument.
        """
        chosen = chosen_copies(copies, self._all)
        spread = {field: self._spread(name, field, fields[field], len(chosen)) for field in fields}
        each = [{field: values[i] for field, values in spread.items()} for i in range(len(chosen))]
        index, given = self._group.request_index(name), chosen.view(np.uint8)
        payloads = self._group.payloads(index, each)
        self._group.request(index, given, payloads, bytearray(), timeout)

    def prepared_request(self, name: str, /, **fields: Any) -> GroupRequest:
        """Prepares a repeatable request, such as the reset of a simulation.

        name: name of the request.
        fields: fields of the request, the same for all copies; `GroupRequest.fields` changes them.

        Raises InvalidArgument for an unknown request or field.
        """
        index = self._group.request_index(name)
        payload = self._group.payloads(index, [fields])
        described = self._layout.schema["requests"][index]
        kind = dtype_of_type(described["type"])
        given = np.frombuffer(bytearray(payload * self.copies), kind)
        rows = np.zeros(self.copies, self._layout.row)
        return GroupRequest(
            self._group, index, labelled(given, labels_of_type(described["type"])), rows
        )

    @property
    def halted(self) -> dict[int, Halt]:
        """Halts in force or requested, by number of the copy; empty if no copy is halted."""
        found = self._group.halted()
        return {copy: halt_of(fields) for copy, fields in found.items()} if found else {}

    def resume(self, copies: Copies = None, *, timeout: float | None = None) -> None:
        """Ends halts: each copy runs until it is at rest, then starts afresh where it is.

        copies: numbers of the copies, a slice, or a mask (None: all). Copies that are not halted do
            nothing.
        timeout: for all copies together [s].

        Raises CopyFailed for copies that refuse; they stay halted, all others are resumed.
        """
        self._group.resume(chosen_copies(copies, self._all).view(np.uint8), timeout)

    def latest(self, copies: Copies = None) -> NDArray[Any]:
        """Returns the newest row of each copy, structured like `history().rows`: (copies,)."""
        chosen = chosen_copies(copies, self._all)
        rows = np.zeros(len(chosen), self._layout.row)
        self._group.latest(chosen.view(np.uint8), rows.view(np.uint8))
        return rows

    def gather(
        self,
        numbers: Sequence[str | Gathered],
        flags: Mapping[str, str | Comparison] | None = None,
    ) -> Gather:
        """Reads observations and event flags of the newest rows from now on, in C++.

        numbers: paths as of a row (`row["observed.joint1.position"]`), or Gathered with an offset,
            a scale and limits. A path of several numbers stands for all of them.
        flags: for each name a path of a number that is not 0, or a comparison such as
            `("extended.height", "<", 0.1)`.

        Every burst and request of this group refreshes them for its copies, on the threads of the
        group, before it returns. A later call of `gather` replaces them.
        """
        read = numbers_from(numbers, self._layout.schema)
        compared = flags_from(flags or {}, self._layout.schema)
        gather = Gather(self.copies, [name for name, _ in read], list(compared))
        memory = gather.observations.view(np.uint8), gather.flags.view(np.uint8)
        self._group.gather([number for _, number in read], list(compared.values()), *memory)
        return gather

    def publish(self, copy: int, name: str) -> None:
        """Publishes the segment of one copy under a name, so that other processes can attach to it.

        `o80 view`, `o80 record` and `o80.Frontend(name)` then work as for any backend, until the
        group is closed. Raises SegmentTaken, and Error if that copy has a name already.
        """
        self._group.publish(self._number(copy), name)

    def close(self) -> None:
        """Stops all copies. May be called twice."""
        if self._closed:
            return
        self._closed = True
        for frontend in self._frontends.values():
            frontend.close()
        self._group.close()

    def __del__(self) -> None:
        if self.__dict__.get("_closed", True):
            return
        with contextlib.suppress(UsedAfterFork):
            self._group.check_usable()
            warnings.warn(
                f"the inline group of '{self.robot}' was never closed",
                ResourceWarning,
                stacklevel=2,
            )
        self.close()

    def _number(self, copy: int) -> int:
        number = whole(copy, "the number of a copy")
        if not -self.copies <= number < self.copies:
            raise IndexError(f"there are copies 0 to {self.copies - 1}, there is no copy {number}")
        return number % self.copies

    def _spread(self, name: str, field: str, value: Any, count: int) -> Sequence[Any]:
        """Returns a value for each of `count` copies."""
        if isinstance(value, str) or np.ndim(value) <= self._dimensions(name, field):
            return [value] * count
        if len(value) != count:
            raise InvalidArgument(
                f"{field} of request '{name}' has {len(value)} entries for {count} copies"
            )
        return value if isinstance(value, list) else list(value)

    def _dimensions(self, name: str, field: str) -> int:
        for request in self._layout.schema["requests"]:
            if request["name"] == name:
                for known in request["type"]["fields"]:
                    if known["name"] == field:
                        return len(known["shape"])
        return 0  # C++ reports the unknown name

    def __repr__(self) -> str:
        state = "closed" if self._closed else f"{self.threads} threads"
        return f"<o80.InlineGroup of {self.copies} copies of '{self.robot}', {state}>"
