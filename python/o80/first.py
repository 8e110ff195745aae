"""One wait for the rows of several backends."""

from collections.abc import Iterable, Mapping

from o80 import _core
from o80.errors import InvalidArgument
from o80.frontend import Frontend


def wait_for_first(
    members: Iterable[Frontend] | Mapping[Frontend, int], timeout: float | None = None
) -> dict[Frontend, _core.Observation]:
    """Waits until the first of several backends has published a row.

    members: frontends, each waiting for its next observation, as `Frontend.wait_for_next` does; or
        a mapping from frontends to the iterations that are waited for.
    timeout: for the first of them [s].

    Returns the observations that are there: of one frontend at least, of several if they came
    together. Raises TimeoutError, and BackendGone (naming the segment) if one of the backends ends
    while none has its row. No thread and no polling: one sleep on all segments, but for read-only
    frontends and Linux before 5.16, where it looks every millisecond.
    """
    wanted: list[tuple[Frontend, int | None]] = (
        list(members.items())
        if isinstance(members, Mapping)
        else [(member, None) for member in dict.fromkeys(members)]
    )
    for member, _ in wanted:
        if not isinstance(member, Frontend):
            raise InvalidArgument(f"members must be frontends of o80, got {member!r}")
    found = _core.wait_for_first(wanted, timeout)
    by_member: dict[_core.Frontend, _core.Observation] = dict(found)
    return {member: by_member[member] for member, _ in wanted if member in by_member}
