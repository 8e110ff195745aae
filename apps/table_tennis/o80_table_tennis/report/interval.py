"""How sure a share is that was counted in few episodes."""

from __future__ import annotations

import math

NORMAL_95 = 1.959963984540054
"""Standard deviations within which 95 % of a normal distribution lie."""


def wilson(successes: int, count: int) -> tuple[float, float]:
    """Wilson's interval of a share, which holds the true one in 95 % of all cases.

    (0, 1) of nothing counted. Unlike the plus or minus of a standard deviation it stays within
    0 and 1, and has a width where all or none succeeded.
    """
    if not 0 <= successes <= count:
        raise ValueError(f"successes must lie between 0 and {count}, got {successes}")
    if count == 0:
        return 0.0, 1.0
    share, z2 = successes / count, NORMAL_95 * NORMAL_95
    middle = (share + z2 / (2 * count)) / (1 + z2 / count)
    spread = math.sqrt(share * (1 - share) / count + z2 / (4 * count * count))
    half = NORMAL_95 * spread / (1 + z2 / count)
    # rounding must not leave the share, or 0 and 1, outside
    return max(0.0, min(middle - half, share)), min(1.0, max(middle + half, share))
