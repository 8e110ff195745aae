"""The ball: size, mass, gravity, and the spin of recorded shots."""

from __future__ import annotations

from .scene import Vector, element, geom, numbers, vector

BALL_RADIUS = numbers(geom("ball"), "size")[0]
"""[m]"""
BALL_MASS = numbers(element(".//body[@name='ball']/inertial"), "mass")[0]
"""[kg]"""
GRAVITY = -vector(element("option"), "gravity")[2]
"""Gravity, downwards [m/s^2]."""
BALL_INERTIA = 2.0 / 3.0
"""Moment of inertia over mass and radius squared: a hollow ball."""
NO_SPIN: Vector = (0.0, 0.0, 0.0)
BALL_GUN_SPIN: Vector = (64.0, 0.0, 0.0)
"""Top spin of the ball gun's recorded shots before their bounce [rad/s]: median of the fitted
flights, by studies/fit_bounces.py."""
