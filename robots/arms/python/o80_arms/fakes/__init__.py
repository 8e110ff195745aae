"""Counterparts of the arms that speak their wire protocols."""

from o80_arms.fakes.arms import FakeArm, koch, koch_leader, so101, so101_leader

__all__ = ["FakeArm", "koch", "koch_leader", "so101", "so101_leader"]
