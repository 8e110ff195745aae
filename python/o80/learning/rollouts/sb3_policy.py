"""Converts a policy of Stable-Baselines3 to NumPy."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument
from o80.learning.rollouts.gaussian_policy import GaussianPolicy


def gaussian_policy(policy: Any, normalisation: Any) -> GaussianPolicy:
    """policy: of a PPO; normalisation: its VecNormalize, or None.

    Raises InvalidArgument for a policy that GaussianPolicy cannot represent.
    """
    import torch
    from stable_baselines3.common.distributions import DiagGaussianDistribution
    from stable_baselines3.common.torch_layers import FlattenExtractor

    hidden = list(policy.mlp_extractor.policy_net)
    if (
        not isinstance(policy.action_dist, DiagGaussianDistribution)
        or not isinstance(policy.features_extractor, FlattenExtractor)
        or policy.squash_output
        or not all(isinstance(each, torch.nn.Linear | torch.nn.Tanh) for each in hidden)
    ):
        raise InvalidArgument(
            "rollouts need an MlpPolicy with layers of tanh and normally distributed actions, and "
            f"this one is {type(policy).__name__}({policy.action_dist}, {policy.mlp_extractor})"
        )
    layers = [each for each in hidden if isinstance(each, torch.nn.Linear)]
    layers.append(policy.action_net)
    inputs = layers[0].in_features
    mean, scale, clip = np.zeros(inputs), np.ones(inputs), float("inf")
    if normalisation is not None and normalisation.norm_obs:
        statistics = normalisation.obs_rms
        mean, scale = statistics.mean, 1.0 / np.sqrt(statistics.var + normalisation.epsilon)
        clip = float(normalisation.clip_obs)
    return GaussianPolicy(
        np.asarray(mean, np.float32),
        np.asarray(scale, np.float32),
        tuple(_array(layer.weight) for layer in layers),
        tuple(_array(layer.bias) for layer in layers),
        _array(policy.log_std),
        clip,
    )


def _array(parameter: Any) -> NDArray[np.float32]:
    # a copy: the next update changes the parameter in place
    return np.array(parameter.detach().cpu().numpy(), np.float32)
