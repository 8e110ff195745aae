"""The options with which arm and twins are started."""

from __future__ import annotations

from typing import Any

from ..settings import RigSettings
from ..world.arm import PLAYING_POSTURE
from ..world.scene import MODEL
from .ball_records import ball_options


def arm_options(settings: RigSettings) -> dict[str, Any]:
    """Options of the pneumatic arm."""
    return {
        "preset": settings.preset,
        "muscle": settings.muscle,
        "ranges": settings.ranges,
        "start_noise": settings.start_noise,
        "start_posture": PLAYING_POSTURE,
        "period": settings.period,
    }


def twin_options(settings: RigSettings, twin: int = 0) -> dict[str, Any]:
    """Options of the simulation number `twin`."""
    return {
        "model": str(MODEL),
        "timestep": settings.period,
        **ball_options(settings.balls_of(twin)),
    }
