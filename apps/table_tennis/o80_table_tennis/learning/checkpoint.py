"""Checkpoints: all that a training needs to go on where it was."""

from __future__ import annotations

import json
import os
import pickle
import random
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

FOLDER = "checkpoint"
MODEL, NORMALISATION, GENERATORS, PROGRESS = (
    "model.zip",
    "normalisation.pkl",
    "generators.pkl",
    ("progress.json"),
)


@dataclass(frozen=True)
class Progress:
    """How far a training has come."""

    decisions: int
    episodes: int
    minutes: float
    processor_minutes: float
    restarts: int = 0
    """Networks that were replaced by new ones."""
    begun: int = 0
    """Decisions at which the present network began."""
    stuck: bool = False
    """It is to be replaced before the next decision."""


def save(output: Path, model: PPO, progress: Progress) -> None:
    """Replaces the checkpoint of a training as a whole: a kill leaves the old or the new one."""
    new, old = output / f"{FOLDER}.new", output / f"{FOLDER}.old"
    for each in (new, old):
        shutil.rmtree(each, ignore_errors=True)
    new.mkdir(parents=True)
    model.save(new / MODEL, exclude=["learning_rate", "lr_schedule"])
    normalisation = model.get_vec_normalize_env()
    assert normalisation is not None
    normalisation.save(str(new / NORMALISATION))
    (new / GENERATORS).write_bytes(pickle.dumps(_generators()))
    (new / PROGRESS).write_text(json.dumps(asdict(progress)))
    current = output / FOLDER
    if current.exists():
        os.rename(current, old)
    os.rename(new, current)
    shutil.rmtree(old, ignore_errors=True)


def found(output: Path) -> Path | None:
    """The newest whole checkpoint of a training."""
    for name in (FOLDER, f"{FOLDER}.new", f"{FOLDER}.old"):
        if (output / name / PROGRESS).is_file():
            return output / name
    return None


def load(folder: Path, model: PPO, normalisation: VecNormalize) -> Progress:
    """Puts a checkpoint into a new model and its environments: weights, optimiser, normalisation
    and generators. Episodes begin anew; their random numbers follow from the seed and from how far
    the training has come. Loads pickles: resume only trainings that you trust.
    """
    model.set_parameters(str(folder / MODEL), exact_match=True, device="cpu")
    progress = Progress(**json.loads((folder / PROGRESS).read_text()))
    model.num_timesteps = progress.decisions
    saved = pickle.loads((folder / NORMALISATION).read_bytes())
    normalisation.obs_rms, normalisation.ret_rms = saved.obs_rms, saved.ret_rms
    _restore(pickle.loads((folder / GENERATORS).read_bytes()))
    return progress


def _generators() -> dict[str, Any]:
    return {
        "torch": torch.get_rng_state(),
        "numpy": np.random.get_state(),  # noqa: NPY002 - PPO draws its batches from it
        "python": random.getstate(),
    }


def _restore(saved: dict[str, Any]) -> None:
    torch.set_rng_state(saved["torch"])
    np.random.set_state(saved["numpy"])  # noqa: NPY002
    random.setstate(saved["python"])
