"""Table tennis with a pneumatic arm: real robot, simulated ball.

An import registers `o80/TableTennis-v0` and `o80/TableTennisRealTime-v0` with Gymnasium.
"""

from o80.base.installation import check_version

from .registration import ACCELERATED, REAL_TIME, register_environments

__all__ = ["ACCELERATED", "REAL_TIME", "register_environments"]

check_version("o80-table-tennis")
register_environments()
