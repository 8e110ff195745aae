"""The worlds of a rig: simulations that mirror the rows of its robots."""

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.errors import CopyFailed, InvalidArgument
from o80.frontend.frontend import Frontend
from o80.groups.group_burst import GroupBurst
from o80.groups.inline_group import InlineGroup
from o80.hybrid.mirror import Motion
from o80.hybrid.rig import World
from o80.hybrid.sides import Side, numbers_of_worlds
from o80.rows.layout import field_view, with_padding

Numbers = NDArray[np.intp]
Feeds = list[tuple[Sequence[NDArray[Any]], NDArray[Any]]]  # two targets, as in _targets; numbers
TIMEOUT = 20.0
"""Longest wait for a row [s]."""


@dataclass
class Counts:
    """Counts since the rig was made."""

    steps: int = 0
    late_actions: int = 0
    """Actions that acted after their iteration; for chunks, skipped rows."""
    late_steps: int = 0
    """Steps at whose begin the robot had made further rows."""
    missed: int = 0
    """Rows without a reading."""
    largest_lateness: int = 0
    """[rows]"""
    largest_drift: float = 0.0
    """[s]"""
    play: float = 0.0
    """Time of the robots in episodes [s]."""
    world_time: float = 0.0
    """Mean time of all worlds together in a step [s]; 0 if C++ passes the rows."""
    summed_lateness: int = 0
    """[rows]"""
    starved: int = 0
    """Iterations in episodes for which no chunk had a row."""


class Worlds:
    """Simulated worlds of n robots: one inline group, or a frontend for a single world."""

    stalled = ""
    """Reason why a step was impossible: never set here."""

    def __init__(
        self,
        member: InlineGroup | Frontend,
        world: World,
        motion: Motion,
        iterations: int,
        copies: int,
        each: int | None,
    ) -> None:
        """each: worlds of a robot; None: one, without a dimension in results of tasks."""
        self.member = member
        self._each, self._named = each or 1, world.states_have_names
        self._follow: Any = member.prepared_burst(iterations, world.joints, steps=iterations)
        self._one: Any = member.prepared_burst(1, world.joints)
        self._shape = copies, self._each
        # of `mirror` and of `follow`
        self._targets = [self._by_copy(burst.targets) for burst in (self._one, self._follow)]
        self._first = with_padding(self._by_copy(self._one.rows))
        self._feeds: Feeds = []
        self.side = Side(member, self._by_copy(self._follow.rows), each)
        self._resets = self.side.serves("reset")
        self.motion, self.counts = motion, Counts()

    def _by_copy(self, array: NDArray[Any]) -> NDArray[Any]:
        """Returns a view of targets or rows with the shape (copies, worlds, ...)."""
        shape = array.shape[1:] if isinstance(self.member, InlineGroup) else array.shape
        return array.reshape(*self._shape, *shape)

    def reset(self, copies: Numbers, seeds: Sequence[int], robots: Side) -> None:
        """Resets the worlds of these copies; episodes begin at the newest rows of robots.

        World j of a copy gets the seed of the copy + j.
        """
        own: Any = seeds
        if self._each > 1:
            own = (np.array(seeds)[:, np.newaxis] + np.arange(self._each)) % 2**32
        if self._resets:
            self.side.repeat("reset", copies, seed=own)
        if self.motion.tracks:
            self.motion.begin(copies, robots.newest(copies))

    def mirror(self, copies: Numbers, robots: Side, seen: _core.Seen | None = None) -> None:
        """Runs one iteration of these worlds, with the positions in the newest rows of robots."""
        for targets, numbers in self._feeds:
            targets[0][copies] = numbers[copies, :, -1:]
        if not self._feeds:
            self._put(self._targets[0], copies, *self.motion.standing(robots.newest(copies)))
        self._run(self._one, copies, seen)
        self.side.show(copies, self._first[copies])

    def follow(
        self, copies: Numbers, rows: NDArray[Any], period: float, seen: _core.Seen | None = None
    ) -> None:
        """Runs these worlds for rows (n, iterations) of their robots."""
        counts, begun = self.counts, time.monotonic()
        counts.steps += 1
        counts.play += rows.size * period
        for targets, numbers in self._feeds:
            targets[1][...] = numbers
        if not self._feeds:
            self._put(self._targets[1], copies, *self.motion.follow(copies, rows, period))
            counts.missed = self.motion.all_missed
        self._run(self._follow, copies, seen)
        counts.world_time += (time.monotonic() - begun - counts.world_time) / counts.steps

    def feed(self, rows: NDArray[Any]) -> None:
        """Sets the rows (copies, iterations) of robots that `mirror` and `follow` read: always
        this memory.
        """
        feeds: Feeds = []
        with suppress(InvalidArgument):
            for name, path in (self.motion.paths or {}).items():
                numbers = field_view(rows, path)[:, np.newaxis]
                if numbers.shape[-1] != self._targets[0].shape[-1]:
                    return  # states of several numbers
                targets = [each[name] if self._named else each for each in self._targets]
                feeds.append((targets, numbers))
            self._feeds = feeds

    def see_newest(self) -> None:
        """Copies the newest row of a single world: a burst that a halt has ended has no row."""
        if isinstance(self.member, Frontend):
            self.side.rows[...] = self.member.history(1).rows

    def after(self, robots: GroupBurst) -> GroupBurst | None:
        """Returns a burst of the robots followed by that of their worlds, in one call; None if the
        worlds mirror computed numbers.
        """
        paths = self.motion.paths
        if self._each > 1 or paths is None:
            return None
        try:
            return robots.then(self._follow, paths if self._named else paths["position"])
        except InvalidArgument:
            return None

    def _put(self, targets: NDArray[Any], copies: Numbers, positions: Any, velocities: Any) -> None:
        if not self._named:
            targets[copies] = positions[:, np.newaxis]
            return
        targets["position"][copies] = positions[:, np.newaxis]
        if velocities is not None:
            targets["velocity"][copies] = velocities[:, np.newaxis]

    def _run(self, burst: Any, copies: Numbers, seen: _core.Seen | None) -> None:
        """Runs a burst. Raises CopyFailed with the numbers of the copies."""
        if isinstance(self.member, Frontend):
            burst.run(TIMEOUT, seen=seen)
            return
        try:
            burst.run(numbers_of_worlds(copies, self._each))
        except CopyFailed as failed:
            if self._each == 1:
                raise
            errors = {number // self._each: error for number, error in failed.errors.items()}
            text = f"{failed} (they are worlds, {self._each} of each robot, in order)"
            raise CopyFailed(text, errors) from failed
