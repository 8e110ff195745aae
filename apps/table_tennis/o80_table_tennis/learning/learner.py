"""Stable-Baselines3's PPO for this task, and the network of NumPy that its policy becomes."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from ..players.network import CLIP, Network
from .environments import Float32Array, Masked, opened, visible_numbers
from .settings import LearningSettings


def training_environments(settings: LearningSettings) -> VecNormalize:
    """The environments of a training: masked if it is blind, then normalised."""
    inner = opened(
        settings.conditions,
        count=settings.ppo.environments,
        seed=settings.seed,
        ball_seed=settings.seed,
    )
    size = _size(inner.observation_space)
    visible = visible_numbers(settings.conditions, size, blind=settings.blind)
    masked = Masked(inner, visible) if settings.blind else inner
    return VecNormalize(
        masked, norm_obs=True, norm_reward=False, clip_obs=CLIP, gamma=settings.ppo.discount
    )


def new_model(settings: LearningSettings, environments: VecNormalize) -> PPO:
    """A learner that knows nothing; the same seed gives the same one."""
    ppo = settings.ppo
    return PPO(
        "MlpPolicy",
        environments,
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


def learning_rate(settings: LearningSettings) -> Any:
    """Of the share of the training that is left."""
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


def _size(space: Any) -> int:
    (size,) = space.shape
    return int(size)
