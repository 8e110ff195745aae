"""Several bursting backends that run at the same time."""

from collections.abc import Generator, Mapping
from types import MappingProxyType
from typing import Any, Literal, overload

import o80._core as _core
from o80.frontend.frontend import Frontend


class BurstGroup:
    """The bursts of a group, made by `o80.burst(members, wait=False)`."""

    def __init__(self, bursts: dict[Frontend, _core.Burst]) -> None:
        self._bursts = bursts

    @property
    def bursts(self) -> Mapping[Frontend, _core.Burst]:
        """The burst of each member."""
        return MappingProxyType(self._bursts)

    @property
    def done(self) -> bool:
        """True if the last iteration of every member is done."""
        return all(burst.done for burst in self._bursts.values())

    def cancel(self) -> None:
        """Cancels all bursts: each backend stops after its current iteration."""
        for burst in self._bursts.values():
            burst.cancel()

    def wait(self, timeout: float | None = None) -> dict[Frontend, _core.Observation]:
        """Waits for all bursts and returns the last observation of each.

        timeout: for all bursts together [s].

        If it raises (TimeoutError, BackendGone, Ctrl-C, Error for a burst that was rejected, for
        example because another frontend has control), the rest of all bursts is cancelled.
        """
        rows = _core.wait_for_bursts(list(self._bursts.values()), timeout)
        return dict(zip(self._bursts, rows, strict=True))

    def __await__(self) -> Generator[Any, None, dict[Frontend, _core.Observation]]:
        """Awaits all bursts in asyncio, as `wait`; cancelling the task cancels the bursts."""
        from o80.base.awaiting import in_thread

        return in_thread(self.wait).__await__()


@overload
def burst(
    members: Mapping[Frontend, int],
    timeout: float | None = None,
    *,
    wait: Literal[True] = True,
    seen: _core.Observation | _core.Seen | None = None,
) -> dict[Frontend, _core.Observation]: ...
@overload
def burst(
    members: Mapping[Frontend, int],
    *,
    wait: Literal[False],
    seen: _core.Observation | _core.Seen | None = None,
) -> BurstGroup: ...
def burst(
    members: Mapping[Frontend, int],
    timeout: float | None = None,
    *,
    wait: bool = True,
    seen: _core.Observation | _core.Seen | None = None,
) -> dict[Frontend, _core.Observation] | BurstGroup:
    """Runs several bursting backends at the same time, each for its number of iterations.

    All members are checked first: nothing runs unless each is alive, bursting, and has a lane with
    room for the added commands. Then all bursts start.

    seen: the observation on which all commands are based, as in `Frontend.pulse`.

    Returns the last observation of each; with `wait=False` a BurstGroup, to wait for or to cancel.
    Raises NotBursting, InvalidArgument, NoLane, LaneFull and BackendGone before anything runs, and
    the exceptions of `BurstGroup.wait`.
    """
    bursts = _core.start_bursts(list(members.items()), seen)
    group = BurstGroup(dict(zip(members, bursts, strict=True)))
    return group.wait(timeout) if wait else group
