"""Reading recordings: both formats, their frames, what is wrong with a file."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from recorded_rows import frames_of_a_reader, rows_seen, simulated_shot, write_ball_gun, write_shots

from o80_table_tennis.balls.frame_stamps import FRAME_PERIOD
from o80_table_tennis.balls.recordings import LAUNCHER_FRAME, load_trajectories


def test_a_json_file_is_read_into_the_world_with_stamps(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    frames = frames_of_a_reader(rng, 1.25)
    rows = rows_seen(rng, frames, noise=0.001, lag=0.025)
    repeated = np.insert(rows, 40, rows[39], axis=0)

    (shot,) = load_trajectories(write_ball_gun(tmp_path / "shot.json", repeated))

    assert shot.name == "shot"
    np.testing.assert_allclose(shot.positions, rows[:, :3], atol=1e-12)
    np.testing.assert_allclose(shot.stamps, (frames - frames[0]) * FRAME_PERIOD)


def test_the_shots_of_an_hdf5_file_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    shots = {str(i): simulated_shot(np.random.default_rng(i)) for i in (10, 2, 1)}
    file = write_shots(tmp_path / "shots.hdf5", shots)

    read = load_trajectories(file)

    assert [shot.name for shot in read] == ["shots/1", "shots/2", "shots/10"]
    for seen, there, offset in (
        (read[2].positions, shots["10"].positions, LAUNCHER_FRAME.offset),
        (read[2].velocities, shots["10"].velocities, 0.0),
    ):
        turned = np.column_stack([there[:, 1], -there[:, 0], there[:, 2]])  # by -90 degrees
        np.testing.assert_allclose(seen, turned + np.array(offset), atol=1e-12)
    np.testing.assert_array_equal(read[2].stamps, shots["10"].stamps)


def test_a_folder_gives_all_its_files_in_order(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    rows = rows_seen(rng, frames_of_a_reader(rng, 1.25), noise=0.001, lag=0.025)
    for name in ("b", "a"):
        write_ball_gun(tmp_path / f"{name}.json", rows)
    write_shots(tmp_path / "c.hdf5", {"0": simulated_shot(rng)})
    (tmp_path / "LICENSE").write_text("text")

    assert [shot.name for shot in load_trajectories(tmp_path)] == ["a", "b", "c/0"]


GOOD_ROW = [0.0, 0.0, 0.0, 0.0, -4.0, 1.0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "not JSON"),
        ("[1, 2]", '"ob"'),
        ('{"balls": []}', "balls"),
        ('{"ob": []}', "shape"),
        ('{"ob": [[1, 2, 3]]}', r"\(1, 3\)"),
        ('{"ob": [[1, 2, 3], [1]]}', "6 numbers"),
        ('{"ob": [["x", 2, 3, 4, 5, 6]]}', "6 numbers"),
        (json.dumps({"ob": [GOOD_ROW] * 50}), "too few"),
        (json.dumps({"ob": [[i, *GOOD_ROW[1:]] for i in range(5)]}), "too few"),
        (json.dumps({"ob": [[i, *GOOD_ROW[1:5], float("nan")] for i in range(50)]}), "NaN"),
    ],
)
def test_a_bad_json_file_is_named_with_what_is_wrong(
    tmp_path: Path, content: str, message: str
) -> None:
    file = tmp_path / "bad.json"
    file.write_text(content)

    with pytest.raises(ValueError, match=message) as raised:
        load_trajectories(file)
    assert str(file) in str(raised.value)


def test_a_bad_hdf5_file_is_named_with_what_is_wrong(tmp_path: Path) -> None:
    text = tmp_path / "text.hdf5"
    text.write_text("no")
    with pytest.raises(ValueError, match=r"text\.hdf5: not HDF5"):
        load_trajectories(text)

    empty = tmp_path / "empty.h5"
    h5py.File(empty, "w").close()
    with pytest.raises(ValueError, match=r'empty\.h5: no group "originals"'):
        load_trajectories(empty)

    partial = tmp_path / "partial.h5"
    with h5py.File(partial, "w") as file:
        file["originals/0/positions"] = np.zeros((20, 3))
    with pytest.raises(ValueError, match=r"partial\.h5/originals/0: no velocities, time_stamps"):
        load_trajectories(partial)

    odd = tmp_path / "odd.h5"
    with h5py.File(odd, "w") as file:
        for key, rows in (("positions", (20, 2)), ("velocities", (20, 3)), ("time_stamps", (20,))):
            file[f"originals/0/{key}"] = np.zeros(rows)
    with pytest.raises(ValueError, match=r"odd\.h5/originals/0: positions have shape \(20, 2\)"):
        load_trajectories(odd)


def test_a_missing_path_an_empty_folder_and_a_foreign_file_are_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere"):
        load_trajectories(tmp_path / "nowhere")
    with pytest.raises(FileNotFoundError, match="no recordings"):
        load_trajectories(tmp_path)
    (tmp_path / "balls.csv").write_text("")
    with pytest.raises(ValueError, match="unknown format"):
        load_trajectories(tmp_path / "balls.csv")
