"""The experiment from end to end: the program `o80-table-tennis`.

Starts the arm in real time (500 Hz, a process of its own), its simulated twin (bursting, another
one) and an environment between them, plays episodes, then plays accelerated, as processes and
inline. Prints rates, lateness and returns; writes recordings and a report.
"""

from __future__ import annotations

import shlex
import sys
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

import o80
from o80.base.screen import keep_printing

from .balls.sources import balls_from
from .ending import raise_if_terminated, unwind_on_sigterm
from .environment import TableTennisEnvironment
from .players.learned_policy import shipped_policy
from .players.policies import BASELINES, DEFAULT_FACTOR, Policy, default_policy
from .playing import play
from .report.episode_summary import EpisodeSummary
from .report.recorded_episodes import RecordedEpisode, recorded_episodes
from .report.report import Report, write_report
from .report.statistics import Played
from .rig.arm_numbers import ArmNumbers
from .settings import Pacing, RigSettings, TaskSettings


@dataclass(frozen=True)
class DemoSettings:
    """Settings of the demo: what it plays, and where it writes."""

    balls: Path | None = None
    """Recordings; None: simulated shots."""
    episodes: int = 20
    """Episodes of each accelerated mode."""
    real_time_episodes: int = 5
    seed: int = 1
    muscle: str = "linear"
    output: Path = Path("build/demo")

    def task(self) -> TaskSettings:
        """Task that every environment of the demo plays."""
        balls = None if self.balls is None else str(self.balls)
        return TaskSettings(balls=balls, factor=DEFAULT_FACTOR)

    def rig(self, pacing: Pacing) -> RigSettings:
        """The arm and its twin, running like this."""
        return RigSettings(pacing=pacing, muscle=self.muscle)

    @property
    def recording(self) -> Path:
        """The file with every row of all modes."""
        return self.output / "run.mcap"

    @property
    def learned_recording(self) -> Path:
        """The file with every row of the learned policy's episodes."""
        return self.output / "learned.mcap"

    def episodes_of(self, pacing: Pacing) -> int:
        """How many episodes are played like this."""
        return self.real_time_episodes if pacing.real_time else self.episodes


def run_demo(settings: DemoSettings, console: Console) -> Report:
    """Plays all modes, writes all files, returns the report."""
    begin = time.monotonic()
    settings.output.mkdir(parents=True, exist_ok=True)
    for recording in (settings.recording, settings.learned_recording):
        recording.unlink(missing_ok=True)
    modes: dict[Pacing, Played] = {}
    with _progress(console) as progress:
        for pacing in (Pacing.REAL_TIME, Pacing.PROCESSES, Pacing.INLINE):
            if episodes := settings.episodes_of(pacing):
                rig = settings.rig(pacing)
                modes[pacing] = _play(
                    settings,
                    pacing.value,
                    default_policy(ArmNumbers.of_rig(rig)),
                    rig,
                    settings.task(),
                    progress,
                    episodes=episodes,
                    record=settings.recording,
                )
        policies = _compared(settings, modes, progress)
    recorded = _recorded(settings, modes)
    return write_report(settings.output, modes, policies, recorded, begin=begin)


def _play(
    settings: DemoSettings,
    name: str,
    policy: Policy,
    rig: RigSettings,
    task: TaskSettings,
    progress: Progress,
    *,
    episodes: int,
    record: Path | None = None,
) -> Played:
    """Episodes with the first balls, added to a recording."""
    bar = progress.add_task(name, total=episodes, returns="0 returned")
    available = len(balls_from(task.balls))
    balls = (number % available for number in range(episodes))
    with TableTennisEnvironment(rig=rig, task=task, record=record) as environment:
        moved_on = _advance(progress, bar)
        played = play(environment, policy, balls, seed=settings.seed, after_each=moved_on)
    return played


def _compared(
    settings: DemoSettings, modes: Mapping[Pacing, Played], progress: Progress
) -> dict[str, Played]:
    """All policies and the baselines on the same balls, as fast as they can.

    The learned policy plays on the arm and in the noise that it knows, in a recording of its own.
    """
    scripted = modes.get(Pacing.INLINE) or modes[Pacing.REAL_TIME]
    learned, episodes = shipped_policy(), len(scripted.episodes)
    task = replace(learned.conditions.task(fly_out=False), balls=settings.task().balls)
    compared = {
        "scripted": scripted,
        "learned": _play(
            settings,
            "learned",
            learned,
            learned.conditions.rig(),
            task,
            progress,
            episodes=episodes,
            record=settings.learned_recording,
        ),
    }
    for name, (make, factor) in BASELINES.items():
        rig, task = settings.rig(Pacing.INLINE), replace(settings.task(), factor=factor)
        compared[name] = _play(settings, name, make(), rig, task, progress, episodes=episodes)
    return compared


def _recorded(
    settings: DemoSettings, modes: Iterable[Pacing]
) -> dict[Pacing, list[RecordedEpisode]]:
    """The recorded episodes of each mode."""
    episodes = recorded_episodes(settings.recording)
    return {
        pacing: [episode for episode in episodes if episode.pacing == pacing.value]
        for pacing in modes
    }


def _progress(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description:>16}"),
        BarColumn(bar_width=30),
        MofNCompleteColumn(),
        TextColumn("{task.fields[returns]}"),
        TimeElapsedColumn(),
        console=console,
    )


def _advance(progress: Progress, bar: Any) -> Callable[[EpisodeSummary], None]:
    """Moves a bar on by an episode."""
    returns = 0

    def advance(summary: EpisodeSummary) -> None:
        nonlocal returns
        raise_if_terminated()
        returns += summary.returned
        progress.update(bar, advance=1, returns=f"{returns} returned")

    return advance


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
    unwind_on_sigterm()
    console = Console()
    settings = DemoSettings(
        balls=balls,
        episodes=episodes,
        real_time_episodes=real_time_episodes,
        seed=seed,
        muscle=muscle,
        output=output,
    )
    if episodes == 0 and real_time_episodes == 0:
        raise typer.BadParameter("nothing to play: ask for at least one episode")
    try:
        balls_from(settings.task().balls)
    except (OSError, ValueError) as error:
        raise typer.BadParameter(str(error), param_hint="--balls") from error
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise typer.BadParameter(str(error), param_hint="--output") from error
    try:
        run_demo(settings, console).print(console)
    except o80.Error as error:
        print(f"o80: {error}", file=sys.stderr)
        raise typer.Exit(1) from error
    _say_where(settings, console)


def command_of_o80() -> str:
    """The path of the program `o80` beside this Python, as one types it in this folder.

    Its name alone is not enough: `make` finds programs that the terminal does not.
    """
    program = Path(sys.executable).with_name("o80")
    inside = program.is_relative_to(Path.cwd())
    return shlex.quote(str(program.relative_to(Path.cwd()) if inside else program))


def _say_where(settings: DemoSettings, console: Console) -> None:
    """Prints what was written, and how to look at it."""
    recording = shlex.quote(str(settings.recording))
    arm = next(iter(o80.open(settings.recording)))
    command = command_of_o80()
    lines = (
        f"report: {settings.output}",
        f"recording of every row: {recording}; of the learned policy: {settings.learned_recording}",
        f"  {command} view {recording}      # arm, table, balls in the browser, back in time too",
        f"  {command} replay {recording}    # repeats all of it and compares bit for bit",
        f"  {command} plot {recording} --segment {arm} --fields agonist_1,extended.joint_positions",
    )
    for line in lines:
        console.print(line, soft_wrap=True, highlight=False)


def run() -> None:
    """The program `o80-table-tennis`."""
    keep_printing()
    typer.run(main)


if __name__ == "__main__":
    run()
