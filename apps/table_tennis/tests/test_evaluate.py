"""Policies are compared on the same balls, by one command."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from o80_table_tennis import evaluate as program
from o80_table_tennis.evaluate import named_policy
from o80_table_tennis.learning.paired import Paired
from o80_table_tennis.players.conditions import Conditions
from o80_table_tennis.players.policies import StillPolicy
from o80_table_tennis.playing import evaluate


@pytest.fixture
def runner() -> tuple[CliRunner, typer.Typer]:
    app = typer.Typer()
    app.command()(program.main)
    return CliRunner(), app


def test_an_evaluation_counts_what_came_of_each_ball_and_repeats() -> None:
    first, again = (evaluate(StillPolicy(), Conditions(), balls=4) for _ in range(2))
    assert [episode.ball for episode in first.episodes] == [0, 1, 2, 3]
    assert first.episodes == again.episodes
    assert first.touched == np.mean([episode.touched for episode in first.episodes])
    other = evaluate(StillPolicy(), Conditions(), balls=4, seed=5)
    assert [e.reward for e in other.episodes] != [e.reward for e in first.episodes]


def test_every_named_policy_plays_in_its_own_conditions() -> None:
    for name in ("still", "random", "scripted"):
        policy, conditions = named_policy(name, balls="narrow")
        assert conditions.balls == "narrow"
        assert len(evaluate(policy, conditions, balls=1).episodes) == 1
    _, scripted = named_policy("scripted", preset="standard")
    assert scripted.preset == "standard"
    assert scripted.observation == "published"


def test_the_command_compares_policies_and_draws_their_landings(
    runner: tuple[CliRunner, typer.Typer], tmp_path: Path
) -> None:
    tester, app = runner
    arguments = ["still", "random", "--count", "2", "--balls", "narrow", "--output", str(tmp_path)]
    result = tester.invoke(app, arguments)
    assert result.exit_code == 0, result.output
    figures = json.loads((tmp_path / "evaluation.json").read_text())
    assert list(figures) == ["still", "random"]
    assert "0 to 65.8 %" in result.output, "Wilson's interval of no ball of two"
    assert all(each["balls"] == 2 for each in figures.values())
    assert (tmp_path / "landings.png").stat().st_size > 1000


def test_a_wrong_name_is_one_line_that_says_what_to_give(
    runner: tuple[CliRunner, typer.Typer], tmp_path: Path
) -> None:
    tester, app = runner
    for arguments, words in (
        (["magic"], "magic.npz: no such file"),
        (["still", "--balls", str(tmp_path / "none")], "no such file or folder"),
    ):
        result = tester.invoke(app, [*arguments, "--output", str(tmp_path)])
        assert result.exit_code == 1
        assert words in result.output


def test_the_same_balls_are_compared_accelerated_and_in_real_time(
    runner: tuple[CliRunner, typer.Typer], tmp_path: Path
) -> None:
    tester, app = runner
    arguments = ["learned", "--real-time", "--count", "2", "--output", str(tmp_path)]
    result = tester.invoke(app, arguments)
    assert result.exit_code == 0, result.output
    figures = json.loads((tmp_path / "evaluation.json").read_text())
    assert list(figures) == ["learned, inline", "learned, real time", "learned, paired"]
    pair = figures["learned, paired"]
    assert pair["balls"] == 2
    assert 0 <= pair["late_actions"] <= pair["actions"]
    assert pair["actions"] > 0
    for way, name in (("inline", "accelerated"), ("real time", "real_time")):
        once = pair["returned_both"] + pair[f"returned_only_{name}"]
        assert 2 * figures[f"learned, {way}"]["returned"] == once
    assert "of 2 balls" in " ".join(result.output.split())


def test_pairs_are_of_the_same_balls() -> None:
    one = evaluate(StillPolicy(), Conditions(), balls=2)
    first, second = (replace(one.episodes[0], returned=each) for each in (True, False))
    accelerated, real_time = (
        replace(one, episodes=[replace(first, ball=0), replace(other, ball=1)])
        for other in (first, second)
    )
    pair = Paired.of(accelerated, real_time)
    assert (pair.returned_both, pair.returned_only_accelerated, pair.balls) == (1, 1, 2)
    assert "difference -50.0 points" in str(pair)
    with pytest.raises(ValueError, match="the same balls"):
        Paired.of(accelerated, replace(real_time, episodes=real_time.episodes[::-1]))
