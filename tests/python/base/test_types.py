"""The package is typed: a type checker accepts good programs and refuses bad ones."""

from pathlib import Path

from test_typing import mypy

PROGRAM = """
import numpy as np
import o80

with o80.robots.load("two_joints").start(frequency=500.0, gain=2.0) as process:
    arm: o80.Frontend = process.frontend()
    arm.add_command("elbow", 0.5, duration=2.0, mode=o80.Mode.OVERWRITE)
    arm.add_command(0, {"position": 1.0}, until=3, profile="minimum_jerk")
    arm.add_command(["elbow", 0], [0.5, 0.1], speed=2.0)
    arm.add_command(None, np.zeros(2))
    arm.add_trajectory(np.zeros((3, 2)), times=[0.1, 0.2, 0.3])
    observation: o80.Observation = arm.pulse_and_wait(timeout=5.0)
    batch: o80.Batch = arm.pulse(at=3)
    statuses: list[o80.Status] = batch.statuses
    later: int = batch.last_iteration + 10
    history: o80.History = arm.history(10)
    one: o80.Observation = history[0]
    some: o80.History = history[1:]
    done: o80.Observation = arm.burst(3)
    pending: o80.Burst = arm.burst(3, wait=False)
    rows: dict[o80.Frontend, o80.Observation] = o80.burst({arm: 3})
    for each in arm.stream():
        time: int = each.time
"""
MISTAKES = [
    'arm.add_command("elbow", 0.5, lasting=2.0)',
    "arm.add_command(0.5, 0.5)",
    'arm.pulse_and_wait(timeout="5")',
    "arm.latest().iterations",
    "arm.history(since=1.5)",
    'o80.Frontend("arm", on_error="ignore")',
    "text: str = arm.published",
    "o80.Mode.REPLACE",
]


def test_good_programs_pass_and_bad_ones_do_not(tmp_path: Path) -> None:
    said = mypy(PROGRAM, tmp_path)
    assert said.startswith("Success"), said

    said = mypy("import o80\narm = o80.Frontend('arm')\n" + "\n".join(MISTAKES), tmp_path)
    flagged = {int(line.split(":")[1]) - 3 for line in said.splitlines() if "error:" in line}
    assert flagged == set(range(len(MISTAKES))), said


def test_every_public_name_is_documented() -> None:
    import inspect

    import o80

    undocumented = []
    for name in vars(o80)["__all__"]:
        thing = getattr(o80, name)
        if not inspect.isclass(thing) and not inspect.isroutine(thing):
            continue
        if not thing.__doc__:
            undocumented.append(name)
        for member, value in vars(thing).items() if inspect.isclass(thing) else ():
            public = not member.startswith("_")
            described = inspect.isroutine(value) or isinstance(value, property)
            if public and described and not inspect.getdoc(getattr(thing, member)):
                undocumented.append(f"{name}.{member}")

    assert undocumented == []
