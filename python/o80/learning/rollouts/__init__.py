"""Rollouts of vector environments, collected by workers: in this process, or by Ray on machines.

with LocalWorkers(make, workers=4, seed=1) as workers:      # or RayWorkers: the same, bit for bit
    rollouts = workers.collect(policy, steps=64)

See docs/learning.md. RayWorkers needs the extra `ray`.
"""

from o80.learning.rollouts.gaussian_policy import GaussianPolicy
from o80.learning.rollouts.local_workers import LocalWorkers
from o80.learning.rollouts.ray_workers import RayWorkers
from o80.learning.rollouts.rollout import Ends, Rollout
from o80.learning.rollouts.worker import Make, Policy, Worker
from o80.learning.rollouts.workers import Replacement, Workers

__all__ = [
    "Ends",
    "GaussianPolicy",
    "LocalWorkers",
    "Make",
    "Policy",
    "RayWorkers",
    "Replacement",
    "Rollout",
    "Worker",
    "Workers",
]
