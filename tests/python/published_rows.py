"""Random rows of a robot, and a check of all their readers.

The expected numbers come from nested values and field names, without any offsets.
"""

import csv
import json
import math
import pickle
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow.parquet
from mcap.reader import make_reader
from minari import MinariDataset
from mixed_robots import Drawn, many
from numpy.typing import NDArray
from processes import WAIT
from rosbags.highlevel import AnyReader

import o80
from o80.datasets import lerobot, minari
from o80.datasets.episodes import episodes_of
from o80.datasets.export import write
from o80.difference import first_difference
from o80.plot import plot
from o80.recording.epoch import topic_of
from o80.rows.history import columns_in
from o80.view.base64_arrays import packed
from o80.view.curves import Panels

Columns = dict[str, NDArray[Any]]


def numbers(path: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Lists the numbers of a value, each with its column name."""
    if isinstance(value, Mapping):
        for name in value:
            yield from numbers(f"{path}.{name}", value[name])
        return
    array = np.asarray(value)
    for place in np.ndindex(array.shape):
        inner = path + "".join(f"[{i}]" for i in place)
        if array.dtype.names is None:
            yield inner, array[place]
        for name in array.dtype.names or ():
            yield from numbers(f"{inner}.{name}", array[place][name])


def element(value: Any, index: int) -> Any:
    """Selects one actuator from the values of several."""
    if isinstance(value, Mapping):
        return {name: element(inner, index) for name, inner in value.items()}
    return value[index]


class Published(Drawn):
    """Random rows and their expected columns."""

    def swap(self, one: int, other: int) -> None:
        """Swaps two rows."""
        states = [self.row(one), self.row(other)]
        self._rows[other], self._rows[one] = states

    def columns(self, rows: int) -> Columns:
        """Returns all columns (rows,). Without commands, desired states equal the ones of row 0."""
        each = [dict(self._numbers(row)) for row in range(rows)]
        return {name: np.array([row[name] for row in each]) for name in each[0]}

    def _numbers(self, row: int) -> Iterator[tuple[str, Any]]:
        for part, (states, _) in (("desired", self.row(0)), ("observed", self.row(row))):
            for name, members in self.groups.items():
                if lead := many(members)[1]:
                    for i in range(lead[0]):
                        named = f"{name}_{i}"
                        yield from numbers(f"{part}.{named}", element(states[name], i))
                else:
                    yield from numbers(f"{part}.{name}", states[name])
        if self.sensors is not None:
            yield from numbers("extended", self.row(row)[1])


# ---------------------------------------------------------------------------- consumers


def check_every_reader(
    frontend: o80.Frontend,
    iterate: Callable[[], object],
    expect: Callable[[int], Columns],
    folder: Path,
) -> None:
    """Records a robot at row 0, and compares the output of all readers.

    iterate: publishes a row. expect: returns the expected columns of a number of rows.
    """
    path, marked = folder / "run.mcap", folder / "marked.mcap"
    with o80.Recording(path, frontend) as recording, o80.Recording(marked, frontend) as episode:
        episode.mark("episode")
        for _ in range(3):
            iterate()
        recording.flush()  # begins a new chunk
        for _ in range(4):
            iterate()
        episode.mark("episode_end")
    live = frontend.history()
    expected = expect(len(live))
    assert len(live) == 8
    Readers(live, expected).check()
    names = tuple(expected)
    same(expected, dict(zip(names, frontend.history(fields=names), strict=True)))
    for some in (*names[::5], names[-1].partition(".")[0]):
        column = frontend.history(fields=some)
        assert column.dtype == live[some].dtype
        assert column.tobytes() == live[some].tobytes()

    epoch = o80.open(path)[frontend.segment].epochs[0]
    recorded = epoch.history()
    Readers(recorded, expected).check()
    assert first_difference(live, recorded) is None
    assert recorded.rows.tobytes() == live.rows.tobytes()
    blocks = [*epoch.blocks()]
    assert len(blocks) > 1
    for block in blocks:
        first, last = int(block.iteration[0]), int(block.iteration[-1])
        same(part(expected, slice(first, last + 1)), columns_in(block))
    played(path, frontend.segment, expected)
    messages(path, frontend.segment, expected)
    files(recorded, folder, expected)
    data_sets(marked, folder, expected)


@dataclass
class Readers:
    """Checks of a history's readers."""

    history: o80.History
    expected: Columns

    def check(self) -> None:
        self.rows()
        self.derived()
        self.aligned()
        self.difference()
        self.picture()
        self.page()

    def rows(self) -> None:
        """Checks single rows, by name and as flat numbers."""
        seen = [name for name in self.expected if not name.startswith("desired.")]
        flat = np.array([self.expected[name].astype(np.float64) for name in seen]).T
        assert np.array_equal(self.history.flat(np.float64), flat)
        assert np.array_equal(self.history[::3].flat(np.float64), flat[::3])
        for i, row in enumerate(self.history):
            assert np.array_equal(row.flat(np.float64), flat[i])
            parts = (row.desired, row.observed, row.extended)
            found = [number for part in parts for _, number in numbers("", part)]
            assert found == [values[i] for values in self.expected.values()]
        assert str(self.history[-1]) == str(self.history[2:][-1])

    def derived(self) -> None:
        """Checks slices, pickles and data frames of the history."""
        for history, values in (
            (self.history, self.expected),
            (self.history[1::2], part(self.expected, slice(1, None, 2))),
            (self.history.select(3), part(self.expected, slice(-3, None))),
            (pickle.loads(pickle.dumps(self.history)), self.expected),
            (pickle.loads(pickle.dumps(self.history[::2])), part(self.expected, slice(0, None, 2))),
        ):
            same(values, columns_in(history))
            same(values, as_numbers(history.to_frame(), labels_of(history)))

    def aligned(self) -> None:
        times = self.history.time
        for how in ("before", "nearest", "linear"):
            joined = o80.align({"robot": self.history}, at=times, how=how)
            same(self.expected, columns_in(joined["robot"]))
            same(self.expected, columns_in(pickle.loads(pickle.dumps(joined["robot"]))))
        middle = (times[:-1] + times[1:]) // 2
        joined = o80.align({"robot": self.history}, at=middle, how="linear")
        share = (middle - times[:-1]) / (times[1:] - times[:-1])
        mixed = {name: between(values, share) for name, values in self.expected.items()}
        same(mixed, columns_in(joined["robot"]))
        nothing = o80.align({"robot": self.history}, at=times[:1] - 1)["robot"]
        for name, values in columns_in(nothing).items():
            if name in self.expected:
                assert np.isnan(values).all() if values.dtype.kind == "f" else not values.any()

    def difference(self) -> None:
        """Checks that a changed row is found at the first different number."""
        rows = self.history.rows.copy()
        part = "extended" if "extended" in (rows.dtype.names or ()) else "observed"
        rows[5][part] = self.history.rows[2][part]
        names = [
            name for name, values in self.expected.items()
            if name.startswith(part) and values[5].tobytes() != values[2].tobytes()
        ]  # fmt: skip
        found = first_difference(self.history, o80.History(self.history._decoder, rows))
        if names:
            values = self.expected[names[0]]
            assert found is not None
            assert (found.iteration, found.field) == (5, names[0])
            assert found.values == (values[5].item(), values[2].item())
        else:
            assert found is None

    def picture(self) -> None:
        fields = [name for name in self.expected if not name.startswith("desired.")][-3:]
        figure = plot({"robot": self.history}, fields)
        curves = [axes.get_lines()[0].get_ydata() for axes in figure.axes]
        for name, curve in zip(fields, curves, strict=True):
            assert np.array_equal(curve, self.expected[name]), name

    def page(self) -> None:
        """Checks the numbers and curves of `o80 view`."""
        panels = Panels(self.history.schema)
        labels = {(str(number), label) for label, number in labels_of(self.history).items()}
        for name in panels.names[:12]:
            parts = panels.curves(self.history, [name], 0)[name]
            texts = panels.values(self.history[4], [name])[name]
            for part, (_, curve) in parts.items():
                column = name if part == "extended" else f"{part}.{name}"
                values = self.expected[column]
                assert curve == packed(values.astype(np.float64)), column
                shown = texts[part]
                if values.dtype.kind == "f":
                    assert np.array_equal(float(shown), float(values[4]), equal_nan=True), column
                elif isinstance(shown, int | float):
                    assert shown == values[4], column
                else:
                    assert shown == str(values[4]) or (str(values[4]), shown) in labels


def between(values: NDArray[Any], share: NDArray[np.float64]) -> NDArray[Any]:
    older, newer = values[:-1], values[1:]
    if values.dtype.kind != "f":
        return older
    mixed: NDArray[Any] = (older + (newer - older) * share).astype(values.dtype)
    return mixed


def part(columns: Columns, rows: slice) -> Columns:
    return {name: values[rows] for name, values in columns.items()}


def same(expected: Columns, found: Mapping[str, Any]) -> None:
    for name, values in expected.items():
        assert np.array_equal(np.asarray(found[name]), values), name


def labels_of(history: o80.History) -> dict[str, int]:
    """Maps all labels of enumerations to numbers."""
    return {each.name: each.value for enum in history._layout.enums.values() for each in enum}


def as_numbers(frame: Any, labels: Mapping[str, int]) -> dict[str, Any]:
    return {
        name: [labels[label] for label in column] if column.dtype == "category" else column
        for name, column in frame.items()
    }


def played(path: Path, segment: str, expected: Columns) -> None:
    with o80.play(path, prefix="again-", speed=math.inf) as playback:
        assert playback.wait(WAIT)
        with o80.Frontend(f"again-{segment}", dead=True) as frontend:
            same(expected, columns_in(frontend.history()))


def messages_of(path: Path, topic: str) -> list[tuple[int, Any]]:
    """Log times and messages of a topic."""
    with AnyReader([path]) as reader:
        return [
            (time, reader.deserialize(raw, each.msgtype))
            for each, time, raw in reader.messages()
            if each.topic == topic
        ]


def messages(path: Path, segment: str, expected: Columns) -> None:
    """Checks the messages with the libraries mcap and rosbags."""
    topic = topic_of(segment)
    with AnyReader([path]) as reader:
        found = [bytes(raw) for each, _, raw in reader.messages() if each.topic == topic]
    with path.open("rb") as file:
        of_mcap = [message.data for _, _, message in make_reader(file).iter_messages([topic])]
    assert of_mcap == found
    for i, (_, row) in enumerate(messages_of(path, topic)):
        parts = (getattr(row, name, []) for name in ("desired", "observed", "extended"))
        assert leaves([*parts]) == [values[i] for values in expected.values()]


def leaves(value: Any) -> list[Any]:
    """Lists all numbers of a decoded message, in order."""
    if isinstance(value, np.ndarray):
        return value.ravel().tolist()
    if isinstance(value, list):
        return [number for each in value for number in leaves(each)]
    if hasattr(value, "__dataclass_fields__"):
        fields = [name for name in value.__dataclass_fields__ if name.islower() and name[0] != "_"]
        return [number for name in fields for number in leaves(getattr(value, name))]
    return [value]


def files(history: o80.History, folder: Path, expected: Columns) -> None:
    for suffix in (".npz", ".h5", ".parquet", ".csv"):
        write(folder / f"run{suffix}", {"robot": history})
    with (folder / "run.csv").open(newline="") as file:
        rows = [*csv.DictReader(file)]
    texts = {name: [*map(str, values.tolist())] for name, values in expected.items()}
    assert {name: [row[name] for row in rows] for name in texts} == texts
    arrays = np.load(folder / "run.npz").items()
    same(expected, {name.removeprefix("robot/"): values for name, values in arrays})
    with h5py.File(folder / "run.h5") as file:
        same(expected, {name: values[:] for name, values in file["robot"].items()})
    table = pyarrow.parquet.read_table(folder / "run.parquet")
    same(expected, {name: table[name].to_numpy() for name in table.column_names})


def data_sets(path: Path, folder: Path, expected: Columns) -> None:
    """Checks episodes for learning."""
    parts = {
        part: np.array([v for name, v in expected.items() if name.startswith(part)], np.float64).T
        for part in ("desired.", "observed.", "extended.")
    }
    found = episodes_of(o80.open(path))
    minari.write(folder / "minari", found)
    (episode,) = MinariDataset(folder / "minari/data").iterate_episodes()
    seen = [parts[part] for part in ("observed.", "extended.") if parts[part].size]
    assert np.array_equal(episode.observations, np.hstack(seen))
    assert np.array_equal(episode.actions, parts["desired."][1:])

    sensors = ["extended"] if parts["extended."].size else []
    lerobot.write(folder / "lerobot", found, sensors=sensors, units="native")
    frames = pyarrow.parquet.read_table(folder / "lerobot/data/chunk-000/file-000.parquet")
    features = json.loads((folder / "lerobot/meta/info.json").read_text())["features"]
    for name, part, rows in (
        ("action", "desired.", slice(1, None)),
        ("observation.state", "observed.", slice(-1)),
        ("observation.environment_state", "extended.", slice(-1)),
    ):
        if parts[part].size:
            names = [each.removeprefix(part) for each in expected if each.startswith(part)]
            if part == "extended.":
                assert features[name]["names"] == names
            assert len(features[name]["names"]) == len(names)
            values = np.array(frames[name].to_pylist(), np.float32).reshape(len(frames), -1)
            assert np.array_equal(values, parts[part][rows].astype(np.float32))
