"""Session of `python -m o80_table_tennis.train`: a training, its verdict, its files."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from ..players.learned_policy import LearnedPolicy
from . import checkpoint, curve
from .curve import CURVE, CurvePoint
from .curve_plot import plot_curves
from .episodes import Shares
from .evaluation import Evaluation, evaluate
from .landing_plot import plot_landings
from .settings import LearningSettings
from .training import Training
from .verdict import REPORT, baselines, print_table, write_report


class Session:
    """Files go to `output`; a blind policy that is trained after it to `output`/blind."""

    def __init__(
        self, settings: LearningSettings, output: Path, console: Console, *, evaluated: int
    ) -> None:
        self._settings, self._output, self._console = settings, output, console
        self._evaluated = evaluated
        self._restarts = 0
        torch.set_num_threads(1)  # small networks: more threads wait for each other

    def run(self, *, resume: bool, blind_share: float, recorded: Path | None) -> None:
        """Trains, evaluates, writes."""
        settings, output = self._settings, self._output
        policy, minutes, environment = self._train(settings, output, resume=resume)
        name = "blind" if settings.blind else "learned"
        evaluations = [*baselines(settings.conditions, balls=self._evaluated)]
        blind = None
        if blind_share > 0:
            unseeing = replace(
                settings, blind=True, decisions=max(1, round(blind_share * settings.decisions))
            )
            folder = output / "blind"
            begun = checkpoint.found(folder) is not None  # not if the first one was interrupted
            blind_policy, more, _ = self._train(unseeing, folder, resume=resume and begun)
            minutes += more
            blind = self._play("blind", blind_policy)
            evaluations.append(blind)
        verdict = self._play(name, policy)
        evaluations.append(verdict)
        told: dict[str, Any] = {
            "returned_simulated": verdict.returned,
            "returned_recorded": None,
            "returned_blind": None if blind is None else blind.returned,
            "environment_share": environment,
        }
        if recorded is not None:
            conditions = settings.conditions.playing(str(recorded))
            shots = evaluate(f"{name}, recorded balls", policy, conditions, balls=None)
            evaluations.append(shots)
            told["returned_recorded"] = shots.returned
        self._write(evaluations, told, policy, minutes)

    def _train(
        self, settings: LearningSettings, output: Path, *, resume: bool
    ) -> tuple[LearnedPolicy, float, float | None]:
        """The policy, the processor time that it took [min], and the environments' share of it."""
        what = "blind" if settings.blind else "learning"
        with Training(settings, output, resume=resume) as training, _bar(self._console) as bar:
            task = bar.add_task(what, total=settings.decisions, now="")
            self._restarts = training.progress.restarts
            policy = training.run(lambda point: self._tell(bar, task, what, point))
            return policy, training.progress.processor_minutes, self._share(what, training)

    def _share(self, what: str, training: Training) -> float | None:
        share = training.environment_share
        if share != share:  # NaN
            return None
        self._console.print(
            f"{what}: {100 * share:.0f} % of the processor time was spent in the environments",
            highlight=False,
            soft_wrap=True,
        )
        return round(share, 4)

    def _tell(self, bar: Progress, task: Any, what: str, point: CurvePoint) -> None:
        now = f"touched {point.touched:.2f}, returned {point.returned:.2f}"
        bar.update(task, completed=point.decisions, now=now)
        if point.restarts > self._restarts:
            bar.console.print(f"{what}: the network had got stuck; a new one begins")
        self._restarts = point.restarts
        if point.evaluated:
            bar.console.print(
                f"{what}: {point.decisions:9d} decisions, {point.episodes:7d} episodes, "
                f"{point.processor_minutes:5.1f} min: touched {point.evaluated_touched:.2f}, "
                f"returned {point.evaluated_returned:.2f} without exploration; {now} with it",
                highlight=False,
                soft_wrap=True,
            )

    def _play(self, name: str, policy: LearnedPolicy) -> Evaluation:
        return evaluate(name, policy, policy.conditions, balls=self._evaluated)

    def _write(
        self,
        evaluations: list[Evaluation],
        told: dict[str, Any],
        policy: LearnedPolicy,
        minutes: float,
    ) -> None:
        output = self._output
        print_table(evaluations, self._console)
        plot_landings(output / "landings.png", evaluations)
        plot_curves(
            output / "curve.png",
            {f"seed {self._settings.seed}": curve.read(output / CURVE)},
            baselines={
                each.name: Shares(each.touched, each.returned, each.reward)
                for each in evaluations
                if each.name in ("still arm", "random actions", "blind")
            },
            title=f"learning to return {policy.conditions.balls} shots",
        )
        figures = {
            **told,
            "minutes": round(minutes, 4),
            "decisions": policy.training["decisions"],
            "seed": self._settings.seed,
            "restarts": policy.training["restarts"],
            "evaluations": {each.name: each.as_json() for each in evaluations},
            "conditions": policy.conditions.as_json(),
        }
        write_report(output / REPORT, figures)
        self._console.print(f"policy, curve, landings and report: {output}", soft_wrap=True)


def _bar(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description:>9}"),
        BarColumn(bar_width=30),
        TextColumn("{task.completed:.0f} of {task.total:.0f}"),
        TextColumn("{task.fields[now]}"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(elapsed_when_finished=False),
        console=console,
        disable=not sys.stdout.isatty(),
    )
