"""Stable-Baselines3's PPO for this task, and the network of NumPy that its policy becomes.

The decisions are collected by playing the policy with NumPy. Values and probabilities are computed
for a whole rollout at once.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.vec_env import VecNormalize

from o80.base.arrays import Float32Array
from o80.learning.rollouts import Collector
from o80.learning.rollouts.ppo import CollectorEnv, RolloutPPO

from ..players.network import CLIP, Network
from .copies import Stopwatch, Timed, training_copies
from .settings import LearningSettings
from .visible_numbers import visible_numbers

INFOS = ("touched", "returned")
"""Entries of an episode's last info that a training counts."""


def training_environments(settings: LearningSettings, watch: Stopwatch) -> VecNormalize:
    """The environments of a training, normalised; `watch` measures them."""

    def made() -> Timed:
        count, seed = settings.ppo.environments, settings.seed
        return Timed(training_copies(settings.conditions, count=count, ball_seed=seed), watch)

    collector = Collector(made, seed=settings.seed, infos=INFOS)
    return VecNormalize(
        CollectorEnv(collector),
        norm_obs=True,
        norm_reward=False,
        clip_obs=CLIP,
        gamma=settings.ppo.discount,
    )


def _visible(settings: LearningSettings, environments: VecNormalize) -> Float32Array:
    (size,) = environments.observation_space.shape or ()
    return visible_numbers(settings.conditions, size, blind=settings.blind)


def new_model(settings: LearningSettings, environments: VecNormalize) -> PPO:
    """A learner that knows nothing; the same seed gives the same one."""
    ppo = settings.ppo
    model = RolloutPPO(
        "MlpPolicy",
        environments,
        visible=_visible(settings, environments),
        n_steps=ppo.steps,
        batch_size=ppo.batch,
        n_epochs=ppo.epochs,
        learning_rate=learning_rate(settings),
        gamma=ppo.discount,
        gae_lambda=ppo.trace,
        clip_range=ppo.clip,
        ent_coef=ppo.entropy,
        policy_kwargs={
            "net_arch": [ppo.hidden, ppo.hidden],
            "log_std_init": ppo.log_exploration,
            "activation_fn": torch.nn.Tanh,
        },
        seed=settings.seed,
        device="cpu",
    )
    model.set_logger(Logger(None, []))  # the default one leaves a folder in /tmp
    return model


def begin_anew(model: PPO) -> None:
    """New weights and a new optimiser; call it between two updates."""
    policy: Any = model.policy_class(
        model.observation_space, model.action_space, model.lr_schedule, **model.policy_kwargs
    )
    policy.set_training_mode(False)
    model.policy = policy.to(model.device)


def set_exploration(model: PPO, settings: LearningSettings) -> None:
    """Sets the scheduled exploration, unless it is learned; call it before each rollout."""
    value = settings.ppo.log_exploration_at(model.num_timesteps / settings.decisions)
    if value is not None:
        policy: Any = model.policy
        policy.log_std.requires_grad_(False)
        policy.log_std.fill_(value)


def learning_rate(settings: LearningSettings) -> Callable[[float], float]:
    """Learning rate as a function of the share of the training that is left."""
    first, last = settings.ppo.learning_rate, settings.ppo.last_rate
    return lambda left: first * (last + (1.0 - last) * max(float(left), 0.0))


def network_of(model: PPO, normalisation: VecNormalize, settings: LearningSettings) -> Network:
    """The deterministic policy."""
    statistics: Any = normalisation.obs_rms
    layers = [
        layer
        for layer in model.policy.mlp_extractor.policy_net
        if isinstance(layer, torch.nn.Linear)
    ]
    layers.append(model.policy.action_net)  # type: ignore[arg-type]
    return Network(
        visible_numbers(settings.conditions, len(statistics.mean), blind=settings.blind),
        np.asarray(statistics.mean, np.float32),
        np.asarray(1.0 / np.sqrt(statistics.var + normalisation.epsilon), np.float32),
        tuple(_array(layer.weight) for layer in layers),
        tuple(_array(layer.bias) for layer in layers),
    )


def _array(parameter: torch.Tensor) -> Float32Array:
    array: Float32Array = parameter.detach().cpu().numpy().astype(np.float32).copy()
    return array
