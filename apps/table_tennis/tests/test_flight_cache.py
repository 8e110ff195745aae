"""Fitted flights are kept in files: found again, never stale, never in the way."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded_rows import frames_of_a_reader, rows_seen, simulated_shot, write_ball_gun, write_shots

import o80_table_tennis.balls.flight_cache
from o80_table_tennis.balls.flight_cache import ARRAYS
from o80_table_tennis.balls.recordings import load_trajectories
from o80_table_tennis.balls.sampled_flight import SampledFlight
from o80_table_tennis.balls.sources import recorded_balls
from o80_table_tennis.balls.trajectories import BallTrajectory


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "o80" / "flights"


@pytest.fixture
def fits(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the shots that were fitted."""
    fitted: list[str] = []
    resample = BallTrajectory.resample

    def counting(self: BallTrajectory, period: float) -> SampledFlight:
        fitted.append(self.name)
        return resample(self, period)

    monkeypatch.setattr(BallTrajectory, "resample", counting)
    return fitted


@pytest.fixture
def shots(tmp_path: Path) -> Path:
    """A folder of two recordings: one of one shot, one of two."""
    path = tmp_path / "shots"
    path.mkdir()
    rng = np.random.default_rng(3)
    rows = rows_seen(rng, frames_of_a_reader(rng, 1.25), noise=0.001, lag=0.025)
    write_ball_gun(path / "a.json", rows)
    write_shots(path / "b.hdf5", {str(i): simulated_shot(rng) for i in range(2)})
    return path


def same(one: SampledFlight, other: SampledFlight) -> bool:
    return (one.name, one.period) == (other.name, other.period) and all(
        np.array_equal(getattr(one, name), getattr(other, name)) for name in ARRAYS
    )


def test_a_flight_is_fitted_once(shots: Path, fits: list[str], cache: Path) -> None:
    first = [recorded_balls(shots).flight(ball) for ball in range(3)]
    assert fits == ["a", "b/0", "b/1"]
    again = [recorded_balls(shots).flight(ball) for ball in range(3)]
    assert len(fits) == 3
    assert all(map(same, first, again))
    assert same(first[0], load_trajectories(shots)[0].resample(first[0].period))
    assert len(list(cache.iterdir())) == 3


def test_another_file_period_or_version_is_fitted_anew(
    shots: Path, fits: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    recorded_balls(shots / "a.json").flight(0)
    recorded_balls(shots / "a.json", period=0.004).flight(0)
    assert len(fits) == 2
    content = (shots / "a.json").read_text()
    (shots / "a.json").write_text(content.replace("]]", "] ]"))
    recorded_balls(shots / "a.json").flight(0)
    assert len(fits) == 3
    monkeypatch.setattr(o80_table_tennis.balls.flight_cache, "_version", lambda: "other sources")
    recorded_balls(shots / "a.json").flight(0)
    assert len(fits) == 4


@pytest.mark.parametrize("damage", ["empty", "cut", "text", "flipped", "pickle"])
def test_a_damaged_file_is_replaced(shots: Path, fits: list[str], cache: Path, damage: str) -> None:
    whole = recorded_balls(shots / "b.hdf5").flight(0)
    (file,) = cache.iterdir()
    content = file.read_bytes()
    if damage == "pickle":
        pickled: dict[str, Any] = {name: np.array([{}]) for name in ARRAYS}
        np.savez(file, **pickled)
    else:
        middle = len(content) // 2
        flipped = content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]
        damages = {"empty": b"", "cut": content[:-200], "text": b"text", "flipped": flipped}
        file.write_bytes(damages[damage])

    assert same(recorded_balls(shots / "b.hdf5").flight(0), whole)
    assert len(fits) == 2
    assert same(recorded_balls(shots / "b.hdf5").flight(0), whole)
    assert len(fits) == 2
    assert [each.name for each in cache.iterdir()] == [file.name]


def test_a_folder_that_cannot_be_written_is_no_obstacle(
    shots: Path, fits: list[str], cache: Path
) -> None:
    cache.parent.mkdir(parents=True)
    cache.write_text("a file in the place of the folder")
    for _ in range(2):
        recorded_balls(shots / "b.hdf5").flight(0)
    assert len(fits) == 2


def test_the_key_covers_everything_a_flight_has() -> None:
    kept = {field.name for field in dataclasses.fields(SampledFlight)} - {"name", "period"}
    assert kept == set(ARRAYS)
