"""A recording of a real system, played: subjects, capture times, gaps, the table's corners."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import o80
from o80_devices.clock import ClockMap
from o80_devices.motion_capture.recorded_frames import load
from o80_devices.motion_capture.sensor import Reason
from o80_devices.motion_capture.transform import Transform

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get("O80_DATA", ROOT.parent / "shared" / "data"))
FILE = DATA / "vicon_2021" / "recording_3s.dat"
CORNERS = [f"TT Platte_Eckteil {number}" for number in range(1, 5)]
WIDTH, LENGTH = 1.525, 2.74  # of the table [m]
TABLE = {  # its corners in the world of the experiment [m]
    CORNERS[0]: (1.1625, 0.2, 0.775),
    CORNERS[1]: (-0.3625, 0.2, 0.775),
    CORNERS[2]: (-0.3625, 2.94, 0.775),
    CORNERS[3]: (1.1625, 2.94, 0.775),
}
DRIVER = "o80_devices.motion_capture:Playback"

pytestmark = pytest.mark.recordings("vicon_2021")


def played(segment: str, bursts: int = 900, **options: Any) -> o80.History:
    """All rows of the recording, in simulated time."""
    robot = o80.robots.load(DRIVER)
    with robot.inline(segment, frequency=300, file=str(FILE), **options) as system:
        system.burst(bursts)
        rows: o80.History = system.history(bursts)
        return rows


def corners(segment: str, **options: Any) -> dict[str, Any]:
    """The middle of all positions of each corner of the table [m]."""
    rows = played(segment, subjects=",".join(CORNERS), **options).extended
    return {
        name: np.nanmedian(rows[name.replace(" ", "_")]["position"], axis=0) for name in CORNERS
    }


def test_every_row_has_poses_or_a_reason(segment: str) -> None:
    rows = played(segment, bursts=1000).extended
    seen = rows["reason"] == Reason.SEEN
    assert seen.sum() > 850
    assert (rows["capture_time"][~seen] == 0).all()
    assert (rows["reason"][-50:] == Reason.ENDED).all()
    for name in ("Marker_Arm", "rll_led_stick", "Marker_Ballmaschine"):
        subject = rows[name]
        numbers = np.isfinite(subject["position"]).all(axis=1)
        assert (numbers == subject["visible"]).all()  # nothing is stale
        assert not subject["visible"][~seen].any()
    assert not rows["rll_led_stick"]["visible"].any()
    assert 0.9 < rows["Marker_Ballmaschine"]["visible"][seen].mean() < 0.95


def test_only_named_subjects_are_in_the_rows(segment: str) -> None:
    rows = played(segment, bursts=10, subjects="Marker_Arm, ghost").extended
    assert (np.asarray(rows).dtype.names or ())[-2:] == ("Marker_Arm", "ghost")
    assert not rows["ghost"]["visible"].any()
    assert rows["Marker_Arm"]["visible"].any()


def test_capture_times_are_those_of_the_system(segment: str) -> None:
    """Arrival less the latency that Vicon tells is known for each frame; the clock is not told."""
    frames = load(FILE).frames
    clock = ClockMap(tick=1e9 / 300, latency=min(each.latency for each in frames) * 1e-9)
    off = []
    for frame in frames:
        capture = clock.capture(frame.number, frame.arrival)
        assert capture is not None
        off.append(capture.time - (frame.arrival - frame.latency))
    assert np.median(np.abs(off[100:])) < 0.5e6  # [ns]; arrivals are off by up to 14 ms
    rows = played(segment).extended
    times = rows["capture_time"][rows["capture_time"] > 0]
    assert np.ptp(np.diff(times[100:])) < 0.1e6 + 1e9 / 300  # one frame number is missing
    assert (rows["capture_error"][-100:][rows["reason"][-100:] == 0] < 5e6).all()


def test_the_corners_of_the_table_are_as_far_apart_as_the_table_says(segment: str) -> None:
    middles = corners(segment)
    one, two, three, four = (middles[name] for name in CORNERS)
    for a, b in ((one, two), (three, four)):
        assert np.linalg.norm(a - b) == pytest.approx(WIDTH, abs=0.012)
    for a, b in ((two, three), (four, one)):
        assert np.linalg.norm(a - b) == pytest.approx(LENGTH, abs=0.012)
    world = Transform.estimated(middles, TABLE)
    assert max(world.residuals.values()) < 0.01


def test_poses_are_in_the_world_of_a_file(segment: str, tmp_path: Path) -> None:
    file = tmp_path / "world.json"
    Transform.estimated(corners(segment), TABLE).save(file)
    for name, middle in corners(segment, transform=str(file)).items():
        assert middle == pytest.approx(TABLE[name], abs=0.01)


def test_a_cut_recording_is_told(tmp_path: Path) -> None:
    cut = tmp_path / "cut.dat"
    cut.write_bytes(FILE.read_bytes()[:5000])
    with pytest.raises(o80.InvalidArgument, match="is cut after frame 5"):
        load(cut)
    cut.write_bytes(b"0" * 100)
    with pytest.raises(o80.InvalidArgument, match="is not a recording of motion capture"):
        load(cut)
