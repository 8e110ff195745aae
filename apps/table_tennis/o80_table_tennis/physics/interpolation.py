"""Interpolates between the steps of an integration by cubics through positions and velocities."""

from __future__ import annotations

import numpy as np

from o80.base.arrays import FloatArray


def along_path(
    times: FloatArray, nodes: FloatArray, node_times: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Positions and velocities, each (T, 3, ...), at `times` (T,) [s].

    `nodes` (K, 6, ...) holds position and velocity at `node_times` (K,), which do not fall. Two
    nodes of the same time are a jump (a bounce), where the second one counts. Uses cubic Hermite
    polynomials; outside of the nodes, the first or last one is extrapolated.
    """
    late = np.searchsorted(node_times, times, side="right")
    right = np.clip(late, 1, len(node_times) - 1)
    span = node_times[right] - node_times[right - 1]
    shape = (-1,) + (1,) * (nodes.ndim - 1)
    width = np.maximum(span, 1e-12).reshape(shape)
    s = (times - node_times[right - 1]).reshape(shape) / width

    p0, v0 = nodes[right - 1, :3], nodes[right - 1, 3:]
    p1, v1 = nodes[right, :3], nodes[right, 3:]
    rise = p1 - p0
    bend = width * (v0 + v1) - 2 * rise
    lean = 3 * rise - width * (2 * v0 + v1)
    positions = p0 + s * (width * v0 + s * (lean + s * bend))
    velocities = v0 + s * (2 * lean + 3 * s * bend) / width
    return positions, velocities
