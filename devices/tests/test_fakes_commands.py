"""The command lines of the fakes: numbers that cannot be used, ports that are in use."""

import socket

import pytest

from o80_devices.fakes import ball_launcher, qualisys, tracking_server


@pytest.mark.parametrize(
    ("fake", "arguments", "error"),
    [
        (qualisys, ["--frequency", "0"], "--frequency: a positive number is needed, got '0'"),
        (qualisys, ["--frequency", "nan"], "--frequency: a positive number is needed"),
        (qualisys, ["--port", "70000"], "--port: a port from 1 to 65535 is needed"),
        (qualisys, ["--lose", "1.5"], "--lose: a share between 0 and 1 is needed"),
        (qualisys, ["--silent-every", "-1"], "--silent-every: a number of at least 0 is needed"),
        (tracking_server, ["--noise", "x"], "--noise: a number of at least 0 is needed, got 'x'"),
        (tracking_server, ["--lose", "-0.1"], "--lose: a share between 0 and 1 is needed"),
        (tracking_server, ["--seed", "-1"], "--seed: a whole number of at least 0 is needed"),
        (ball_launcher, ["--magazine", "-1"], "--magazine: a whole number of at least 0"),
        (ball_launcher, ["--launch-time", "inf"], "--launch-time: a number of at least 0"),
        (ball_launcher, ["--refuse", "2"], "--refuse: a share between 0 and 1 is needed"),
        (ball_launcher, ["--place", "1,2"], "--place: three numbers such as 0.4,2.9,0 are needed"),
    ],
)
def test_numbers_that_cannot_be_used_are_refused(
    fake: object, arguments: list[str], error: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        fake.main(arguments)  # type: ignore[attr-defined]
    assert error in capsys.readouterr().err


@pytest.mark.parametrize("fake", [qualisys, tracking_server, ball_launcher])
def test_a_port_that_is_in_use_is_told(fake: object, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        place = ["--port", port] if fake is qualisys else ["--address", f"tcp://127.0.0.1:{port}"]
        with pytest.raises(SystemExit):
            fake.main(place)  # type: ignore[attr-defined]
    error = capsys.readouterr().err
    assert port in error
    assert "cannot be used: Address already in use" in error
