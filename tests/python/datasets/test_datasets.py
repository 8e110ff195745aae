"""Episodes of recordings as data sets for learning, read by what reads them."""

import json
import time
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas
import pyarrow.parquet
import pytest
from processes import run_o80
from room_sensor import Obedient

import o80
from o80.cli.export import export
from o80.datasets import lerobot, minari
from o80.datasets.episodes import Episodes, episodes_of


@pytest.fixture
def recorded(arm: o80.Frontend, path: Path) -> Path:
    """Three episodes of 30, 20 and 20 steps; the second ends by itself, the last is cut."""
    with o80.Recording(path, arm) as recording:
        arm.burst(5)
        recording.mark("episode", task="swing", ball=3)
        arm.add_command("elbow", 0.3, iterations=30)
        arm.burst(10)
        recording.mark("touched", reward=0.25)
        arm.burst(20)
        recording.mark("episode")
        arm.burst(20)
        recording.mark("episode_end", reward=1.0)
        arm.request("reset", seed=1)
        arm.burst(1)
        recording.mark("episode")
        arm.burst(20)
    return path


def episodes(path: Path, **options: Any) -> Episodes:
    return episodes_of(o80.open(path), **options)


def test_marks_delimit_episodes_and_give_their_rewards(recorded: Path, segment: str) -> None:
    first, second, third = episodes(recorded).all
    history = o80.open(recorded)[segment].history(since=5, until=35)

    assert (first.rows.iteration[0], first.rows.iteration[-1]) == (5, 35)
    assert [len(each) for each in (first, second, third)] == [30, 20, 20]
    assert [each.terminated for each in (first, second, third)] == [False, True, False]
    assert [each.task for each in (first, second, third)] == ["swing", "two_joints", "two_joints"]
    assert first.values["ball"] == 3
    assert np.array_equal(first.observed, history.observed)
    assert np.array_equal(first.actions, history.desired[1:])
    assert np.array_equal(first.extended[:, 1:], history.extended.effort)
    assert first.rewards.nonzero()[0].tolist() == [9]  # after ten steps
    assert first.rewards[9] == 0.25
    assert second.rewards[-1] == second.rewards.sum() == 1.0


@pytest.mark.parametrize(
    "values",
    [{"reward": "high"}, {"reward": None}, {"reward": [1]}, {"rewards": 3.0}, {"rewards": ["a"]}],
)
def test_a_reward_that_is_no_number_is_refused(
    arm: o80.Frontend, path: Path, values: dict[str, Any]
) -> None:
    with o80.Recording(path, arm) as recording:
        recording.mark("episode")
        arm.burst(10)
        recording.mark("episode_end", **values)
    with pytest.raises(o80.InvalidArgument, match=r"the mark 'episode_end' at row 10 has reward"):
        episodes(path)


class Blinking:
    """A joint that gives no number in one row."""

    actuators = ("elbow", "wrist")
    simulated = True

    def __init__(self) -> None:
        self.rows = 0

    def write(self, desired: Any) -> None: ...

    def read(self, reading: Any) -> None:
        self.rows += 1
        reading.observed = [0.1 * self.rows, np.nan if self.rows == 5 else 1.0]


def test_statistics_leave_out_what_is_not_finite_and_say_so(
    segment: str, path: Path, tmp_path: Path
) -> None:
    with (
        o80.robots.load(Blinking).inline(segment) as arm,
        o80.Recording(path, arm) as recording,
    ):
        arm.burst(1)
        recording.mark("episode")
        arm.burst(10)
        recording.mark("episode_end", reward=1.0)
    exported = run_o80("export", str(path), "-o", str(tmp_path / "set"), "--format", "lerobot")
    assert "1 number is not finite, left out of the statistics" in exported.stderr
    assert "observation.state wrist.pos (1)" in exported.stderr
    text = (tmp_path / "set/meta/stats.json").read_text()
    stats = json.loads(text, parse_constant=lambda word: pytest.fail(word))
    assert stats["observation.state"]["mean"][1] == 1.0
    table = run_o80("export", str(path), "-o", str(tmp_path / "rows.csv"))
    assert "1 number is not finite, left empty: observed.wrist (1)" in table.stderr
    assert "nan" not in (tmp_path / "rows.csv").read_text()


@pytest.mark.parametrize("every", [10, 0.01])  # iterations, or seconds
def test_steps_may_be_several_iterations(recorded: Path, segment: str, every: float) -> None:
    found = episodes(recorded, every=every)
    history = o80.open(recorded)[segment].history()

    assert found.frequency == 100
    assert [len(each) for each in found.all] == [3, 2, 2]
    assert found.all[0].rows.iteration.tolist() == [5, 15, 25, 35]
    assert np.array_equal(found.all[0].actions[0], history.at_iteration(15).desired)
    assert found.all[0].rewards.tolist() == [0.25, 0, 0]


def test_an_episode_that_a_fresh_start_cuts_is_said(arm: o80.Frontend, path: Path) -> None:
    with o80.Recording(path, arm) as recording:
        recording.mark("episode")
        arm.burst(10)
        arm.halt("look")
        arm.burst(1)
        arm.resume()
        arm.burst(5)
        recording.mark("episode_end")
    found = episodes(path)
    (only,) = found.all
    cut = int(only.rows.iteration[-1]) + 1
    assert cut <= 12
    assert not only.terminated
    (why,) = found.left_out
    assert f"ends at row {cut}, where the robot made a fresh start" in why


def test_rewards_of_all_steps_may_come_with_the_last_mark(arm: o80.Frontend, path: Path) -> None:
    rewards = [0.0, 0.5, 1.0]
    with o80.Recording(path, arm) as recording:
        recording.mark("episode")
        arm.burst(30)
        recording.mark("episode_end", rewards=rewards, truncated=True)
    (only,) = episodes(path, every=10).all
    assert only.rewards.tolist() == rewards
    assert not only.terminated
    assert episodes(path).all[0].rewards.sum() == sum(rewards)


def test_an_episode_with_a_gap_is_left_out_and_said(segment: str, path: Path) -> None:
    with (
        o80.robots.load("two_joints").inline(segment, history=20) as arm,
        o80.Recording(path, arm) as recording,
    ):
        recording.mark("episode")
        recording.flush()
        with recording._lock:  # the recorder is late
            arm.burst(100)
        recording.flush()
        recording.mark("episode")
        arm.burst(10)
    found = episodes(path)
    assert [len(each) for each in found.all] == [10]
    assert len(found.left_out) == 1
    assert "gap" in found.left_out[0]


def test_episodes_of_restarted_robots_are_those_of_their_run(segment: str, path: Path) -> None:
    with o80.Recording(path, segment) as recording:
        rows = 0
        for run, (count, frequency) in enumerate(((10, 1000), (20, 1000), (20, 500))):
            with o80.robots.load("two_joints").inline(segment, frequency=frequency) as arm:
                rows += count + 1
                while recording._recorder.newest[segment] != 0 or not recording.rows:
                    recording.flush()
                recording.mark("episode_end", reward=1.0)  # of no episode of this run
                recording.mark("episode", run=run)
                arm.burst(count)
                while recording.rows < rows:
                    recording.flush()
                if run == 1:
                    recording.mark("episode_end", reward=2.0)
    one, other = (found := episodes(path)).all
    assert (one.values["run"], len(one), one.terminated, one.rewards.sum()) == (0, 10, False, 0)
    assert (other.values["run"], len(other), other.rewards.sum()) == (1, 20, 2)
    assert "another frequency" in found.left_out[0]
    assert [len(each) for each in episodes(path, every=0.01).all] == [1, 2, 4]


def test_a_recording_without_episodes_is_refused(arm: o80.Frontend, path: Path) -> None:
    with o80.Recording(path, arm):
        arm.burst(5)
    with pytest.raises(o80.InvalidArgument, match=r'recording.mark\("episode"\)'):
        episodes(path)
    with pytest.raises(o80.InvalidArgument, match="no segment 'leg'"):
        episodes(path, segment="leg")


# ---------------------------------------------------------------------------- LeRobot


def test_thirty_rows_a_second_are_thirty_although_a_period_is_in_whole_ns(
    segment: str, path: Path, tmp_path: Path
) -> None:
    with (
        o80.robots.load("two_joints").inline(segment, frequency=150) as arm,
        o80.Recording(path, arm) as recording,
    ):
        recording.mark("episode")
        arm.burst(50)
    for every, fps in ((5, 30), (4, 37.5), (7, pytest.approx(150 / 7))):
        root = tmp_path / f"set{every}"
        lerobot.write(root, episodes(path, every=every))
        assert json.loads((root / "meta/info.json").read_text())["fps"] == fps


def test_a_lerobot_data_set_has_the_documented_files(recorded: Path, tmp_path: Path) -> None:
    """Checked against the loader of LeRobot: datasets/io_utils.py and dataset_metadata.py."""
    root = tmp_path / "set"
    found = episodes(recorded, every=10)
    lerobot.write(root, found, sensors=["effort", "homing"])

    info = json.loads((root / "meta/info.json").read_text())
    assert info["codebase_version"] == "v3.0"
    assert (info["fps"], info["total_episodes"], info["total_frames"]) == (100, 3, 7)
    assert info["robot_type"] == "two_joints"
    tasks = pandas.read_parquet(root / "meta/tasks.parquet")
    assert tasks.loc["swing", "task_index"] == 0
    assert list(tasks.columns) == ["task_index"]

    frames = pandas.read_parquet(root / info["data_path"].format(chunk_index=0, file_index=0))
    assert set(frames.columns) == set(info["features"])
    assert frames["index"].tolist() == list(range(7))
    assert frames["frame_index"].tolist() == [0, 1, 2, 0, 1, 0, 1]
    assert frames["next.done"].tolist() == [False, False, True, False, True, False, True]
    assert frames["timestamp"].tolist()[:3] == pytest.approx([0, 0.01, 0.02])
    for number, episode in enumerate(found.all):
        own = frames[frames.episode_index == number]
        assert np.array_equal(np.stack(own["action"]), episode.actions.astype(np.float32))
        state = np.stack(own["observation.state"])
        assert np.array_equal(state, episode.observed[:-1].astype(np.float32))
        assert own["next.reward"].to_numpy() == pytest.approx(episode.rewards)
    assert info["features"]["action"]["names"] == ["shoulder.pos", "elbow.pos"]
    policies = [name for name in info["features"] if name.startswith(("observation", "action"))]
    assert policies == ["action", "observation.state", "observation.environment_state"]
    sensors = info["features"]["observation.environment_state"]["names"]
    assert sensors == ["homing", "effort[0]", "effort[1]"]

    table = pyarrow.parquet.read_table(root / "meta/episodes/chunk-000/file-000.parquet")
    rows = table.to_pylist()
    assert [row["length"] for row in rows] == [3, 2, 2]
    assert [(row["dataset_from_index"], row["dataset_to_index"]) for row in rows] == [
        (0, 3),
        (3, 5),
        (5, 7),
    ]
    assert rows[0]["tasks"] == ["swing"]
    stats = json.loads((root / "meta/stats.json").read_text())
    assert stats["action"]["max"] == pytest.approx(
        frames["action"].map(list).agg(lambda each: np.max(list(each), axis=0).tolist())
    )
    parquet = pyarrow.parquet.ParquetFile(root / "data/chunk-000/file-000.parquet")
    assert parquet.num_row_groups == 3


class Slow(Obedient):
    """A joint that needs 100 iterations for a radian."""

    limits: ClassVar = {"elbow": o80.Limits(minimum=-2, maximum=2, speed=10.0)}


def test_a_data_set_has_what_was_asked_for_and_what_acted(
    segment: str, path: Path, tmp_path: Path
) -> None:
    with (
        o80.robots.load(Slow).inline(segment, frequency=1000) as arm,
        o80.Recording(path, arm) as recording,
    ):
        recording.mark("episode")
        arm.burst(10)  # nothing was asked for
        arm.add_command("elbow", 1.0)
        arm.burst(10)
        arm.purge("elbow")
        arm.burst(10)
        arm.add_command("elbow", 0.5)
        arm.burst(10)
        arm.halt("a hand")
        arm.burst(1)
        arm.add_command("elbow", -1.0)
        with pytest.raises(o80.BackendHalted):
            arm.burst(1)
        arm.burst(9)
        recording.mark("episode_end")
        arm.resume()
        recording.mark("episode")
        with arm.chunks("elbow", step=5) as plan:
            plan.send([0.2, 0.3, 0.4, 0.5], seen=arm.latest(), fixed=True)
            arm.burst(20)
    found = episodes(path, every=5)
    read = {}
    for action_is in ("acted", "asked"):
        lerobot.write(tmp_path / action_is, found, action_is=action_is)
        file = tmp_path / action_is / "data/chunk-000/file-000.parquet"
        read[action_is] = pyarrow.parquet.read_table(file).to_pydict()
    acted, asked = (np.ravel(read[name]["action"]) for name in ("acted", "asked"))
    assert np.array_equal(np.ravel(read["acted"]["complementary_info.action_asked"]), asked)
    assert np.array_equal(np.ravel(read["asked"]["complementary_info.action_acted"]), acted)
    rows = np.concatenate([each.actions for each in found.all])[:, 0]
    assert np.array_equal(acted, rows.astype(np.float32))
    assert asked[2:4].tolist() == [1.0, 1.0]
    assert np.array_equal(asked[:2], acted[:2])
    assert np.array_equal(asked[4:6], acted[4:6])  # after the purge
    assert asked[6:].tolist() == pytest.approx([0.5, 0.5, -1, -1, 0.2, 0.3, 0.4, 0.5])


def test_numbers_and_units_of_a_lerobot_data_set_are_chosen(recorded: Path, tmp_path: Path) -> None:
    write = partial(export, str(recorded), form="lerobot", every="10")
    sensors = "observed.shoulder,effort[1]"
    write(tmp_path / "set", state="elbow", units="degrees", sensors=sensors)
    features = json.loads((tmp_path / "set/meta/info.json").read_text())["features"]
    assert features["observation.state"]["names"] == ["elbow.pos"]
    assert features["action"]["names"] == ["shoulder.pos", "elbow.pos"]
    assert features["observation.environment_state"]["names"] == ["shoulder.pos", "effort[1]"]
    table = pyarrow.parquet.read_table(tmp_path / "set/data/chunk-000/file-000.parquet")
    rows = np.concatenate([each.observed[:-1, 1] for each in episodes(recorded, every=10).all])
    state = np.ravel(table["observation.state"].to_pylist())
    assert state == pytest.approx(np.degrees(rows), abs=1e-4)
    write(tmp_path / "plain")
    plain = json.loads((tmp_path / "plain/meta/info.json").read_text())["features"]
    assert "observation.environment_state" not in plain
    refused: list[tuple[dict[str, Any], str]] = [
        ({"units": "normalised"}, "no calibrated ranges"),
        ({"units": "turns"}, "must be one of degrees, normalised, native"),
        ({"action": "elbo"}, "Did you mean 'elbow'"),
        ({"fields": "effort"}, "--sensors"),
        ({"form": None, "every": "1", "units": "degrees"}, "--format lerobot"),
    ]
    for options, why in refused:
        with pytest.raises(o80.InvalidArgument, match=why):
            write(tmp_path / "no", **options)


def test_times_are_k_over_fps_and_the_true_ones_beside_them(
    segment: str, path: Path, tmp_path: Path
) -> None:
    sensors = {"capture_time": np.int64}
    with o80.Backend(segment, ["lift"], extended=sensors, frequency=100) as backend:

        def publish() -> None:
            backend.publish([0.0], {"capture_time": time.monotonic_ns() - 3_000_000})

        publish()
        with o80.Recording(path, segment) as recording:
            recording.mark("episode")
            for _ in range(3):
                backend.step()
                publish()
            recording.mark("episode_end")
    found = episodes(path)
    lerobot.write(tmp_path / "set", found)
    table = pyarrow.parquet.read_table(tmp_path / "set/data/chunk-000/file-000.parquet")
    rows = found.all[0].rows[:-1]
    assert table["timestamp"].to_pylist() == pytest.approx([0, 0.01, 0.02])
    true = (rows.time - rows.time[0]) * 1e-9
    assert table["complementary_info.time"].to_pylist() == pytest.approx(true)
    age = np.ravel(table["complementary_info.age"].to_pylist())
    assert age == pytest.approx((rows.time - rows.extended.capture_time) * 1e-9)
    assert (age >= 0.003).all()
    captured = np.ravel(table["complementary_info.capture_time"].to_pylist())
    assert captured == pytest.approx(true - age)


def test_a_folder_that_exists_is_not_overwritten(recorded: Path, tmp_path: Path) -> None:
    for module in (lerobot, minari):
        with pytest.raises(o80.InvalidArgument, match="exists"):
            module.write(tmp_path, episodes(recorded))


def test_the_latency_of_another_episode_or_of_an_order_that_says_nothing_is_not_known(
    arm: o80.Frontend, path: Path
) -> None:
    with o80.Recording(path, arm) as recording:
        for _ in range(2):
            recording.mark("episode")
            arm.burst(2)  # nothing was sent yet
            arm.add_command("elbow", 0.1, iterations=20)
            arm.burst(2, seen=arm.latest())
            arm.mark("a note changes nothing")
            arm.burst(1)
            arm.add_command("elbow", 0.2, iterations=20)
            arm.burst(2)
            recording.mark("episode_end")
            arm.request("reset", seed=1)
            arm.burst(1)
    for episode in episodes(path).all:
        assert np.isfinite(episode.delays).tolist() == [False] * 2 + [True] * 3 + [False] * 2


def test_a_learner_gets_no_times_of_clocks_unless_it_asks(segment: str, path: Path) -> None:
    sensors = {"force": (np.float64, 2), "capture_time": np.int64, "heat": np.float64}
    with o80.Backend(segment, ["lift"], extended=sensors) as backend:

        def publish(time: int) -> None:
            backend.publish([0.0], {"force": [1.0, 2.0], "capture_time": time, "heat": 30.0})

        publish(10**9)
        with o80.Recording(path, segment) as recording:
            recording.mark("episode")
            for time in range(4):
                backend.step()
                publish(10**9 + 1 + time)
            recording.mark("episode_end")
    assert episodes(path).names["extended"] == ["force[0]", "force[1]", "heat"]
    found = episodes(path, fields=["capture_time", "force"])
    assert found.names["extended"] == ["force[0]", "force[1]", "capture_time"]
    assert found.all[0].extended[1].tolist() == [1.0, 2.0, 10**9 + 1]
    with pytest.raises(o80.InvalidArgument, match=r"has no field 'fource'\. Did you mean 'force'"):
        episodes(path, fields=["fource"])


def test_marks_that_look_like_those_of_episodes_are_named(arm: o80.Frontend, path: Path) -> None:
    with o80.Recording(path, arm) as recording:
        for mark in ("episode: one", "episode:two", "Episode", "touched", "episode-end"):
            recording.mark(mark)
            arm.burst(5)
        recording.mark("episode_end")
    found = episodes(path)
    assert len(found.all) == 1
    assert [said.partition(", ")[0] for said in found.left_out] == [
        "the mark 'episode:two' at row 5",
        "the mark 'Episode' at row 10",
        "the mark 'episode-end' at row 20",
    ]


# ---------------------------------------------------------------------------- Minari


def test_minari_reads_its_data_set(
    recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from minari import MinariDataset

    found = episodes(recorded)
    monkeypatch.chdir(tmp_path)
    minari.write(Path("set"), found)
    read = MinariDataset(tmp_path / "set/data")

    assert read.total_episodes == 3
    assert read.total_steps == 70
    for one, other in zip(found.all, read.iterate_episodes(), strict=True):
        observed = np.concatenate([one.observed, one.extended], axis=1)
        assert np.array_equal(other.observations, observed)
        assert np.array_equal(other.actions, one.actions)
        assert np.array_equal(other.rewards, one.rewards)
        assert other.terminations[-1] == one.terminated
        assert other.truncations[-1] == (not one.terminated)
        assert not other.terminations[:-1].any()


# ---------------------------------------------------------------------------- command


def test_the_command_writes_a_data_set(recorded: Path, tmp_path: Path) -> None:
    options = ("-o", tmp_path / "set", "--format", "minari", "--every", "0.01")
    said = run_o80("export", recorded, *options).stdout
    assert "3 episodes, 7 steps at 100 a second" in said


def test_actions_come_with_the_latency_of_their_decisions(
    arm: o80.Frontend, path: Path, tmp_path: Path
) -> None:
    with o80.Recording(path, arm) as recording:
        recording.mark("episode")
        arm.burst(4)
        for delay in (1, 3):
            seen = arm.latest()
            arm.burst(delay)
            arm.add_command("elbow", 0.1 * delay)
            arm.burst(2, seen=seen)
        recording.mark("episode_end")
    found = episodes(path, every=2)
    (episode,) = found.all

    iterations = [2, 4, 6, 8, 10, 12]  # at the ends of the steps; batches began at 6 and 11
    assert episode.rows.iteration[1:].tolist() == iterations
    assert episode.seen.tolist() == [-1, -1, 4, 4, 4, 7]
    delays = [np.nan, np.nan, 0.002, 0.002, 0.002, 0.004]
    assert episode.delays == pytest.approx(delays, nan_ok=True)
    lerobot.write(tmp_path / "set", found)
    table = pyarrow.parquet.read_table(tmp_path / "set/data/chunk-000/file-000.parquet")
    assert table["complementary_info.delay"].to_pylist() == pytest.approx(
        [-1, -1, 0.002, 0.002, 0.002, 0.004]
    )
