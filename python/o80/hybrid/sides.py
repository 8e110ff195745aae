"""The rows of robots and worlds, for tasks."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.arrays import FloatArray
from o80.base.errors import InvalidArgument
from o80.frontend.frontend import Frontend
from o80.groups.group_burst import GroupRequest
from o80.groups.inline_group import InlineGroup
from o80.hybrid.mirror import Reader
from o80.learning.task import Index
from o80.rows.columns import columns_at
from o80.rows.layout import with_padding


class Side:
    """The robots of a rig, or their worlds: rows of the last step, and requests."""

    def __init__(
        self,
        member: InlineGroup | Frontend | None,
        rows: NDArray[Any],
        worlds: int | None = None,
        *,
        schema: Mapping[str, Any] | None = None,
        simulated: bool = True,
    ) -> None:
        """member: None for recorded rows. worlds: per robot, if numbers have this axis."""
        self._member, self._schema = member, schema
        self._repeated: dict[str, tuple[GroupRequest, NDArray[Any]]] = {}
        self.worlds = worlds
        self.simulated = simulated
        """False for a world that is only read: a person must place the things of `begin`."""
        self.rows = rows
        """Structured (copies, iterations), or (copies, worlds, iterations): each step overwrites
        them. After a reset all rows of a copy are its newest row."""
        self.last = rows[..., -1]
        """The newest rows, a view of `rows`."""
        self._bytes = with_padding(rows)
        self._flat = self._bytes.reshape(-1, rows.shape[-1])  # by the numbers of the group

    @property
    def schema(self) -> Mapping[str, Any]:
        """Description of the robot, as `Frontend.schema`."""
        if self._schema is None:
            member: Any = self._member
            self._schema = (member[0] if isinstance(member, InlineGroup) else member).schema
        return self._schema

    def numbers(self, paths: Sequence[str]) -> "Numbers":
        """Selects numbers of the newest rows by path. Raises InvalidArgument if one is unknown."""
        return Numbers(self, paths)

    def request(self, name: str, at: NDArray[np.intp], /, **fields: Any) -> None:
        """Sends a request to some copies and runs each until it has ended.

        at: numbers of the copies. fields: one value for all copies, or an array (n, ...) with one
            for each copy, for worlds also (n, worlds, ...).
        """
        if self._member is None:
            return  # the effect of the request is in the recorded rows
        described = [each for each in self.schema["requests"] if each["name"] == name]
        parts = described[0]["type"]["fields"] if described else []
        dimensions = {part["name"]: len(part["shape"]) for part in parts}
        member, each = self._member, self.rows[0, ..., 0].size
        for field, value in fields.items():
            more = 0 if isinstance(value, str) else np.ndim(value) - dimensions.get(field, 99)
            if more > 0:
                entries = _of_all(value, (len(at), each)[:more], each, f"{field} of '{name}'")
                fields[field] = entries if isinstance(member, InlineGroup) else entries[0]
        if isinstance(member, InlineGroup):
            member.request(name, copies=numbers_of_worlds(at, each), **fields)
        else:
            member.request(name, **fields)

    def serves(self, request: str) -> bool:
        """Returns whether the robot serves a request of this name."""
        return any(each["name"] == request for each in self.schema["requests"])

    def repeat(self, name: str, at: NDArray[np.intp], /, **fields: Any) -> None:
        """Sends a request as `request`, quicker for groups; all rows are then the newest row.

        fields: integers, one for all copies, or an array (n,), for worlds (n, worlds).
        """
        member = self._member
        if not isinstance(member, InlineGroup):
            self.request(name, at, **fields)
            return
        if name not in self._repeated:
            request = member.prepared_request(name, **dict.fromkeys(fields, 0))
            self._repeated[name] = request, with_padding(request.rows)[:, np.newaxis]
        request, rows = self._repeated[name]
        numbers = numbers_of_worlds(at, len(self._flat) // len(self._bytes))
        for field, values in fields.items():
            request.fields[field][numbers] = np.ravel(values)
        request.run(numbers)
        self._flat[numbers] = rows[numbers]

    def show(self, copies: NDArray[np.intp], rows: NDArray[Any]) -> None:
        """Sets all rows of these copies to rows (n, 1), for worlds (n, worlds, 1)."""
        self._bytes[copies] = with_padding(rows)

    def newest(self, copies: NDArray[np.intp]) -> NDArray[Any]:
        """Returns the newest rows (n,) or (n, worlds) of these copies, as a copy."""
        return self._bytes[copies, ..., -1].view(self.rows.dtype)


def numbers_of_worlds(copies: NDArray[np.intp], each: int) -> NDArray[np.intp]:
    """Returns the numbers of all worlds of these copies, within their group."""
    if each == 1:
        return copies
    return (np.asarray(copies)[:, np.newaxis] * each + np.arange(each)).ravel()


def _of_all(value: Any, shape: tuple[int, ...], each: int, what: str) -> list[Any]:
    """Returns an entry for each world. Raises InvalidArgument for a wrong shape."""
    given = np.asarray(value)
    if given.shape[: len(shape)] != shape:
        raise InvalidArgument(f"{what} must begin with the shape {shape}, got {given.shape}")
    if len(shape) == 1:
        return list(np.repeat(given, each, axis=0))
    return list(given.reshape(-1, *given.shape[2:]))


class Numbers:
    """Selected numbers of the newest rows of a side."""

    def __init__(self, side: Side, paths: Sequence[str]) -> None:
        if isinstance(paths, str):
            raise InvalidArgument(f"a list of paths is needed, such as ['{paths}']")
        self._side = side
        schema = side.schema
        columns = [column for path in paths for column in columns_at(schema, _whole(path))]
        self.names, self._read = [column.name for column in columns], Reader(columns)

    def __len__(self) -> int:
        return len(self.names)

    def read(self, at: Index) -> FloatArray:
        """Reads (n, numbers) of these copies, or (n, worlds, numbers)."""
        rows = self._side.last[at]
        if self._side.worlds is None and rows.ndim > 1:
            rows = rows[:, 0]
        return self._read(rows)


def desired_of(robot: Frontend) -> FloatArray:
    """Returns (actuators,), the first number of each desired state in the newest row."""
    names = [actuator["name"] for actuator in robot.schema["actuators"]]
    columns = [columns_at(robot.schema, f"desired.{name}")[0] for name in names]
    return Reader(columns)(robot.history(1).rows)[0]  # type: ignore[no-any-return]


def _whole(path: str) -> str:
    """Completes a path that does not begin with a part of a row: it is a sensor value."""
    named = path.partition(".")[0] in ("desired", "observed", "extended")
    return path if named else f"extended.{path}"
