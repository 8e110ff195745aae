"""Requirements of Gymnasium for an environment."""

import warnings
from contextlib import closing
from typing import Any

import gymnasium
import pytest
from gymnasium.utils.env_checker import check_env
from opened_environment import PATIENT

import o80_table_tennis
from o80_table_tennis.settings import RigSettings


@pytest.mark.parametrize("render_mode", [None, pytest.param("rgb_array", marks=pytest.mark.check)])
@pytest.mark.parametrize(
    ("name", "options"),
    [
        (o80_table_tennis.ACCELERATED, {}),
        (o80_table_tennis.ACCELERATED, {"processes": True}),
        (o80_table_tennis.ACCELERATED, {"rig": RigSettings(worlds=4)}),
        (o80_table_tennis.REAL_TIME, {"task": PATIENT}),
    ],
)
def test_gymnasium_finds_nothing_to_complain_of(
    name: str, options: dict[str, Any], render_mode: str | None
) -> None:
    environment = gymnasium.make(name, render_mode=render_mode, **options)
    with closing(environment), warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        check_env(environment.unwrapped, skip_render_check=render_mode is None)


def test_only_the_environment_by_the_clock_is_nondeterministic() -> None:
    assert not gymnasium.spec(o80_table_tennis.ACCELERATED).nondeterministic
    assert gymnasium.spec(o80_table_tennis.REAL_TIME).nondeterministic
