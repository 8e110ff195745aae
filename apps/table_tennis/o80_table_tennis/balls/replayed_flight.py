"""Fits recorded flights with the simulator's law, so that nothing jumps at the hand-over.

`flight_fit` finds a free drag and turn for each flight. Here position, velocity and spin are
fitted again, with the simulator's drag and lift. The prior of the spin is the spin of the fitted
turn, and after a bounce the spin from the law of the bounce. A simulated ball that starts from
any row's state therefore flies like the replayed
one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from o80.base.arrays import FloatArray
from o80_mujoco.balls import path

from ..physics.aerodynamics import AERODYNAMICS, AIR
from ..physics.impact import spin_after
from ..physics.interpolation import along_path
from .flight_fit import FlightFit, fitted

STEP = 0.02
"""Step of the integration [s]."""
SPIN_ERROR = 30.0
"""Expected error of each number of the spin before the first bounce [rad/s]."""
SHARE_ERROR = 0.3
"""Expected relative error of a spin after a bounce; the axis is not changed."""
MAX_ERRORS = 2.5
"""Limit of a spin's deviation in expected errors: saturated lift hardly shows the spin."""
SCALES = np.array([0.01] * 3 + [0.1] * 3 + [0.3] * 3)
"""Typical changes of position [m], velocity [m/s] and spin [expected errors]."""
CLOSE_ENOUGH = 1e-4
"""Precision of a fit, see `fitted`."""


@dataclass(frozen=True, eq=False)
class ReplayedFlight:
    """Flight without a bounce, by the simulator's law."""

    origin: float
    """Start time [s]."""
    state: FloatArray
    """(6,) position [m] and velocity [m/s] at `origin`"""
    spin: FloatArray
    """(3,) [rad/s] at `origin`"""

    def at(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Positions [m] and velocities [m/s], each (T, 3), at `times` (T,) [s]."""
        states = np.concatenate([self.state, self.spin])[:, None]
        positions, velocities = flown(states, times - self.origin)
        return positions[..., 0], velocities[..., 0]

    def spins(self, times: FloatArray) -> FloatArray:
        """Spins (T, 3) [rad/s] at `times` (T,) [s]."""
        spins: FloatArray = (
            self.spin * np.exp(-AERODYNAMICS.spin_decay * (times - self.origin))[:, None]
        )
        return spins


@dataclass(frozen=True, eq=False)
class ReplayedFlights:
    """Flights joined by bounces."""

    flights: tuple[ReplayedFlight, ...]
    bounce_times: FloatArray
    """(flights - 1,) [s]"""
    residuals: FloatArray
    """(N,) distance of each fitted row [m]"""

    def at(self, times: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Positions [m], velocities [m/s] and spins [rad/s], each (T, 3), at `times` (T,) [s]."""
        found = np.empty((3, len(times), 3))
        which = np.searchsorted(self.bounce_times, times, side="right")
        for index, flight in enumerate(self.flights):
            mine = which == index
            if mine.any():
                found[0, mine], found[1, mine] = flight.at(times[mine])
                found[2, mine] = flight.spins(times[mine])
        return found[0], found[1], found[2]


def replayed(fit: FlightFit, stamps: FloatArray, positions: FloatArray) -> ReplayedFlights:
    """Fits flights with the simulator's law to `positions` (N, 3) [m].

    `stamps` (N,) [s]; `fit`: free fit of the same rows.
    """
    inside = (stamps >= fit.start) & (stamps <= fit.end)
    stamps, positions = stamps[inside], positions[inside]
    edges = np.array([fit.start, *fit.bounce_times, fit.end])
    points = fit.at(fit.bounce_times)[0]
    which = np.searchsorted(fit.bounce_times, stamps, side="right")

    flights: list[ReplayedFlight] = []
    for index, origin in enumerate(edges[:-1].tolist()):
        ends = slice(max(0, index - 1), index + 1)
        state = np.concatenate(fit.flights[index].at(np.array([origin])), axis=None)
        start = ReplayedFlight(origin, state, _spin(fit, edges, flights))
        errors = SHARE_ERROR * start.spin[None] if flights else SPIN_ERROR * np.eye(3)
        rows = which == index
        times = np.concatenate([stamps[rows], fit.bounce_times[ends]])
        seen = np.concatenate([positions[rows], points[ends]])
        flights.append(_fitted(start, errors, times, seen, anchors=len(points[ends])))
    found = ReplayedFlights(tuple(flights), fit.bounce_times, np.zeros(0))
    return replace(found, residuals=np.linalg.norm(found.at(stamps)[0] - positions, axis=1))


def _spin(fit: FlightFit, edges: FloatArray, before: list[ReplayedFlight]) -> FloatArray:
    """Computes the spin (3,) at the beginning of the next flight."""
    if not before:
        # this spin gives the fitted turn in the middle of the flight
        middle = np.array([0.5 * (edges[0] + edges[1])])
        spin = fit.spins(middle, fit.at(middle)[1])[0]
        grown: FloatArray = spin * np.exp(AERODYNAMICS.spin_decay * (middle[0] - edges[0]))
        return grown
    bounce = edges[len(before), None]
    last = before[-1]
    return spin_after(last.at(bounce)[1], np.zeros(3), last.spins(bounce)[0])


def _fitted(
    start: ReplayedFlight,
    spin_errors: FloatArray,
    times: FloatArray,
    positions: FloatArray,
    *,
    anchors: int,
) -> ReplayedFlight:
    """Fits state and spin of a flight, which meets the last `anchors` positions
    exactly.

    `spin_errors` (K, 3) [rad/s]: directions and expected sizes of changes of the spin.
    """
    spins = len(spin_errors)

    def states(tried: FloatArray) -> FloatArray:
        """(9, B)"""
        return np.concatenate([tried[:6], start.spin[:, None] + spin_errors.T @ tried[6:]])

    unknowns = fitted(
        lambda tried: flown(states(tried), times - start.origin)[0],
        np.concatenate([start.state, np.zeros(spins)]),
        positions,
        anchors=anchors,
        scales=SCALES[: 6 + spins],
        beliefs=np.array([0.0] * 6 + [1.0] * spins),
        centre=np.zeros(6 + spins),
        precision=CLOSE_ENOUGH,
        largest=np.array([np.inf] * 6 + [MAX_ERRORS] * spins),
    )
    found = states(unknowns[:, None])[:, 0]
    flight = replace(start, state=found[:6], spin=found[6:])
    if not spins:
        return flight
    # position and velocity are fitted again, because a limited spin leaves them unconverged
    return _fitted(flight, np.zeros((0, 3)), times, positions, anchors=anchors)


def flown(states: FloatArray, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Computes positions and velocities (T, 3, B) of B balls after `times` (T,) [s].

    `states` (9, B): position [m], velocity [m/s] and spin [rad/s].
    """
    steps = max(1, int(np.ceil(times.max(initial=0.0) / STEP)))
    balls = path(np.ascontiguousarray(states.T), STEP, steps, AIR)
    nodes = balls[..., :6].swapaxes(1, 2)
    return along_path(times, nodes, STEP * np.arange(len(nodes), dtype=np.float64))
