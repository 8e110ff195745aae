"""The messages of the launcher, byte by byte."""

import struct

import pytest

from o80_devices.ball_launcher.messages import Kind, Request, State


def test_a_launch_is_two_bytes() -> None:
    assert Request(Kind.LAUNCH_BALL).encoded() == b"\x08\x01"


def test_a_state_is_sent_with_all_its_fields() -> None:
    values = (0.25, 0.5, 0.75, 1.0, 0.0)
    fields = b"".join(
        bytes([number << 3 | 5]) + struct.pack("<f", value)
        for number, value in enumerate(values, start=1)
    )
    sent = Request(Kind.SET_STATE, State(*values)).encoded()
    assert sent == b"\x08\x00\x12" + bytes([len(fields)]) + fields


@pytest.mark.parametrize("kind", Kind)
def test_a_message_is_read_as_it_was_sent(kind: Kind) -> None:
    request = Request(kind, State(0.1, 0.2, 0.3, 0.4, 0.5).rounded())
    assert Request.decoded(request.encoded()) == request


def test_fields_that_are_missing_have_the_defaults_of_the_protocol() -> None:
    assert Request.decoded(b"\x08\x00\x12\x00").state == State(0.5, 0.5, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("content", [b"", b"\xff", b"hello", b"\x12\x00"])
def test_other_bytes_are_refused(content: bytes) -> None:
    with pytest.raises(ValueError, match="not a request"):
        Request.decoded(content)
