"""One wait for the rows of several backends."""

from collections.abc import Iterable, Mapping

import o80._core as _core
from o80.base.errors import InvalidArgument
from o80.frontend.frontend import Frontend


def wait_for_first(
    members: Iterable[Frontend] | Mapping[Frontend, int], timeout: float | None = None
) -> dict[Frontend, _core.Observation]:
    """Waits until the first of several backends has published a row.

    members: frontends, for the next observation of each, as with `Frontend.wait_for_next`; or a
        mapping from frontends to iterations.
    timeout: for the first row [s].

    Returns the observations that are published: of one frontend or more. Raises TimeoutError, and
    BackendGone with the segment's name if a backend ends before any row is published. It needs no
    thread and does not poll: it sleeps on all segments at once. With read-only frontends, and on
    Linux before 5.16, it looks every millisecond instead.
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
