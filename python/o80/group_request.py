"""A request to the copies of an inline group that is repeated."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.group_burst import Copies, chosen_copies


class GroupRequest:
    """A request that is sent to copies again and again; from `InlineGroup.prepared_request`.

    fields: (copies,), structured: the fields of the request of each copy. They keep their values
        from run to run.
    rows: (copies,), structured like `history().rows`: the newest row of each copy after its last
        run. Every run overwrites those of its copies.
    """

    def __init__(
        self,
        group: _core.InlineGroup,
        name: str,
        fields: NDArray[Any],
        rows: NDArray[Any],
        everybody: NDArray[np.uint32],
    ) -> None:
        self._group, self._everybody = group, everybody
        self._request = group.request_index(name)
        self._fields, self._rows = fields, rows
        self._bytes = rows.view(np.uint8)

    @property
    def fields(self) -> NDArray[Any]:
        """The fields of the request of each copy, (copies,)."""
        return self._fields

    @property
    def rows(self) -> NDArray[Any]:
        """The newest row of each copy after its last run, (copies,)."""
        return self._rows

    def run(self, copies: Copies = None, *, timeout: float | None = None) -> None:
        """Sends the request and runs each copy until its request has ended.

        copies: numbers of the copies, a slice, or a mask (None: all).
        timeout: for all of them together [s].

        Raises as `InlineGroup.request`.
        """
        chosen = chosen_copies(copies, self._everybody)
        payloads = self._fields[chosen].view(np.uint8)
        self._group.send_request(
            self._request, chosen.view(np.uint8), payloads, self._bytes, timeout
        )
