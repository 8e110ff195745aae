"""The ball: its size, its mass, the gravity that acts on it and the spin of recorded shots."""

from __future__ import annotations

from .scene import Vector, element, geom, numbers, vector

BALL_RADIUS = numbers(geom("ball"), "size")[0]
"""[m]"""
BALL_MASS = numbers(element(".//body[@name='ball']/inertial"), "mass")[0]
"""[kg]"""
GRAVITY = -vector(element("option"), "gravity")[2]
"""Downwards [m/s^2]."""
NO_SPIN: Vector = (0.0, 0.0, 0.0)
BALL_GUN_SPIN: Vector = (30.0, 0.0, 0.0)
"""Top spin of the recorded shots of the ball gun [rad/s]: with it, a prediction from y = 2 m
through the bounce to the arm is off by 7 mm, 14 mm in height and 6 ms; without it by 70 mm."""
