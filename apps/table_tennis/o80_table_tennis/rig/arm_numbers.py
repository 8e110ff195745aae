"""The numbers of an arm's muscles and joints, as the arm that runs describes itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import numpy as np

import o80
from o80.base.arrays import FloatArray

from ..settings import RigSettings
from ..world.arm import JOINTS, MUSCLES
from .pressure_range import PressureRange
from .rig import arm_options

Numbers = tuple[float, ...]
Pairs = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class ArmNumbers:
    """Numbers of each joint (4,), or of the agonist and antagonist of each (4, 2)."""

    maximum_force: Numbers
    """[N], of each of its muscles"""
    stroke: Numbers
    """Contraction without force [m]."""
    contraction: float
    """Contraction of two muscles that are equally long [m]."""
    pulley: float
    """Radius [m]."""
    neutral: Numbers
    """Angle at which both muscles are equally long [rad]."""
    directions: Numbers
    """1: the agonist increases the angle; -1: it decreases it."""
    least: Pairs
    """Activation at the least pressure."""
    most: Pairs
    """Activation at the most pressure."""
    lag: Numbers
    """[s]"""
    dead_time: Numbers
    """[s]"""
    damping: Numbers
    """[Nm s/rad]"""

    @classmethod
    def of_rig(cls, settings: RigSettings) -> ArmNumbers:
        """Numbers of the arm that a rig with these settings will have: one is made and asked."""
        if settings.attach:
            with o80.Frontend(str(settings.arm_segment)) as arm:
                return cls.of(arm)
        with o80.robots.load("pam").inline(**arm_options(settings)) as arm:
            return cls.of(arm)

    @classmethod
    def of(cls, arm: o80.Frontend) -> ArmNumbers:
        """Numbers of the arm of a frontend. Raises ValueError if its description lacks them."""
        custom = ElementTree.fromstring(arm.model).find("custom") if arm.model else None
        if custom is None:
            raise ValueError(
                f"the arm '{arm.segment}' does not describe its muscles: attach to a robot `pam` "
                "of this version, or give the player ArmNumbers of your own"
            )
        told = {each.get("name"): each.get("data") or "" for each in custom.iter("numeric")}

        def numbers(name: str, count: int = JOINTS) -> Any:
            values = tuple(float(each) for each in told.get(name, "").split())
            if len(values) != count:
                raise ValueError(
                    f"the arm '{arm.segment}' has {len(values)} numbers of {name}, not {count}"
                )
            return values

        idle, full = (
            np.array(numbers(name, MUSCLES)) for name in ("idle_pressure", "full_pressure")
        )
        pressures = PressureRange.of(arm)
        return cls(
            maximum_force=numbers("maximum_force"),
            stroke=numbers("stroke"),
            contraction=numbers("contraction", 1)[0],
            pulley=numbers("pulley_radius", 1)[0],
            neutral=numbers("neutral"),
            directions=numbers("directions"),
            least=_pairs((pressures.least - idle) / (full - idle)),
            most=_pairs((pressures.most - idle) / (full - idle)),
            lag=numbers("lag"),
            dead_time=numbers("dead_time"),
            damping=numbers("damping"),
        )


def _pairs(values: FloatArray) -> Pairs:
    return tuple((float(one), float(other)) for one, other in values.reshape(JOINTS, 2))
