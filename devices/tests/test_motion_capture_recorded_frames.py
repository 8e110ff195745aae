"""Files of frames that are damaged: an error that names the file, whatever the bytes are."""

import struct
from pathlib import Path

from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import o80
from o80_devices.motion_capture.recorded_frames import COUNT, FORMAT, HEADER, VALUES, load

NAME = b"racket"
FRAME = (
    HEADER.pack(FORMAT, 7, 300.0, 0.01, 1_000_000_000, 1)
    + COUNT.pack(len(NAME))
    + NAME
    + VALUES.pack(True, 0.0, 0.0, 0.0, 1.0, 1.0, 2.0, 3.0, 0.5)
)
RECORDING = COUNT.pack(1) + FRAME
LENGTH_OF_NAME = COUNT.size + HEADER.size
RATE = COUNT.size + 8
LATENCY = RATE + 8


def test_a_frame_is_read(tmp_path: Path) -> None:
    file = tmp_path / "frames.dat"
    file.write_bytes(RECORDING)
    recorded = load(file)
    assert recorded.rate == 300.0
    assert recorded.frames[0].subjects["racket"].position == (1.0, 2.0, 3.0)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=st.integers(0, len(RECORDING)), noise=st.binary(max_size=8), cut=st.booleans())
@example(place=LENGTH_OF_NAME, noise=b"\xff" * 8, cut=False)
@example(place=LATENCY, noise=struct.pack("<d", float("inf")), cut=False)
@example(place=RATE, noise=struct.pack("<d", 1e-300), cut=False)
@example(place=RATE, noise=struct.pack("<d", float("inf")), cut=False)
def test_noise_in_a_file_is_an_error_or_another_frame(
    place: int, noise: bytes, cut: bool, tmp_path: Path
) -> None:
    file = tmp_path / "frames.dat"
    rest = b"" if cut else RECORDING[place + len(noise) :]
    file.write_bytes(RECORDING[:place] + noise + rest)
    try:
        recorded = load(file)
    except o80.InvalidArgument as error:
        assert "frames.dat" in str(error)  # noqa: PT017
    else:
        assert round(1e9 / recorded.rate) > 0
