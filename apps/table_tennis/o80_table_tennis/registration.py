"""Gymnasium ids of the environments."""

from __future__ import annotations

from o80.base.extras import needed

ACCELERATED = "o80/TableTennis-v0"
"""Accelerated environment; the same seed gives the same episode, bit for bit."""
REAL_TIME = "o80/TableTennisRealTime-v0"
"""Environment whose arm runs by the clock."""


def register_environments() -> None:
    """Registers both ids; may be called twice.

    The environments count steps and check arguments without Gymnasium's wrappers.
    Raises o80.MissingExtra if the package of a robot is not installed.
    """
    for robot in ("mujoco", "pam"):
        needed(f"o80_{robot}", None, "table tennis", package=f"o80-{robot}")
    import gymnasium

    entries = "o80_table_tennis.entry_points"
    if ACCELERATED not in gymnasium.registry:
        gymnasium.register(
            id=ACCELERATED,
            entry_point=f"{entries}:accelerated_environment",
            vector_entry_point=f"{entries}:vector_environment",
        )
    if REAL_TIME not in gymnasium.registry:
        gymnasium.register(
            id=REAL_TIME,
            entry_point=f"{entries}:real_time_environment",
            nondeterministic=True,
        )
