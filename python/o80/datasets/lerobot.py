"""Writes episodes as a LeRobot data set: its documented format v3.0, Parquet tables and JSON.

Writing does not need LeRobot, which is large; LeRobot reads the result:
`LeRobotDataset("o80/NAME", root=path)`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.base.extras import needed
from o80.base.finite import Say, json_text, say_not_finite, warn
from o80.datasets.episodes import Episode, Episodes
from o80.datasets.lerobot_numbers import Number, Units, numbers_of, sensor, values_in
from o80.rows.columns import Column, chosen, columns_of_part
from o80.rows.history import History, values_of
from o80.rows.history import numbers_of as numbers_in

VERSION = "v3.0"
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"
TASKS = "meta/tasks.parquet"
EXTRA = "complementary_info."
"""Prefix of columns for no policy: LeRobot gives policies all `observation` and `action`."""
Columns = dict[str, NDArray[Any]]


def write(
    path: Path,
    episodes: Episodes,
    say: Say = warn,
    *,
    state: Sequence[str] = (),
    action: Sequence[str] = (),
    sensors: Sequence[str] = (),
    units: Units | None = None,
    action_is: Literal["acted", "asked"] = "acted",
) -> None:
    """Writes a folder, which must not exist; docs/lerobot.md lists all columns.

    state, action: actuators or fields of their states in observation.state, which is observed, and
        in action (empty: all).
    sensors: sensor values in observation.environment_state, also "observed" (empty: none).
    units: of states and actions: "degrees", "normalised" or "native" (None: those of LeRobot's
        driver of this arm, else "native").
    action_is: "acted": the desired states at the end of the step; "asked": the targets of the
        commands. The other actions are in complementary_info.action_asked or .action_acted.

    Raises InvalidArgument for an existing folder or unknown fields, MissingExtra, OSError.
    """
    arrow = needed("pyarrow", "export", "a LeRobot data set")
    if path.exists():
        raise InvalidArgument(f"{path} exists: give a new folder for the data set")
    chosen_numbers = _Chosen.of(episodes, state, action, sensors, units, action_is)
    tasks = list(dict.fromkeys(episode.task for episode in episodes.all))
    features = _features(episodes, chosen_numbers)
    frames, rows, first = [], [], 0
    for number, episode in enumerate(episodes.all):
        columns = {
            **chosen_numbers.columns(episode),
            **_indices(episode, number, first, tasks.index(episode.task), episodes.frequency),
        }
        frames.append(_typed(columns, features))
        rows.append(_row(episode, number, first, frames[-1]))
        first += len(episode)
    (path / "meta/episodes/chunk-000").mkdir(parents=True)
    (path / "data/chunk-000").mkdir(parents=True)
    _write_frames(path / DATA.format(chunk_index=0, file_index=0), frames, features)
    needed("pyarrow.parquet", "export", "a LeRobot data set").write_table(
        arrow.Table.from_pylist(rows), path / EPISODES
    )
    _write_tasks(path / TASKS, tasks)
    _write_json(path / "meta/info.json", _info(episodes, features, first, len(tasks)))
    say_not_finite(_not_finite(features, frames), "left out of the statistics", say)
    whole = {name: np.concatenate([each[name] for each in frames]) for name in features}
    _write_json(path / "meta/stats.json", {name: _stats(v) for name, v in whole.items()})


@dataclass(frozen=True)
class _Chosen:
    """Chosen numbers of the rows, for the columns of the data set."""

    state: Sequence[Number]
    action: Sequence[Number]
    sensors: Sequence[Number]
    captures: Mapping[str, Column | None]  #: capture times by origin; None: the row's own time
    action_is: Literal["acted", "asked"]

    @classmethod
    def of(
        cls,
        episodes: Episodes,
        state: Sequence[str],
        action: Sequence[str],
        sensors: Sequence[str],
        units: Units | None,
        action_is: Literal["acted", "asked"],
    ) -> "_Chosen":
        if action_is not in ("acted", "asked"):
            raise InvalidArgument(f"action_is must be 'acted' or 'asked', got {action_is!r}")
        schema = episodes.all[0].rows.schema
        extended = columns_of_part(schema, "extended")
        names = [each.name for each in extended]
        observed = [each for each in sensors if each.partition(".")[0] == "observed"]
        others = [each for each in sensors if each not in observed]
        wanted = set(chosen(episodes.segment, names, others)) if others else set()
        stamps: dict[str, Column | None] = {
            each.name.removeprefix("extended.").rpartition(".")[0] or "sensors": each
            for each in extended
            if each.name.endswith(".capture_time") and each.origin != "absent"
        }
        return cls(
            numbers_of(schema, "observed", units, state),
            numbers_of(schema, "desired", units, action),
            [
                *(numbers_of(schema, "observed", units, observed) if observed else ()),
                *(sensor(each) for each in extended if each.name in wanted),
            ],
            stamps or {"state": None},
            action_is,
        )

    @property
    def other(self) -> str:
        """Name of the column with the actions that `action` does not hold."""
        return f"{EXTRA}action_{'asked' if self.action_is == 'acted' else 'acted'}"

    def columns(self, episode: Episode) -> Columns:
        """Returns the columns of an episode: (T,) or (T, numbers)."""
        rows = episode.rows[:-1]
        acted = episode.rows[1:]
        wanted = [number.column for number in self.action]
        desired = numbers_in(acted, wanted)
        asked = episode.asked(wanted)
        both = {"acted": desired, "asked": np.where(np.isnan(asked), desired, asked)}
        action = both.pop(self.action_is)
        (other,) = both.values()
        captured = [
            rows.time if stamp is None else values_of(rows, stamp)
            for stamp in self.captures.values()
        ]
        captures = np.stack(captured, axis=1)
        begin = episode.rows.time[0]
        return {
            "action": values_in(self.action, action),
            "observation.state": _observed(rows, self.state),
            "observation.environment_state": _observed(rows, self.sensors),
            self.other: values_in(self.action, other),
            f"{EXTRA}time": (rows.time - begin) * 1e-9,
            f"{EXTRA}capture_time": (captures - begin) * 1e-9,
            f"{EXTRA}age": (rows.time[:, None] - captures) * 1e-9,
            f"{EXTRA}delay": np.nan_to_num(episode.delays, nan=-1.0),
        }


def _observed(rows: History, numbers: Sequence[Number]) -> NDArray[np.float64]:
    """Returns numbers of rows (T, numbers) in LeRobot's units."""
    return values_in(numbers, numbers_in(rows, [number.column for number in numbers]))


def _not_finite(
    features: Mapping[str, dict[str, Any]], frames: Sequence[Columns]
) -> dict[str, int]:
    """Counts the values of each number that are not finite."""
    found = {}
    for name, each in features.items():
        values = np.concatenate([columns[name] for columns in frames])
        counts = (~np.isfinite(values.reshape(len(values), -1))).sum(axis=0).tolist()
        for number, count in zip(each["names"] or [""], counts, strict=True):
            found[f"{name} {number}".strip()] = count
    return found


def _features(episodes: Episodes, numbers: _Chosen) -> dict[str, dict[str, Any]]:
    """Describes every column of the frames: type, shape, names of its numbers."""
    action = [number.name for number in numbers.action]
    sensors = [number.name for number in numbers.sensors]
    captures = list(numbers.captures)
    says = any(np.isfinite(episode.delays).any() for episode in episodes.all)
    described: tuple[tuple[str, str, list[str] | None], ...] = (
        ("action", "float32", action),
        ("observation.state", "float32", [number.name for number in numbers.state]),
        ("observation.environment_state", "float32", sensors),
        (numbers.other, "float32", action),
        (f"{EXTRA}time", "float64", None),
        (f"{EXTRA}capture_time", "float64", captures),
        (f"{EXTRA}age", "float64", captures),
        *([(f"{EXTRA}delay", "float32", None)] if says else []),
        ("next.reward", "float32", None),
        ("next.done", "bool", None),
        ("timestamp", "float32", None),
        ("frame_index", "int64", None),
        ("episode_index", "int64", None),
        ("index", "int64", None),
        ("task_index", "int64", None),
    )
    return {
        name: {"dtype": dtype, "shape": [1 if names is None else len(names)], "names": names}
        for name, dtype, names in described
        if names != []
    }


def _indices(episode: Episode, number: int, first: int, task: int, frequency: float) -> Columns:
    """Returns columns (T,) that place an episode's frames; times k / fps, as LeRobot checks."""
    steps = np.arange(len(episode))
    return {
        "next.reward": episode.rewards,
        "next.done": steps == len(episode) - 1,
        "timestamp": steps / round(frequency, 5),
        "frame_index": steps,
        "episode_index": np.full(len(episode), number),
        "index": first + steps,
        "task_index": np.full(len(episode), task),
    }


def _typed(columns: Columns, features: Mapping[str, Any]) -> Columns:
    with np.errstate(over="ignore"):  # too large numbers become infinite, which is reported
        return {name: columns[name].astype(each["dtype"]) for name, each in features.items()}


def _row(episode: Episode, number: int, first: int, columns: Columns) -> dict[str, Any]:
    """Makes the table row of an episode: place of its frames, and their statistics."""
    row: dict[str, Any] = {
        "episode_index": number,
        "tasks": [episode.task],
        "length": len(episode),
        "data/chunk_index": 0,
        "data/file_index": 0,
        "dataset_from_index": first,
        "dataset_to_index": first + len(episode),
        "meta/episodes/chunk_index": 0,
        "meta/episodes/file_index": 0,
    }
    for name, values in columns.items():
        row |= {f"stats/{name}/{key}": value for key, value in _stats(values).items()}
    return row


def _stats(values: NDArray[Any]) -> dict[str, list[float | None]]:
    """Computes statistics of the finite values of each number in a column; None without any."""
    numbers = values.reshape(len(values), -1).astype(np.float64)
    finite = [number[np.isfinite(number)] for number in numbers.T]

    def each(statistic: Callable[[NDArray[np.float64]], Any]) -> list[float | None]:
        return [float(statistic(number)) if number.size else None for number in finite]

    stats = {"min": each(np.min), "max": each(np.max), "mean": each(np.mean), "std": each(np.std)}
    stats["count"] = [len(values)]
    for percent in (1, 10, 50, 90, 99):
        stats[f"q{percent:02d}"] = each(partial(np.percentile, q=percent))
    return stats


def _info(episodes: Episodes, features: Mapping[str, Any], frames: int, tasks: int) -> Any:
    frequency = round(episodes.frequency, 5)  # a period is in whole ns
    return {
        "codebase_version": VERSION,
        "robot_type": episodes.robot,
        "total_episodes": len(episodes.all),
        "total_frames": frames,
        "total_tasks": tasks,
        "chunks_size": 1000,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": int(frequency) if frequency.is_integer() else frequency,
        "splits": {"train": f"0:{len(episodes.all)}"},
        "data_path": DATA,
        "video_path": None,
        "features": features,
    }


# ---------------------------------------------------------------------------- files


def _write_frames(path: Path, frames: list[Columns], features: Mapping[str, Any]) -> None:
    """Writes one row group for each episode, so that readers can read one episode."""
    import pyarrow as arrow
    import pyarrow.parquet as parquet

    fields = []
    for name, each in features.items():
        kind, size = arrow.type_for_alias(each["dtype"]), each["shape"][0]
        # LeRobot reads columns of one number as plain numbers
        fields.append((name, kind if size == 1 else arrow.list_(kind, size)))
    schema = arrow.schema(fields)
    with parquet.ParquetWriter(path, schema) as writer:
        for columns in frames:
            arrays = []
            for name, kind in fields:
                flat = arrow.array(columns[name].reshape(-1))
                is_list = arrow.types.is_fixed_size_list(kind)
                made = arrow.FixedSizeListArray.from_arrays(flat, type=kind) if is_list else flat
                arrays.append(made)
            writer.write_table(arrow.Table.from_arrays(arrays, schema=schema))


def _write_tasks(path: Path, tasks: list[str]) -> None:
    """Writes a table whose index, as stored by pandas, is the text of the task."""
    import pyarrow as arrow
    import pyarrow.parquet as parquet

    table = arrow.table({"task_index": list(range(len(tasks))), "task": tasks})
    columns = [
        {
            "name": name,
            "field_name": name,
            "pandas_type": kind,
            "numpy_type": numpy,
            "metadata": None,
        }
        for name, kind, numpy in (("task_index", "int64", "int64"), ("task", "unicode", "object"))
    ]
    pandas = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": columns,
        "pandas_version": "2.0.0",
    }
    parquet.write_table(table.replace_schema_metadata({"pandas": json_text(pandas)}), path)


def _write_json(path: Path, value: Any) -> None:
    path.write_text(json_text(value, indent=4) + "\n")
