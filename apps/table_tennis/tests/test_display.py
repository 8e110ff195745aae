"""The page that `render_mode="human"` opens."""

import os
import time
import urllib.error
import urllib.request
import warnings
from contextlib import closing

import gymnasium
import pytest
from gymnasium.utils.env_checker import check_env
from opened_environment import STILL

import o80
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


@pytest.mark.check
def test_gymnasium_finds_nothing_to_complain_of_in_human_mode() -> None:
    environment = gymnasium.make(o80_table_tennis.ACCELERATED, render_mode="human")
    with closing(environment), warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        check_env(environment.unwrapped)


def test_human_mode_shows_an_accelerated_environment_in_real_time() -> None:
    steps = 20
    with TableTennisEnvironment(render_mode="human") as environment:
        environment.reset(seed=1)
        environment.step(STILL)
        begin = time.monotonic()
        for _ in range(steps):
            environment.step(STILL)
        assert time.monotonic() - begin >= (steps - 1) * 0.01


def test_a_view_that_cannot_start_leaves_no_segment(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise o80.MissingExtra("a view needs mujoco")

    monkeypatch.setattr(o80, "View", refuse)
    with pytest.raises(o80.MissingExtra):
        TableTennisEnvironment(render_mode="human")
    own = f"-{os.getpid()}-"
    assert not [each for each in o80.segments() if each.life == "running" and own in each.name]
