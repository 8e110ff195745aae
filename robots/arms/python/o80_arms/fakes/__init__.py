"""Counterparts of the arms that speak their wire protocols."""

from o80_arms.fakes.arms import FakeSO101, so101

__all__ = ["FakeSO101", "so101"]
