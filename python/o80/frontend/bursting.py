"""How a frontend requests iterations of a bursting backend."""

from collections.abc import Sequence
from typing import Literal, overload

from o80 import _core
from o80.errors import NotBursting
from o80.frontend.moving import Moving
from o80.prepared_burst import PreparedBurst
from o80.words import LateWord, ModeWord, ProfileWord, StartWord


class Bursting(Moving):
    """The part of o80.Frontend that bursts."""

    @overload
    def burst(
        self,
        iterations: int = 1,
        *,
        timeout: float | None = None,
        wait: Literal[True] = True,
        at: int | None = None,
        late: LateWord = "reject",
    ) -> _core.Observation: ...
    @overload
    def burst(
        self,
        iterations: int = 1,
        *,
        timeout: float | None = None,
        wait: Literal[False],
        at: int | None = None,
        late: LateWord = "reject",
    ) -> _core.Burst: ...
    def burst(
        self,
        iterations: int = 1,
        *,
        timeout: float | None = None,
        wait: bool = True,
        at: int | None = None,
        late: LateWord = "reject",
    ) -> _core.Observation | _core.Burst:
        """Sends all that was added and runs exactly this number of iterations.

        at: the iteration in which the backend takes the batch, of this burst or a later one (None:
            the first iteration of this burst).
        late: if that iteration has begun already: "reject" the batch, which then does not burst, or
            take it "now".

        Returns the observation of the last iteration; with `wait=False` a Burst, to wait for or to
        cancel. A call that ends without its last row (timeout, Ctrl-C) cancels the rest of its
        burst after the current iteration. So do the end of this frontend and its death.
        `prepared_burst` is faster for bursts that are repeated.

        Raises NotBursting, TimeoutError after `timeout` [s], BackendGone, LaneFull,
        InvalidArgument.
        """
        if wait:
            return self._burst(iterations, timeout, at, late)
        return self._start_burst(iterations, at, late)

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
    ) -> PreparedBurst:
        """Prepares a burst that is repeated: it sends targets and returns all rows.

        iterations: number of iterations of each burst.
        actuators: indices or names of the actuators that get targets (None: all).
        steps: number of targets of each actuator in a burst.
        each: 1: each target is a set-point for its iteration, the last one stays in force; more:
            rows of a trajectory, one every so many iterations.
        mode, profile, start: as in add_command.

        Raises NotBursting, InvalidArgument.
        """
        self._check_usable()
        if not self.bursting:
            raise NotBursting(
                f"'{self.segment}' runs in real time and cannot be burst: start it with bursting"
            )
        chosen, _ = self._chosen(actuators)
        options = iterations, steps, each, mode, profile, start, 0
        return PreparedBurst(self, self._layout, (), chosen, *options)
