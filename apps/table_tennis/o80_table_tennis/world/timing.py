"""Timing of the experiment: iterations of arm and twins, and steps of the environment."""

from __future__ import annotations

from .scene import element, numbers

PERIOD = numbers(element("option"), "timestep")[0]
"""Duration of an iteration of arm and twins, the scene's time step [s]."""
ITERATIONS = 5
"""Number of iterations of arm and twins in a step of the environment."""
STEP = ITERATIONS * PERIOD
"""Duration of a step of the environment [s]."""
