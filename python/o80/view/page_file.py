"""Writes a recording as one file that any browser opens from disk, without o80 or a network.

It is the page of `o80 view` with all data that the page would request: poses 60 times a second; the
first, lowest and highest row of each curve in each sixtieth, as float32; and plans of chunks.
"""

import base64
import gzip
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.errors import Error, InvalidArgument, RecordingError
from o80.base.finite import json_text
from o80.rows.columns import columns_of
from o80.rows.history import values_of
from o80.rows.plans import Planned
from o80.view.answers import SLACK, Shown, first_of, others_of
from o80.view.recorded_source import MOST_ROWS_OF_PLANS
from o80.view.server import page_text
from o80.view.source import Source
from o80.view.source_list import SourceList

RATE = 60  # rate of drawn poses [Hz]
LARGEST = 100e6  # largest file [bytes]
BYTES_PER_NUMBER = 2.8  # in the file, as measured: compressed, as text
MOVED = 14  # numbers of the pose of a body and of its ghost
MAX_TRIANGLES = 4000  # of a mesh
PLANNED = 4  # points of plans for each tick, at most
SECONDS = 1e-9


def write_page(names: Sequence[str], path: Path, *, model_files: bool = False) -> int:
    """Writes a page of recordings into a new file. Returns its size [bytes].

    model_files: read the files (meshes) that the models of the recordings name.
    Raises InvalidArgument for a name that is no recording, an existing file, and a recording that
    is too long; RecordingError for an unreadable recording.
    """
    for name in names:
        if not (name.endswith(".mcap") or Path(name).is_dir()):
            raise InvalidArgument(
                f"--html shows recordings, got '{name}': `o80 record {name} -o {name}.mcap` first"
            )
    if not names:
        raise InvalidArgument("--html shows recordings: name one")
    if path.exists():
        raise InvalidArgument(f"{path} exists. Choose another name, or remove it")
    sources = [each for each in SourceList(names, model_files=model_files).now() if _has_rows(each)]
    if not sources:
        raise RecordingError(f"{', '.join(names)}: no segment has a row to show")
    expected = sum(map(_expected, sources))
    if expected > LARGEST:
        raise InvalidArgument(
            f"the page would take about {expected / 1e6:.0f} MB, more than {LARGEST / 1e6:.0f}: "
            f"choose a part of the recording first, for example with "
            f"`o80 cut {names[0]} --from 0 --to 60 -o part.mcap`"
        )
    text = page_text(_packed_sources(sources)).html
    try:
        with path.open("xb") as file:
            try:
                file.write(text)
                file.flush()
            except OSError:
                path.unlink(missing_ok=True)
                raise
    except OSError as error:
        raise Error(f"{path} cannot be written: {error.strerror}") from error
    return len(text)


def _has_rows(source: Source) -> bool:
    try:
        source.extent()
    except Error:
        return False
    return True


def _expected(source: Source) -> float:
    """Estimates the size of a source in the file [bytes]."""
    first, last = source.extent()
    drawn = min((last - first) * SECONDS * RATE, (last - first) / source.schema["period"])
    moving = 0 if source.drawn is None else len(source.drawn.described["values"])
    columns = len(list(columns_of(source.schema)))
    return float(drawn * (MOVED * moving + 1.5 * columns) * BYTES_PER_NUMBER)


class _Numbers:
    """Arrays one behind the other; JSON refers to each by its offset."""

    def __init__(self) -> None:
        self.content = bytearray()

    def add(self, numbers: Any, kind: str) -> dict[str, Any]:
        array = np.ascontiguousarray(numbers, kind)
        place = len(self.content)
        # the first bytes of all numbers, then the second ones: they compress better
        planes = array.view(np.uint8).reshape(-1, array.itemsize).T
        self.content += planes.tobytes()
        return {"array": [place, array.size, kind]}


def _packed_sources(sources: Sequence[Source]) -> str:
    numbers = _Numbers()
    drawn = {source.label: _Recorded(source) for source in sources}
    opened = first_of(sources)
    whole = [
        drawn[source.label].described(numbers, drawn) | {"opened": source is opened}
        for source in sources
    ]
    head = json_text(whole).encode()
    content = len(head).to_bytes(4, "little") + head + numbers.content
    return base64.b64encode(gzip.compress(content, 9, mtime=0)).decode()


class _Recorded:
    """One run, with the rows that are drawn."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.shown = Shown(source, source.schema)
        self.rows = source.rows(*source.extent())
        stretch = (self.rows.time - self.rows.time[0]) * RATE // 1_000_000_000
        self.ticks = np.flatnonzero(np.diff(stretch, prepend=-1))  # first row of each stretch
        self.times: NDArray[np.int64] = self.rows.time[self.ticks]

    def described(self, numbers: _Numbers, everything: "dict[str, _Recorded]") -> dict[str, Any]:
        """Returns all data that a page may request about the run, and adds their numbers."""
        source, rows = self.source, self.rows
        first, last = source.extent()
        micro = np.round((rows.time - first) / 1000).astype(np.int64)
        begins = dict(zip(rows.iteration.tolist(), range(len(rows)), strict=True))
        new = self.shown.introduction(source)
        if new["scene"] is not None:
            new["scene"] = new["scene"] | {"meshes": _thinned(new["scene"]["meshes"])}
        return {
            "line": source.state(),
            "key": source.key,
            "first": source.seconds(first),
            "last": source.seconds(last),
            "new": new,
            "marks": [
                [micro[begins[iteration]] * 1e-6, text]
                for text, iteration in source.marks()
                if iteration in begins
            ],
            "times": numbers.add(np.diff(micro, prepend=0), "u4"),  # [us], each after the last
            "ticks": numbers.add(np.diff(self.ticks, prepend=0), "u4"),
            "iterations": numbers.add(rows.iteration[self.ticks], "f8"),
            "halted": numbers.add([bool(rows[int(tick)].halted) for tick in self.ticks], "u1"),
            "columns": self._columns(numbers),
            "planned": self._planned(numbers),
            "others": self._others(numbers, everything),
            **self._poses(numbers),
        }

    def _poses(self, numbers: _Numbers) -> dict[str, Any]:
        scene = self.shown.scene
        if scene is None:
            return {"pose": None, "ghost": None}
        poses: dict[str, list[Any]] = {"pose": [], "ghost": []}
        for tick in self.ticks.tolist():
            row: Any = self.rows[tick]
            found = scene.poses(row)
            for kind, texts in poses.items():
                if found[kind] is not None:
                    texts.append(np.frombuffer(base64.b64decode(found[kind]), "f4"))
        # by number of the pose, then by tick
        return {
            kind: numbers.add(np.array(texts).T, "f4") if texts else None
            for kind, texts in poses.items()
        }

    def _columns(self, numbers: _Numbers) -> dict[str, Any]:
        """Returns by panel and part: kept rows, each relative to the previous one, and values."""
        found: dict[str, Any] = {}
        for panel, parts in self.shown.panels.columns.items():
            found[panel] = {}
            for part, column in parts.items():
                values = values_of(self.rows, column)
                rows = self._kept(values)
                exact = values.dtype.kind in "iu" and values.dtype.itemsize > 2
                found[panel][part] = [
                    numbers.add(np.diff(rows, prepend=0), "u4"),
                    numbers.add(values[rows], "f8" if exact else "f4"),
                ]
        return found

    def _planned(self, numbers: _Numbers) -> dict[str, Any]:
        """Returns by panel: first point of each plan, relative to the previous one, and the points:
        times [s] and places.
        """
        rows = self.rows[-MOST_ROWS_OF_PLANS:]
        period = self.source.schema["period"]
        stride = max(1, round(1e9 / period / RATE))

        def drawn(plan: Planned) -> NDArray[np.intp]:
            last = len(plan.places) - 1
            return np.append(np.arange(0, last, stride), last)

        def times(plan: Planned) -> NDArray[np.float64]:
            iterations = plan.begins + drawn(plan)
            within = np.interp(iterations, rows.iteration, rows.time - self.rows.time[0])
            beyond = np.maximum(iterations - rows.iteration[-1], 0) * period
            seconds: NDArray[np.float64] = (within + beyond) * SECONDS
            return seconds

        found: dict[str, Any] = {}
        for panel, plans in self.source.plans(rows).items():
            points = sum(len(drawn(each)) for each in plans)
            plans = plans[:: max(1, -(-points // (PLANNED * len(self.ticks))))]
            lengths = [len(drawn(each)) for each in plans]
            found[panel] = [
                numbers.add([0, *lengths[:-1]], "u4"),
                numbers.add(np.concatenate([times(each) for each in plans]), "f8"),
                numbers.add(np.concatenate([each.places[drawn(each)] for each in plans]), "f4"),
            ]
        return found

    def _kept(self, values: NDArray[Any]) -> NDArray[np.intp]:
        """Returns indices of the rows that draw a curve: of each stretch the first row, and the
        first lowest, highest and NaN row; and the last row of all.
        """
        lengths = np.diff(self.ticks, append=len(values))
        wanted = [
            values == np.repeat(extreme.reduceat(values, self.ticks), lengths)
            for extreme in (np.fmin, np.fmax)
        ]
        kept: list[Any] = [self.ticks, [len(values) - 1]]
        for rows in (*wanted, values != values):
            first = np.minimum.reduceat(
                np.where(rows, np.arange(len(values)), len(values)), self.ticks
            )
            kept.append(first[first < len(values)])
        return np.unique(np.concatenate(kept))

    def _others(self, numbers: _Numbers, everything: "dict[str, _Recorded]") -> dict[str, Any]:
        """Returns by other run whether it shares the world, and its tick at each tick; -1: none."""
        found: dict[str, Any] = {}
        sources = [each.source for each in everything.values()]
        for label, other in everything.items():
            if other is self or other.shown.scene is None:
                continue
            ticks = np.full(len(self.ticks), -1)
            for i, tick in enumerate(self.ticks.tolist()):
                time = other.source.time_with(self.source, self.rows[tick])
                if time is None:
                    break
                if other.times[0] - SLACK <= time <= other.rows.time[-1] + SLACK:
                    ticks[i] = max(0, np.searchsorted(other.times, time, side="right") - 1)
            there = np.flatnonzero(ticks >= 0)
            if len(there):
                row = self.rows[int(self.ticks[there[0]])]
                together = others_of(self.source, sources, row, now=False)
                shares = any(each is other.source and both for each, _, both in together)
                found[label] = {"shares": shares, "ticks": numbers.add(ticks, "i4")}
        return found


def _thinned(meshes: dict[int, dict[str, str]]) -> dict[int, dict[str, str]]:
    """Reduces the triangles of meshes: joins points that are near to each other."""
    from o80.view.base64_arrays import packed, packed_indices

    found = {}
    for number, mesh in meshes.items():
        points = np.frombuffer(base64.b64decode(mesh["vertices"]), "f4").reshape(-1, 3)
        faces = np.frombuffer(base64.b64decode(mesh["faces"]), "u4").reshape(-1, 3)
        cells = 128
        while len(faces) > MAX_TRIANGLES and cells > 2:
            size = max(float(np.ptp(points, axis=0).max()), 1e-9) / cells
            cell, of = np.unique(np.round(points / size), axis=0, return_inverse=True)
            of = of.reshape(-1)
            sums = np.zeros((len(cell), 3))
            np.add.at(sums, of, points)
            points = (sums / np.bincount(of)[:, None]).astype("f4")
            faces = of[faces]
            a, b, c = faces.T
            faces = faces[(a != b) & (b != c) & (a != c)]
            cells = cells * 3 // 4
        found[number] = {"vertices": packed(points), "faces": packed_indices(faces)}
    return found
