"""The clock of the experiment: iterations of arm and twins, and steps of the environment."""

from __future__ import annotations

from .scene import element, numbers

PERIOD = numbers(element("option"), "timestep")[0]
"""Duration of an iteration of the arm and of a twin: the time step of the scene [s]."""
ITERATIONS = 5
"""Iterations of the arm and of each twin in a step of the environment."""
STEP = ITERATIONS * PERIOD
"""Duration of a step of the environment [s]."""
