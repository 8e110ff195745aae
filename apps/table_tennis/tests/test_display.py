"""The page that `render_mode="human"` opens."""

import time
import urllib.error
import urllib.request
from contextlib import closing

import gymnasium
import pytest
from opened_environment import STILL

import o80_table_tennis
from o80_table_tennis.environment import TableTennisEnvironment

NO_SCREEN = {"DISPLAY": "", "WAYLAND_DISPLAY": ""}


@pytest.fixture(autouse=True)
def no_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    """No browser is opened, whoever runs the tests."""
    for name, value in NO_SCREEN.items():
        monkeypatch.setenv(name, value)


def address(told: str) -> str:
    """Address of the page, from the printed text."""
    return told.split(" at ")[1].strip()


@pytest.mark.parametrize("name", [o80_table_tennis.ACCELERATED, o80_table_tennis.REAL_TIME])
def test_human_mode_serves_a_page_until_the_environment_is_closed(
    name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    environment = gymnasium.make(name, render_mode="human")
    with closing(environment):
        url = address(capfd.readouterr().err)
        environment.reset(seed=1)
        environment.step(STILL)
        assert environment.render() is None
        with urllib.request.urlopen(url, timeout=30) as page:
            assert page.status == 200
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(url, timeout=5)


def test_human_mode_shows_an_accelerated_environment_in_real_time() -> None:
    steps = 20
    with TableTennisEnvironment(render_mode="human") as environment:
        environment.reset(seed=1)
        environment.step(STILL)
        begin = time.monotonic()
        for _ in range(steps):
            environment.step(STILL)
        assert time.monotonic() - begin >= (steps - 1) * 0.01
