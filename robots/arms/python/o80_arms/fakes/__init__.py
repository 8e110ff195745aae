"""Counterparts of the arms that speak their wire protocols."""

from o80_arms.fakes.arms import FakeArm, koch, so101

__all__ = ["FakeArm", "koch", "so101"]
