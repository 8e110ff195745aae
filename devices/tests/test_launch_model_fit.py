"""The fit of the launch model, on recorded shots and on shots of a known model."""

import os
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from o80.errors import InvalidArgument
from o80_devices.ball_launcher import LAUNCH_MODEL, LaunchModel
from o80_devices.ball_launcher.fit import SCALES, SCATTERS, TABLE, distances, fitted, halves, main
from o80_devices.ball_launcher.fit import scatter as scatter_of
from o80_devices.ball_launcher.recorded_shots import recorded_shots
from o80_devices.cameras.flight import Flight, FlightLaw

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("O80_DATA", ROOT.parent / "shared" / "data")) / "spin_2022"
SETTINGS = ((1200.0, 1200.0, 1200.0), (1800.0, 1800.0, 400.0))
OTHER = LaunchModel(
    muzzle=(0.0, 0.02, 1.1),
    azimuth=-0.03,
    altitude=0.25,
    lift=5e-5,
    top_gain=1.5e-3,
    bottom_gain=1.3e-3,
    spin=20.0,
    spin_gain=0.05,
)


def write(file: Path, model: LaunchModel, settings: tuple[tuple[float, float, float], ...]) -> None:
    """A shot for each setting of the motors, seen by cameras from 30 ms after the launch on."""
    law = FlightLaw(Flight(), TABLE)
    stamps = 100.0 + 0.0056 * np.arange(130)
    with h5py.File(file, "w") as content:
        for number, speeds in enumerate(settings):
            ball = model.launch(0.5, 0.5, speeds)
            start = np.concatenate([ball.position, ball.velocity, ball.spin])
            seen = [law.advance(start, 0.03 + stamp - stamps[0])[0][:3] for stamp in stamps]
            shot = content.create_group(f"originals/{number}")
            shot["launch_param"], shot["time_stamps"] = [0.5, 0.5, *speeds], stamps
            shot["positions"] = np.array(seen)


def assert_same(one: LaunchModel, other: LaunchModel, share: float) -> None:
    """share: of the scale of each number."""
    assert np.abs(np.subtract(one.muzzle, other.muzzle)).max() < share * SCALES["y"]
    for name in [*SCALES][2:]:
        difference = getattr(one, name) - getattr(other, name)
        assert abs(difference) < share * SCALES[name], name


@pytest.mark.check  # needs SciPy
@pytest.mark.recordings("spin_2022")
def test_the_constants_of_the_model_come_from_half_of_the_recorded_shots() -> None:
    shots = recorded_shots([DATA])
    fit_on, test_on = halves(shots)
    assert (len(fit_on), len(test_on)) == (13, 12)
    found = fitted(fit_on)
    assert_same(found, LAUNCH_MODEL, 0.1)
    away = distances(found, test_on)
    assert max(each.max() for each in away) < 0.1
    assert np.mean([each.mean() for each in away]) < 0.03
    expected = [getattr(LAUNCH_MODEL, name) for name in SCATTERS]
    np.testing.assert_allclose(scatter_of(found, shots), expected, rtol=0.2)


@pytest.mark.check  # needs SciPy
def test_the_fit_finds_the_numbers_of_a_known_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path / "shots.hdf5", OTHER, SETTINGS)
    shots = recorded_shots([tmp_path])
    assert_same(fitted(shots), OTHER, 0.05)
    main([str(tmp_path), "--all"])
    told = capsys.readouterr().out
    assert "fitted to 2 of 2 shots" in told
    assert "azimuth               -0.03" in told


@pytest.mark.parametrize("settings", [SETTINGS[:1], ((600.0, 600.0, 600.0), SETTINGS[0])])
def test_settings_that_do_not_determine_the_numbers_are_refused(
    tmp_path: Path, settings: tuple[tuple[float, float, float], ...]
) -> None:
    write(tmp_path / "shots.hdf5", OTHER, settings)
    with pytest.raises(InvalidArgument, match="at least two settings"):
        fitted(recorded_shots([tmp_path]))
    with pytest.raises(SystemExit, match="at least two settings"):
        main([str(tmp_path), "--all"])


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    with pytest.raises(InvalidArgument, match="missing: no such file"):
        recorded_shots([tmp_path / "missing"])
    with pytest.raises(InvalidArgument, match="no shots"):
        recorded_shots([tmp_path])
    (tmp_path / "text.h5").write_text("no HDF5")
    with pytest.raises(InvalidArgument, match=r"text\.h5 cannot be read"):
        recorded_shots([tmp_path])
    write(tmp_path / "text.h5", replace(OTHER), SETTINGS)
    with h5py.File(tmp_path / "text.h5", "a") as content:
        del content["originals/1/positions"]
    with pytest.raises(InvalidArgument, match=r"text\.h5 cannot be read"):
        recorded_shots([tmp_path])
