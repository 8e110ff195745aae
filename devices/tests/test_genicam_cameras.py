"""GenICam cameras by aravis: its fake camera in this process, and that on the wire."""

import dataclasses
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from device_rows import WAIT, row_where
from exclusive import alone_with

import o80
from o80_devices.ball_tracking import GenicamCameras
from o80_devices.cameras import aravis
from o80_devices.cameras.image_source import ImageSource
from o80_devices.cameras.newest_image import CameraReason, NewestImage
from o80_devices.cameras.pixel_formats import PixelFormat, rgb_of
from o80_devices.cameras.rig import Rig, RigCamera

ROBOT = o80.robots.load(GenicamCameras)
WIRE = "127.0.0.1"


class WireCamera:
    """`arv-fake-gv-camera`: a GigE Vision camera on the loopback, a process that can be stopped."""

    def __init__(self, *options: str) -> None:
        self._options = options
        self.start()

    def start(self) -> None:
        self.process = subprocess.Popen(
            ["arv-fake-gv-camera-0.8", "-i", WIRE, *self._options],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def pull_the_cable(self) -> None:
        self.process.send_signal(signal.SIGSTOP)

    def plug_it_in(self) -> None:
        self.process.send_signal(signal.SIGCONT)

    def die(self) -> None:
        self.process.kill()
        self.process.wait()


@pytest.fixture
def wire_camera(request: pytest.FixtureRequest) -> Iterator[WireCamera]:
    with alone_with("fake-gv-camera"):
        camera = WireCamera(*getattr(request, "param", ()))
        yield camera
        camera.die()


@pytest.mark.check  # needs OpenCV
def test_images_come_with_the_stamps_of_the_camera(segment: str) -> None:
    with ROBOT.inline(segment, frequency=1000, history=4, sources="Fake_1", rate=100) as cameras:
        rows = [row_where(cameras, lambda row: row.valid[0]) for _ in range(20)]
    stamps = np.array([row.stamps[0] for row in rows])
    times = np.array([row.times[0] for row in rows])
    assert (np.diff(stamps) > 0).all()
    assert (np.diff(times) > 0).all()
    assert (times == [row.capture_time for row in rows]).all()
    assert times[-1] < time.monotonic_ns()
    assert all(row.reasons.camera_0 == CameraReason.seen for row in rows)
    assert rows[-1].images.reshape(480, 640, 3).std() > 10  # the test image of the camera


@pytest.mark.check  # needs OpenCV
def test_the_tracker_reads_its_images_with_the_error_of_their_time(segment: str) -> None:
    camera = RigCamera("one", (640, 480), (500.0, 500.0), (320.0, 240.0))
    source = ImageSource([segment], Rig((camera,)), 0.01)
    with ROBOT.inline(segment, frequency=1000, history=4, sources="Fake_1", rate=50) as cameras:
        source.attach(WAIT)
        row = row_where(cameras, lambda row: row.valid[0])
        images = source.read()
        source.close()
    assert images is not None
    (image,) = images.images
    assert image is not None
    assert (image.ravel() == row.images.ravel()).all()
    assert images.time == row.capture_time
    assert images.error == row.errors[0] > 0


@pytest.mark.check  # needs OpenCV
def test_a_row_without_a_new_image_has_none(segment: str) -> None:
    with ROBOT.inline(segment, frequency=1000, history=4, sources="Fake_1", rate=20) as cameras:
        row_where(cameras, lambda row: row.valid[0])
        row = row_where(cameras, lambda row: row.reasons.camera_0 == CameraReason.no_new_image)
        assert not row.valid[0]
        assert row.times[0] == row.stamps[0] == row.capture_time == 0
        assert not row.images.any()


@pytest.mark.check  # needs OpenCV
def test_a_camera_that_is_not_there_is_a_marked_gap_beside_another_one(
    segment: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with ROBOT.inline(segment, frequency=1000, history=4, sources="Fake_1,None_7") as cameras:
        row = row_where(
            cameras, lambda row: row.valid[0] and row.reasons.camera_1 == CameraReason.disconnected
        )
        assert not row.valid[1]
        assert not row.images[1].any()
        row_where(cameras, lambda _: True)
    told = capfd.readouterr().err
    assert told.count("o80: camera None_7: Device 'None_7' not found; tries again") == 1


def test_the_cameras_that_answer_are_listed(wire_camera: WireCamera) -> None:
    command = [sys.executable, "-m", "o80_devices.cameras.list_cameras"]
    end = time.monotonic() + WAIT
    while True:  # until it has started
        listed = subprocess.run(command, capture_output=True, text=True, timeout=WAIT, check=True)
        if listed.stdout == "Aravis-Fake-GV01\n":
            break
        assert listed.stdout == "no camera answers\n"
        assert time.monotonic() < end


@pytest.mark.check  # needs OpenCV
def test_a_camera_on_the_wire_that_is_unplugged_is_a_gap_and_comes_back(
    wire_camera: WireCamera, segment: str
) -> None:
    with ROBOT.inline(segment, frequency=1000, history=4, sources=WIRE, rate=100) as cameras:
        row_where(cameras, lambda row: row.valid[0])
        wire_camera.pull_the_cable()
        row = row_where(cameras, lambda row: row.reasons.camera_0 == CameraReason.silent)
        assert row.capture_time == 0
        wire_camera.plug_it_in()
        row_where(cameras, lambda row: row.valid[0])


@pytest.mark.check  # needs OpenCV
def test_a_camera_on_the_wire_that_starts_again_is_opened_again(
    wire_camera: WireCamera, segment: str
) -> None:
    with ROBOT.inline(segment, frequency=1000, history=4, sources=WIRE, rate=100) as cameras:
        before = row_where(cameras, lambda row: row.valid[0])
        wire_camera.die()
        row_where(cameras, lambda row: row.reasons.camera_0 == CameraReason.disconnected)
        wire_camera.start()
        after = row_where(cameras, lambda row: row.valid[0])
        assert after.times[0] > before.times[0]


@pytest.mark.parametrize("wire_camera", [("-r", "40")], indirect=True)
def test_an_image_with_lost_packets_is_damaged_and_counted(
    wire_camera: WireCamera, segment: str
) -> None:
    with ROBOT.inline(
        segment, frequency=1000, history=4, sources=WIRE, rate=50, pixel_format="Mono8"
    ) as cameras:
        row = row_where(cameras, lambda row: row.reasons.camera_0 == CameraReason.damaged)
        assert not row.images.any()
        assert row.lost[0] > 0


@pytest.mark.check  # needs OpenCV
def test_it_paces_the_loop_in_a_process_of_its_own(segment: str) -> None:
    with ROBOT.start(segment, frequency=50, history=4, sources="Fake_1", rate=50) as process:
        cameras = process.frontend()
        seen = 0
        for observation in cameras.stream():
            seen += bool(observation.extended.valid[0])
            if seen == 10:
                break


# ---------------------------------------------------------------------- numbers of frames


class Numbers(NewestImage):
    def __init__(self) -> None:
        self._last_number = None
        self.lost = 0

    def lost_after(self, *numbers: int) -> int:
        for number in numbers:
            self._count(number)
        return self.lost


@pytest.mark.parametrize(
    ("numbers", "lost"),
    [
        ((7, 8, 9), 0),
        ((7, 10), 2),
        ((65534, 65535, 1, 2), 0),
        ((65535, 2), 1),
        ((65530, 3), 7),
        ((70000, 70001, 70004), 2),  # of a camera that counts further
        ((9, 9), 0),
        ((9, 8), 0),  # an older one
    ],
)
def test_missing_numbers_are_counted_over_their_wrap(numbers: tuple[int, ...], lost: int) -> None:
    assert Numbers().lost_after(*numbers) == lost


# ---------------------------------------------------------------------- colours


@pytest.mark.check  # needs OpenCV
@pytest.mark.parametrize("pixel_format", ["BayerRG8", "BayerGB8", "BayerGR8", "BayerBG8"])
def test_the_colours_of_a_pattern_are_found(pixel_format: PixelFormat) -> None:
    colour = {"R": 240, "G": 130, "B": 30}
    first_row = pixel_format[5:7]
    second_row = {"RG": "GB", "GB": "RG", "GR": "BG", "BG": "GR"}[first_row]
    rows = [[colour[c] for c in row] * 8 for row in (first_row, second_row)] * 8
    image = rgb_of(np.array(rows, np.uint8).ravel(), (16, 16), pixel_format)
    assert (image[4:-4, 4:-4] == [240, 130, 30]).all()


@pytest.mark.parametrize(("pixel_format", "first"), [("RGB8", [1, 2, 3]), ("BGR8", [3, 2, 1])])
def test_the_order_of_bytes_is_that_of_the_format(
    pixel_format: PixelFormat, first: list[int]
) -> None:
    image = rgb_of(np.array([1, 2, 3] * 6, np.uint8), (3, 2), pixel_format)
    assert image.shape == (2, 3, 3)
    assert image[0, 0].tolist() == first


def test_an_image_that_is_cut_is_told() -> None:
    with pytest.raises(ValueError, match="too small for 640 x 480 pixels of Mono8"):
        rgb_of(np.zeros(100, np.uint8), (640, 480), "Mono8")


# ---------------------------------------------------------------------- options


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({}, "name the cameras"),
        ({"sources": "Fake_1,Fake_1"}, "named twice"),
        ({"sources": "Fake_1", "width": 0}, "width must be from 1 to 16384"),
        ({"sources": "Fake_1", "exposure": -1.0}, "exposure must not be negative"),
        ({"sources": "Fake_1", "silent_after": 0.0}, "silent_after must be positive"),
    ],
)
def test_options_that_cannot_be_used_are_refused(options: dict[str, Any], error: str) -> None:
    with pytest.raises(o80.Error, match=error), ROBOT.inline(frequency=30, **options):
        pass


class Stubborn(aravis.Camera):
    """Keeps the region that it had."""

    def _set_up(self, settings: aravis.Settings) -> None:
        super()._set_up(dataclasses.replace(settings, region=(0, 0, 320, 240)))


def test_an_image_of_another_size_names_the_options(
    segment: str, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(aravis, "Camera", Stubborn)
    with ROBOT.inline(segment, frequency=1000, history=4, sources="Fake_1") as cameras:
        row = row_where(cameras, lambda row: row.reasons.camera_0 == CameraReason.disconnected)
        assert not row.images.any()
    told = capfd.readouterr().err
    assert "camera Fake_1: its images need --width 320 and --height 240" in told


def test_a_missing_library_names_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    aravis.function.cache_clear()
    aravis._libraries.cache_clear()
    monkeypatch.setattr(aravis, "LIBRARIES", ("libaravis-none.so",))
    try:
        with (
            pytest.raises(o80.DriverError, match=r"apt-get install libaravis-0\.8-0"),
            ROBOT.inline(frequency=30, sources="Fake_1"),
        ):
            pass
    finally:
        aravis._libraries.cache_clear()
