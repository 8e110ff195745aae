"""Episodes as a LeRobot data set: its documented format v3.0, Parquet tables and JSON.

Written without LeRobot, which is large; it reads the result:
`LeRobotDataset("o80/NAME", root=path)`.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.base.extras import needed
from o80.base.finite import Say, json_text, say_not_finite, warn
from o80.datasets.episodes import Episode, Episodes

VERSION = "v3.0"
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"
TASKS = "meta/tasks.parquet"
Columns = dict[str, NDArray[Any]]


def write(path: Path, episodes: Episodes, say: Say = warn) -> None:
    """Writes a folder, which must not exist. Raises InvalidArgument, MissingExtra, OSError.

    observation.state is observed, observation.environment_state the sensor values, action the
    desired states that were reached with the step; next.reward and next.done are those of the step.
    action.delay is the decision latency of each action [s], -1 where it is not known; only if
    actions were sent with `pulse(seen=row)`.
    """
    needed("pyarrow", "export", "a LeRobot data set")
    if path.exists():
        raise InvalidArgument(f"{path} exists: a data set is written to a new folder")
    tasks = list(dict.fromkeys(episode.task for episode in episodes.all))
    features = _features(episodes)
    frames, rows, first = [], [], 0
    for number, episode in enumerate(episodes.all):
        columns = _frames(episode, number, first, tasks.index(episode.task), features)
        frames.append(columns)
        rows.append(_row(episode, number, first, columns))
        first += len(episode)
    (path / "meta/episodes/chunk-000").mkdir(parents=True)
    (path / "data/chunk-000").mkdir(parents=True)
    _write_frames(path / DATA.format(chunk_index=0, file_index=0), frames, features)
    _write_table(path / EPISODES, rows)
    _write_tasks(path / TASKS, tasks)
    _write_json(path / "meta/info.json", _info(episodes, features, first, len(tasks)))
    say_not_finite(_not_finite(features, frames), "left out of the statistics", say)
    whole = {name: np.concatenate([each[name] for each in frames]) for name in features}
    _write_json(path / "meta/stats.json", {name: _stats(v) for name, v in whole.items()})


def _not_finite(
    features: Mapping[str, dict[str, Any]], frames: Sequence[Columns]
) -> dict[str, int]:
    """How many values of each number are not finite."""
    found = {}
    for name, each in features.items():
        values = np.concatenate([columns[name] for columns in frames])
        counts = (~np.isfinite(values.reshape(len(values), -1))).sum(axis=0).tolist()
        for number, count in zip(each["names"] or [""], counts, strict=True):
            found[f"{name} {number}".strip()] = count
    return found


def _features(episodes: Episodes) -> dict[str, dict[str, Any]]:
    """Every column of the frames: type, shape, and the names of its numbers."""
    vectors = {
        "action": episodes.names["desired"],
        "observation.state": episodes.names["observed"],
        "observation.environment_state": episodes.names["extended"],
    }
    features: dict[str, dict[str, Any]] = {
        name: {"dtype": "float32", "shape": [len(numbers)], "names": list(numbers)}
        for name, numbers in vectors.items()
        if numbers
    }
    says = any(np.isfinite(episode.delays).any() for episode in episodes.all)
    for name, dtype in (
        *([("action.delay", "float32")] if says else []),
        ("next.reward", "float32"),
        ("next.done", "bool"),
        ("timestamp", "float32"),
        ("frame_index", "int64"),
        ("episode_index", "int64"),
        ("index", "int64"),
        ("task_index", "int64"),
    ):
        features[name] = {"dtype": dtype, "shape": [1], "names": None}
    return features


def _frames(
    episode: Episode, number: int, first: int, task: int, features: Mapping[str, Any]
) -> Columns:
    """The columns of an episode: one frame for each step."""
    steps = np.arange(len(episode))
    times = (episode.rows.time[:-1] - episode.rows.time[0]) * 1e-9
    columns = {
        "action": episode.actions,
        "observation.state": episode.observed[:-1],
        "observation.environment_state": episode.extended[:-1],
        "action.delay": np.nan_to_num(episode.delays, nan=-1.0),
        "next.reward": episode.rewards,
        "next.done": steps == len(episode) - 1,
        "timestamp": times,
        "frame_index": steps,
        "episode_index": np.full(len(episode), number),
        "index": first + steps,
        "task_index": np.full(len(episode), task),
    }
    with np.errstate(over="ignore"):  # what is too large for 32 bits is infinite, and is said
        return {name: columns[name].astype(each["dtype"]) for name, each in features.items()}


def _row(episode: Episode, number: int, first: int, columns: Columns) -> dict[str, Any]:
    """Row about an episode: where its frames are, and their statistics."""
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
    """Statistics of the finite values of each number of a column; None if it has none."""
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
    """One row group for each episode, so that readers can take one."""
    import pyarrow as arrow
    import pyarrow.parquet as parquet

    kinds = {"float32": arrow.float32(), "int64": arrow.int64(), "bool": arrow.bool_()}
    schema = arrow.schema(
        [
            (
                name,
                kinds[each["dtype"]]
                if each["shape"] == [1] and each["names"] is None
                else arrow.list_(kinds[each["dtype"]], each["shape"][0]),
            )
            for name, each in features.items()
        ]
    )
    with parquet.ParquetWriter(path, schema) as writer:
        for columns in frames:
            arrays = [
                arrow.array(columns[field.name].reshape(-1), kinds[features[field.name]["dtype"]])
                for field in schema
            ]
            for i, field in enumerate(schema):
                if arrow.types.is_fixed_size_list(field.type):
                    arrays[i] = arrow.FixedSizeListArray.from_arrays(
                        arrays[i], field.type.list_size
                    )
            writer.write_table(arrow.Table.from_arrays(arrays, schema=schema))


def _write_table(path: Path, rows: list[dict[str, Any]]) -> None:
    import pyarrow as arrow
    import pyarrow.parquet as parquet

    parquet.write_table(arrow.Table.from_pylist(rows), path)


def _write_tasks(path: Path, tasks: list[str]) -> None:
    """A table whose index, as pandas stores it, is the text of the task."""
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
