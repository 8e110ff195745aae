"""The commands of `python -m o80.learning`."""

import json
import signal
import sys
import time
from dataclasses import asdict, replace
from pathlib import Path
from types import FrameType
from typing import Annotated, Any

import typer

from o80.base.errors import Error, InvalidArgument
from o80.base.extras import needed
from o80.base.finite import json_text
from o80.base.screen import Column, complain, keep_printing, print_table, unprinted
from o80.learning.training.curve import CURVE, CurvePoint, draw, points
from o80.learning.training.evaluation import BASELINES, SEED, Evaluation, evaluate
from o80.learning.training.policy import LearnedPolicy
from o80.learning.training.settings import TrainingSettings
from o80.learning.training.tasks import SUCCESS, NamedTask

BETWEEN = 5.0
"""Time between two printed lines about a training [s]."""
app = typer.Typer(
    name="python -m o80.learning",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Train a policy for any task, resume, evaluate, draw the curve.",
)
_OPTION = typer.Option("--option", help="NAME=VALUE: a parameter of the task.")
Options = Annotated[list[str] | None, _OPTION]


def main() -> None:
    """Entry point. Prints exceptions of o80 in one line; SIGTERM and the end of the terminal act
    like Ctrl-C.
    """
    keep_printing()
    by = 0

    def interrupt(number: int, _frame: FrameType | None) -> None:
        nonlocal by
        by = number
        raise KeyboardInterrupt

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:  # as set by nohup
            signal.signal(number, interrupt)
    code: str | int | None = 0
    try:
        app()
    except Error as error:
        complain(str(error))
        code = 1
    except (KeyboardInterrupt, SystemExit) as end:  # typer turns KeyboardInterrupt into SystemExit
        code = 128 + by if by else getattr(end, "code", 130)
    sys.exit(code or unprinted())


@app.command()
def train(
    task: Annotated[
        str,
        typer.Argument(
            help="Id of a registered environment (module:mine/Task-v0 imports its module first), "
            "module:Class or file.py:Class; or settings of a training, FILE.json or "
            "module:FILE.json."
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder that is written.")] = Path("build/training"),
    copies: Annotated[
        int | None, typer.Option(help="1 for a robot on the clock. [default: 32]")
    ] = None,
    decisions: Annotated[
        int | None, typer.Option(help="Of all copies, then it ends. [default: 1000000]")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Of all random numbers. [default: 1]")] = None,
    option: Options = None,
    import_: Annotated[
        list[str] | None,
        typer.Option(
            "--import",
            help="NAME=module:Class or file.py:Class: a parameter of the task that is an object of "
            "your own, such as a reward rule, or a function.",
        ),
    ] = None,
    success: Annotated[
        str | None, typer.Option(help=f"Entry of an episode's last info. [default: {SUCCESS}]")
    ] = None,
    ppo: Annotated[
        list[str] | None, typer.Option(help="NAME=VALUE of PPO, such as learning_rate=3e-4.")
    ] = None,
) -> None:
    """Train a policy from scratch."""
    settings = TrainingSettings.of_file(task) if task.endswith(".json") else TrainingSettings(task)
    named = settings.task
    named = replace(
        named,
        options={**named.options, **_values("--option", option)},
        imported={**named.imported, **_texts("--import", import_)},
        success=success or named.success,
    )
    given: dict[str, Any] = {"seed": seed, "copies": copies, "decisions": decisions}
    given = {name: value for name, value in given.items() if value is not None}
    rates = {**settings.ppo, **_values("--ppo", ppo)}
    _run(out, replace(settings, task=named, ppo=rates, **given))


@app.command()
def resume(
    folder: Annotated[Path, typer.Argument(help="Folder of the training.")],
    decisions: Annotated[int | None, typer.Option(help="Another number of all.")] = None,
) -> None:
    """Continue a training that was interrupted or killed, or make one longer."""
    needed("stable_baselines3", "stable-baselines3", "training")
    from o80.learning.training.learner import load

    settings, _ = load(folder)
    changed = replace(settings, decisions=settings.decisions if decisions is None else decisions)
    _run(folder, changed, resume=True)


def _run(folder: Path, settings: TrainingSettings, *, resume: bool = False) -> None:
    from o80.learning.training import Training

    said = -BETWEEN

    def say(point: CurvePoint) -> None:
        nonlocal said
        if time.monotonic() < said + BETWEEN and point.decisions < settings.decisions:
            return
        said = time.monotonic()
        reward = f"reward {point.reward:.4g}" if point.episodes else "none has ended yet"
        success = "" if point.success != point.success else f", success {100 * point.success:.1f} %"
        play = f", {point.play_hours:.2f} h of play" if settings.on_the_clock else ""
        print(
            f"{point.decisions} of {settings.decisions} decisions, {point.episodes} episodes, "
            f"{point.minutes:.1f} min{play}: {reward}{success}",
            flush=True,
        )

    with Training(settings, folder, resume=resume) as training:
        try:
            training.run(say)
        except BaseException:
            saved = training.policy.training["decisions"]
            go_on = f"python -m o80.learning resume {folder}"
            complain(f"stopped, {saved} decisions are saved; continue with: {go_on}")
            raise
    print(f"policy and curve: {folder}")


@app.command("evaluate")
def evaluate_(
    policies: Annotated[
        list[str],
        typer.Argument(help="nothing, random, and folders or files of learned policies."),
    ],
    task: Annotated[str | None, typer.Option(help="If not that of the first policy.")] = None,
    option: Options = None,
    episodes: Annotated[int, typer.Option(help="For each policy, the same ones.")] = 200,
    seed: Annotated[int, typer.Option(help="Of the first episode.")] = SEED,
    copies: Annotated[int | None, typer.Option(help="If not as in the training.")] = None,
) -> None:
    """Run the same episodes with each policy, and compare."""
    learned = next((name for name in policies if name not in BASELINES), None)
    if task is None and learned is None:
        raise InvalidArgument("`nothing` and `random` play any task: name the task with --task")
    named = LearnedPolicy.load(learned or "").task if task is None else NamedTask(task)
    named = replace(named, options={**named.options, **_values("--option", option)})
    first, *others = evaluate(policies, task=named, episodes=episodes, seed=seed, copies=copies)
    columns = [Column(name, right=True) for name in ("success", "95 %", "reward", "steps")]
    print_table([Column("policy"), *columns], [_row(each) for each in (first, *others)])
    for other in others:
        more, half = first.gain(other)
        print(
            f"{first.name} beside {other.name}, the same {episodes} episodes: reward {more:+.4g} "
            f"(95 %: +-{half:.2g}), success in {first.only_here(other)} where the other has none, "
            f"none in {other.only_here(first)} where the other has"
        )


def _row(played: Evaluation) -> list[str]:
    low, high = played.interval
    share = [f"{100 * played.success:.1f} %", f"{100 * low:.1f} to {100 * high:.1f} %"]
    if played.success != played.success:
        share = ["unknown", ""]
    return [played.name, *share, f"{played.rewards.mean():.4g}", f"{played.lengths.mean():.1f}"]


@app.command()
def curve(
    folders: Annotated[list[Path], typer.Argument(help="One for each training.")],
) -> None:
    """Draw the learning curves of trainings: curve.png in the first folder."""
    drawn = folders[0] / "curve.png"
    try:
        curves = {str(folder): points(folder / CURVE, CurvePoint) for folder in folders}
    except (OSError, ValueError) as error:
        raise InvalidArgument(f"{error}: give folders of trainings") from error
    draw(drawn, curves)
    print(f"curves: {drawn}")


@app.command()
def policy(
    place: Annotated[Path, typer.Argument(help="Folder of a training, or file of a policy.")],
    out: Annotated[Path | None, typer.Option(help="Name of a copy of its two files.")] = None,
) -> None:
    """Print the task of a policy and how it was learned."""
    loaded = LearnedPolicy.load(place)
    if out is not None:
        loaded.save(out)
    sizes = [len(loaded.network.mean), *(len(bias) for bias in loaded.network.biases)]
    print(
        json_text({"layers": sizes, "task": asdict(loaded.task)} | dict(loaded.training), indent=2)
    )
    print(f'in Python: o80.learning.training.LearnedPolicy.load("{out or place}").act(observation)')


def _texts(option: str, texts: list[str] | None) -> dict[str, str]:
    found = {}
    for text in texts or []:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise InvalidArgument(f"{option}: write NAME=VALUE, not '{text}'")
        found[name] = value
    return found


def _values(option: str, texts: list[str] | None) -> dict[str, Any]:
    """Parses numbers, true, false and lists as JSON; all other values are text."""
    found: dict[str, Any] = {}
    for name, text in _texts(option, texts).items():
        try:
            found[name] = json.loads(text)
        except ValueError:
            found[name] = text
    return found
