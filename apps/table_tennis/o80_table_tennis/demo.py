"""The experiment from end to end: the program `o80-table-tennis`.

Starts the arm in real time (500 Hz, in its own process), its simulated twin (bursting, in another
one) and an environment between them, and plays episodes; then plays accelerated, as processes and
inline. Prints rates, lateness and returns; writes recordings and a report.
"""

from __future__ import annotations

import shlex
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

import o80
from o80.base.finite import json_text
from o80.base.screen import keep_printing

from .balls.sources import balls_from
from .ending import ends_in_order, raise_if_ended
from .environment import TableTennisEnvironment
from .players.hitting_policy import HittingSettings
from .players.learned_policy import shipped_policy
from .players.policies import BASELINES, DEFAULT_FACTOR, Policy, default_policy
from .playing import play
from .report.episode_summary import EpisodeSummary
from .report.recorded_episodes import recorded_episodes
from .report.report import Figures, mode_figures, print_table
from .report.statistics import Played
from .settings import Pacing, RigSettings, TaskSettings

COLUMNS = (
    TextColumn("{task.description:>16}"),
    BarColumn(bar_width=30),
    MofNCompleteColumn(),
    TextColumn("{task.fields[returns]}"),
    TimeElapsedColumn(),
)
"""Columns of the progress bar."""


@dataclass(frozen=True)
class Demo:
    """Plays all modes and policies, each with the same first balls."""

    task: TaskSettings
    seed: int
    progress: Progress

    def play(
        self, name: str, policy: Policy, rig: RigSettings, episodes: int, **settings: Any
    ) -> Played:
        """Plays episodes with a policy. settings: `record`, and a `task` instead of the demo's."""
        bar = self.progress.add_task(name, total=episodes, returns="0 returned")
        task, returns = settings.pop("task", self.task), 0

        def advance(summary: EpisodeSummary) -> None:
            nonlocal returns
            raise_if_ended()
            returns += summary.returned
            self.progress.update(bar, advance=1, returns=f"{returns} returned")

        balls = (number % len(balls_from(task.balls)) for number in range(episodes))
        with TableTennisEnvironment(rig=rig, task=task, **settings) as environment:
            played = play(environment, policy, balls, seed=self.seed, after_each=advance)
        return played

    def play_modes(
        self, muscle: str, episodes: int, real_time_episodes: int, record: Path
    ) -> dict[Pacing, Played]:
        """Plays the scripted policy with each pacing, and appends to a recording."""
        modes = {}
        for pacing in (Pacing.REAL_TIME, Pacing.PROCESSES, Pacing.INLINE):
            if count := real_time_episodes if pacing.real_time else episodes:
                rig = RigSettings(pacing=pacing, muscle=muscle)
                policy = default_policy(HittingSettings.of_rig(rig))
                modes[pacing] = self.play(pacing.value, policy, rig, count, record=record)
        return modes

    def play_policies(self, scripted: Played, muscle: str, record: Path) -> dict[str, Played]:
        """Plays all policies and baselines on the same balls, accelerated.

        The learned policy plays with the arm and noise of its training, in a recording.
        """
        learned, count = shipped_policy(), len(scripted.episodes)
        rig = learned.conditions.rig()
        task = replace(learned.conditions.task(fly_out=False), balls=self.task.balls)
        played = self.play("learned", learned, rig, count, task=task, record=record)
        compared = {"scripted": scripted, "learned": played}
        for name, (make, factor) in BASELINES.items():
            task = replace(self.task, factor=factor)
            compared[name] = self.play(name, make(), RigSettings(muscle=muscle), count, task=task)
        return compared


def main(
    balls: Annotated[
        Path | None, typer.Option(help="A recording or a folder of them; else simulated shots.")
    ] = None,
    episodes: Annotated[int, typer.Option(min=0, help="Of each accelerated mode.")] = 20,
    real_time_episodes: Annotated[int, typer.Option(min=0, help="In real time.")] = 5,
    seed: Annotated[int, typer.Option(min=0, help="Of the environments.")] = 1,
    muscle: Annotated[str, typer.Option(help="Model of the muscles: linear or hill.")] = "linear",
    output: Annotated[Path, typer.Option(help="Folder that is written.")] = Path("build/demo"),
) -> None:
    """Plays table tennis in real time, then accelerated; reports rates, lateness and returns."""
    begin, console = time.monotonic(), Console()
    if episodes == 0 and real_time_episodes == 0:
        raise typer.BadParameter("nothing to play: ask for at least one episode")
    task = TaskSettings(balls=None if balls is None else str(balls), factor=DEFAULT_FACTOR)
    recording, of_learned = output / "run.mcap", output / "learned.mcap"
    try:
        balls_from(task.balls)
    except (OSError, ValueError) as error:
        raise typer.BadParameter(str(error), param_hint="--balls") from error
    try:
        output.mkdir(parents=True, exist_ok=True)
        for each in (recording, of_learned):
            each.unlink(missing_ok=True)
    except OSError as error:
        raise typer.BadParameter(str(error), param_hint="--output") from error
    try:
        with Progress(*COLUMNS, console=console) as progress:
            demo = Demo(task, seed, progress)
            modes = demo.play_modes(muscle, episodes, real_time_episodes, recording)
            scripted = modes.get(Pacing.INLINE) or modes[Pacing.REAL_TIME]
            policies = demo.play_policies(scripted, muscle, of_learned)
        recorded = [episode.pacing for episode in recorded_episodes(recording)]
    except o80.Error as error:
        print(f"o80: {error}", file=sys.stderr)
        raise typer.Exit(1) from error
    report: Figures = {
        "modes": {
            pacing.value: mode_figures(played, recorded.count(pacing.value))
            for pacing, played in modes.items()
        },
        "policies": {name: played.as_json() for name, played in policies.items()},
        "seconds": round(time.monotonic() - begin, 1),
    }
    (output / "report.json").write_text(json_text(report, indent=2) + "\n")
    print_table(console, "table tennis", report["modes"])
    print_table(console, "the same balls with other policies", report["policies"])
    console.print(f"seconds: {report['seconds']:g}", highlight=False)
    for line in _written(recording, of_learned):
        console.print(line, soft_wrap=True, highlight=False)


def command_of_o80() -> str:
    """Returns the path of this Python's program `o80`, relative to this folder if inside it.

    The name alone is not enough: `make` finds programs outside of the terminal's path.
    """
    program = Path(sys.executable).with_name("o80")
    inside = program.is_relative_to(Path.cwd())
    return shlex.quote(str(program.relative_to(Path.cwd()) if inside else program))


def _written(path: Path, of_learned: Path) -> tuple[str, ...]:
    """Lists the written files, and commands to view them."""
    recording, command = shlex.quote(str(path)), command_of_o80()
    arm = next(iter(o80.open(path)))
    return (
        f"report: {path.parent}",
        f"recording of every row: {recording}; of the learned policy: {of_learned}",
        f"  {command} view {recording}      # arm, table, balls in the browser, back in time too",
        f"  {command} replay {recording}    # repeats all of it and compares bit for bit",
        f"  {command} plot {recording} --segment {arm} --fields agonist_1,extended.joint_positions",
    )


def run() -> None:
    """The program `o80-table-tennis`."""
    keep_printing()
    with ends_in_order():
        typer.run(main)


if __name__ == "__main__":
    run()
