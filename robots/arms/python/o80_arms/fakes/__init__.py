"""Fake arms that speak the wire protocols of the real ones."""

from o80_arms.fakes.arms import FakeArm, koch, koch_leader, so101, so101_leader

__all__ = ["FakeArm", "koch", "koch_leader", "so101", "so101_leader"]
