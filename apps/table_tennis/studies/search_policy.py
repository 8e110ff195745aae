"""The search for the numbers of the hitting policy: `python search_policy.py`.

An evolution strategy with one parent and one child: the child is the parent with every number
changed at random; it becomes the parent if its mean reward is larger. Steps grow after a success
and shrink after a failure. Played is the accelerated environment inline, so that the same seed
finds the same numbers; by default on simulated shots, so that recorded ones stay unseen.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from o80_table_tennis.players.found_parameters import FILE, FoundParameters, with_parameters
from o80_table_tennis.players.hitting_policy import HittingPolicy, HittingSettings

if TYPE_CHECKING:
    from o80_table_tennis.environment import TableTennisEnvironment

SCALES = {
    "interception.target_x": 0.08,
    "interception.target_y": 0.08,
    "interception.flight": 0.03,
    "interception.comfortable_y": 0.05,
    "control.stiffness": 40.0,
    "control.damping": 4.0,
    "control.mean_pressure": 0.04,
    "control.ahead": 0.002,
    "control.settling": 0.003,
}
"""The parameters that are searched, and the scale of the first steps."""
MAX_BALLS = 80
"""The played shots are spread evenly over so many numbers: there is no end of simulated ones."""
GROWTH = 1.3
"""Growth of the steps after a success; four failures undo it."""


@dataclass(frozen=True)
class Score:
    """How well some parameters played."""

    mean_reward: float
    returns: int
    episodes: int


Parameters = Mapping[str, float]
Scoring = Callable[[Parameters], Score]


def start_parameters() -> dict[str, float]:
    """The numbers that the policy has without any search."""
    settings = HittingSettings()
    values = {}
    for name in SCALES:
        part, number = name.split(".")
        values[name] = float(getattr(getattr(settings, part), number))
    return values


def search(
    score: Scoring,
    *,
    candidates: int,
    seed: int,
    after_each: Callable[[int, Score, Score], None] = lambda number, child, parent: None,
) -> tuple[Parameters, Score]:
    """The best parameters among `candidates`, and their score."""
    rng = np.random.default_rng(seed)
    parent = start_parameters()
    best = score(parent)
    step = 1.0
    for number in range(candidates):
        draws = rng.normal(size=len(SCALES))
        child = {
            name: parent[name] + step * SCALES[name] * float(draw)
            for name, draw in zip(SCALES, draws, strict=True)
        }
        child_score = score(child)
        better = child_score.mean_reward > best.mean_reward
        if better:
            parent, best = child, child_score
        step *= GROWTH if better else GROWTH**-0.25
        after_each(number, child_score, best)
    return parent, best


def scoring(environment: TableTennisEnvironment, balls: Sequence[int], seed: int) -> Scoring:
    """Scores parameters by an episode with each of `balls`, always the same ones."""
    from o80_table_tennis.playing import play

    def score(parameters: Parameters) -> Score:
        policy = HittingPolicy(with_parameters(HittingSettings(), parameters))
        played = play(environment, policy, balls, seed=seed)
        mean = float(np.mean([episode.reward for episode in played.episodes]))
        return Score(mean_reward=mean, returns=played.returns, episodes=len(balls))

    return score


def main(
    candidates: Annotated[int, typer.Option(help="How many sets of numbers are tried.")] = 60,
    episodes: Annotated[int, typer.Option(help="Played with each of them.")] = 20,
    seed: Annotated[int, typer.Option(help="The same seed finds the same numbers.")] = 1,
    balls: Annotated[Path | None, typer.Option(help="Recordings; else simulated shots.")] = None,
    output: Annotated[Path, typer.Option(help="Where the numbers are written.")] = FILE,
) -> None:
    """Searches for numbers with which the hitting policy earns more."""
    from o80_table_tennis.balls.sources import balls_from
    from o80_table_tennis.environment import TableTennisEnvironment
    from o80_table_tennis.settings import TaskSettings

    def tell(number: int, child: Score, best: Score) -> None:
        print(
            f"{number + 1:4d}: reward {child.mean_reward:.4f}, {child.returns} returned; "
            f"best {best.mean_reward:.4f}, {best.returns} of {best.episodes} returned",
            flush=True,
        )

    path = None if balls is None else str(balls)
    available = min(len(balls_from(path)), MAX_BALLS)
    numbers = [available * number // episodes for number in range(episodes)]
    # by the published reward, with which the numbers of the file were found
    task = TaskSettings(balls=path, factor=HittingSettings().factor, reward="published")
    with TableTennisEnvironment(task=task) as environment:
        score = scoring(environment, numbers, seed)
        parameters, best = search(score, candidates=candidates, seed=seed, after_each=tell)
    command = f"python search_policy.py --candidates {candidates} --episodes {episodes}"
    command += f" --seed {seed}" + ("" if balls is None else f" --balls {balls.name}")
    FoundParameters(
        command=command,
        parameters=parameters,
        mean_reward=best.mean_reward,
        returns=best.returns,
        episodes=best.episodes,
    ).save(output)
    print(f"written: {output}")


if __name__ == "__main__":
    typer.run(main)
