"""Rollouts of a vector environment, collected with NumPy alone.

with Collector(make, seed=1) as collector:
    rollout = collector.collect(policy, steps=64)

See docs/learning/rollouts.md.
"""

from o80.learning.rollouts.collector import Collector, Make, Policy
from o80.learning.rollouts.gaussian_policy import GaussianPolicy
from o80.learning.rollouts.rollout import Ends, Rollout

__all__ = [
    "Collector",
    "Ends",
    "GaussianPolicy",
    "Make",
    "Policy",
    "Rollout",
]
