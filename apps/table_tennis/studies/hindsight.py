"""Hindsight from many worlds: number of played balls until a learner touches and returns them.

python hindsight.py --balls 300 --seeds 2

Soft actor-critic plays one ball after the other. In 20 worlds, other balls meet the same motion of
the arm, and the learner also receives their transitions. Three curves: one world; one world with
as many gradient steps as 20 worlds; 20 worlds. Writes hindsight.png and hindsight.json.
"""

import argparse
import json
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import torch
from matplotlib.figure import Figure
from stable_baselines3 import SAC
from stable_baselines3.common.logger import configure

from o80_table_tennis.environment import TableTennisEnvironment
from o80_table_tennis.settings import RigSettings, TaskSettings

WAYS = {"one world": (1, 1), "one world, more steps": (1, 4), "20 worlds": (20, 4)}
"""Number of worlds, and of gradient steps for each decision."""
TASK = TaskSettings(balls="narrow", observation="full", factor=0.6, repeat=5)
RANDOM = 20
"""Number of initial balls played at random."""
WINDOW = 25
"""Number of balls in the moving mean of a curve."""


def store(buffer: Any, before: Any, action: Any, info: dict[str, Any]) -> None:
    """Adds the transitions of all worlds with a running episode."""
    each = info["worlds"]
    columns = (before, each["observation"], each["reward"], each["terminated"], each["truncated"])
    for old, new, reward, terminated, truncated in zip(
        *(column[each["running"]] for column in columns), strict=True
    ):
        infos = [{"TimeLimit.truncated": bool(truncated)}]
        buffer.add(old, new, action, np.array([reward]), np.array([terminated | truncated]), infos)


def trained(worlds: int, updates: int, balls: int, seed: int) -> list[tuple[float, bool, bool]]:
    """Trains on `balls` balls; returns reward, touched and returned of each."""
    played = []
    with closing(TableTennisEnvironment(rig=RigSettings(worlds=worlds), task=TASK)) as environment:
        network: dict[str, Any] = {"net_arch": [64, 64]}
        model = SAC("MlpPolicy", environment, gamma=0.99, seed=seed, policy_kwargs=network)
        model.set_logger(configure(None, []))
        for ball in range(balls):
            observation, info = environment.reset(seed=seed if ball == 0 else None)
            over, total, decisions = False, 0.0, 0
            while not over:
                action = environment.action_space.sample()
                if ball >= RANDOM:
                    action, _ = model.predict(observation)
                before = info["worlds"]["observation"]
                observation, reward, terminated, truncated, info = environment.step(action)
                store(model.replay_buffer, before, action, info)
                over, total = terminated or truncated, total + reward
                decisions += 1
            if ball >= RANDOM - 1:
                model.train(gradient_steps=updates * decisions, batch_size=128)
            played.append((total, bool(info["touched"]), bool(info["returned"])))
    return played


def draw(path: Path, found: Mapping[str, Sequence[Any]]) -> None:
    """Draws the share of touched balls over played ones: mean and range of the seeds."""
    figure = Figure(figsize=(6, 3.6), layout="constrained")
    axes = figure.subplots()
    for name, runs in found.items():
        touched = np.array(runs)[:, :, 1]
        curves = [np.convolve(each, np.ones(WINDOW) / WINDOW, "valid") for each in touched]
        at = np.arange(WINDOW, touched.shape[1] + 1)
        (line,) = axes.plot(at, np.mean(curves, axis=0), label=name)
        lowest, highest = np.min(curves, axis=0), np.max(curves, axis=0)
        axes.fill_between(at, lowest, highest, alpha=0.2, color=line.get_color())
    axes.set(xlabel="played balls", ylabel="touched", ylim=(0, 1))
    axes.legend()
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--balls", type=int, default=300)
    parser.add_argument("--seeds", type=int, default=5)
    given = parser.parse_args()
    torch.set_num_threads(1)
    results: dict[str, list[Any]] = {name: [] for name in WAYS}
    for number in range(given.seeds):
        for name, (worlds, updates) in WAYS.items():
            results[name].append(trained(worlds, updates, given.balls, number))
            print(name, number, np.mean(results[name][-1][-50:], axis=0).round(3), flush=True)
            Path("hindsight.json").write_text(json.dumps(results))
    draw(Path("hindsight.png"), results)
