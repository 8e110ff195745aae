"""Table tennis with a pneumatic arm: real robot, simulated ball.

An import registers `o80/TableTennis-v0` and `o80/TableTennisRealTime-v0` with Gymnasium.
"""

from .registration import ACCELERATED, REAL_TIME, register_environments

__all__ = ["ACCELERATED", "REAL_TIME", "register_environments"]

register_environments()
