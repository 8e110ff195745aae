"""Teleoperation: one robot, moved by hand, commands the joints of another."""

import contextlib
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

import o80._core as _core
from o80.base.argument_checks import number
from o80.base.errors import BackendGone, Error, InvalidArgument, TimeoutError
from o80.base.words import Status
from o80.rows.columns import Column, columns_of, value_of
from o80.rows.history import values_of

if TYPE_CHECKING:
    from o80.frontend.frontend import Frontend
    from o80.joining.latency import Latency
    from o80.rows.actuators import Actuator

NEAR = 0.15  #: largest difference of a joint at which the follower begins to follow, in its unit
HELD = 0.5  #: time for which all joints must be near before it begins [s]
SILENCE = 0.2  #: time without a row of the leader after which the follower is halted [s]
FASTEST = 200.0  # set-points a second
_JOINT = re.compile(r"([\w.\[\]]+)=(?:([^*=]+)\*)?([\w.\[\]]+?)([+-][\d.]+(?:e[+-]?\d+)?)?")


@dataclass(frozen=True)
class Joint:
    """A joint of the follower, whose target is scale x the leader's joint + offset."""

    follower: str
    leader: str
    scale: float = 1.0
    offset: float = 0.0

    @classmethod
    def parse(cls, text: str) -> Self:
        """Parses "elbow", "elbow=lower", "elbow=-1*lower" or "elbow=-1*lower+0.3"."""
        found = _JOINT.fullmatch(text if "=" in text else f"{text}={text}")
        try:
            if found is None:
                raise ValueError
            follower, scale, leader, offset = found.groups()
            return cls(follower, leader, float(scale or 1), float(offset or 0))
        except ValueError:
            raise InvalidArgument(
                f"a joint is written FOLLOWER=SCALE*LEADER+OFFSET, for example "
                f"elbow=-1*elbow+0.3, not '{text}'"
            ) from None


class Teleoperation:
    """Makes the joints of a robot, the follower, track a robot moved by hand, the leader.

    leader, follower: frontends, both real-time, or both bursting and burst by the caller, who
        also closes them.
    joints: joints that follow (None: all that both have, by name).
    near: the follower begins once each joint has been this near to its target for 0.5 s, in the
        unit of the joint.
    silence: time without a row of the leader after which the follower is halted [s].

    Call step() repeatedly, from one thread. Raises InvalidArgument for joints that do not match.
    """

    def __init__(
        self,
        leader: "Frontend",
        follower: "Frontend",
        *,
        joints: Iterable[Joint] | None = None,
        near: float = NEAR,
        silence: float = SILENCE,
    ) -> None:
        if leader.segment == follower.segment:
            raise InvalidArgument(f"'{leader.segment}' cannot follow itself")
        self.leader, self.follower = leader, follower
        self.near, self.silence = number(near, "near"), number(silence, "silence")
        if not (0 < self.near < math.inf and 0 < self.silence < math.inf):
            raise InvalidArgument(f"near and silence must be finite and > 0, got {near}, {silence}")
        given = {each.name: each for each in leader.actuators}
        taken = {each.name: each for each in follower.actuators}
        if joints is None:
            joints = [Joint(name, name) for name in taken if name in given]
            if not joints:
                raise InvalidArgument(
                    f"'{leader.segment}' ({', '.join(given)}) and '{follower.segment}' "
                    f"({', '.join(taken)}) share no name of a joint: give the pairs as joints"
                )
        self.joints = list(joints)
        names = [joint.follower for joint in self.joints]
        if len(set(names)) != len(names) or not names:
            raise InvalidArgument(f"name each joint of the follower once, got {names}")
        for joint in self.joints:
            ends = ((leader, given, joint.leader), (follower, taken, joint.follower))
            for robot, known, name in ends:
                if name not in known:
                    raise InvalidArgument(
                        f"'{robot.segment}' has no joint '{name}', it has {', '.join(known)}"
                    )
            _check_numbers(joint)
            _check_units(joint, given[joint.leader], taken[joint.follower])
        self._from = [_column(leader, given[joint.leader]) for joint in self.joints]
        self._to = [_column(follower, taken[joint.follower]) for joint in self.joints]
        self._fields = [taken[name].numbers[0].name for name in names]
        self._scale = np.array([joint.scale for joint in self.joints])
        self._offset = np.array([joint.offset for joint in self.joints])
        self._low = np.array([taken[name].limits.minimum for name in names])
        self._high = np.array([taken[name].limits.maximum for name in names])
        self._stride = max(1, round(1 / (FASTEST * leader.period)))  # leader's rows per step
        self._every = max(self._stride * leader.period, follower.period)
        self._last = leader.published  # iteration of the last row read
        self._wanted = np.full(len(self.joints), np.nan)  # targets by that row
        self._near_since: int | None = None  # time of a row of the leader [ns]
        self._sent: _core.Batch | None = None
        self.engaged = False  #: whether the follower follows
        self.why = ""  #: why it does not follow
        self.far: dict[str, tuple[float, float]] = {}
        """Target and position of each joint of the follower that is not near, by name."""
        self.moves: list[str] = []
        """How to move the leader, in its own numbers: "elbow from 0.50 to 0.00"."""

    def step(self) -> bool:
        """Waits for the next row of the leader and commands the follower; True if it follows.

        If the leader is silent or halted while the follower follows, the follower is halted, with
        the reason in `why`; following continues once that is resumed and near again. If the leader
        jumps by more than `near` from row to row, the follower stays at its last target until it
        is near again. Raises BackendGone, and the exceptions of pulse.
        """
        try:
            seen = self._next_row()
        except (TimeoutError, BackendGone) as error:
            gone = isinstance(error, BackendGone)
            how = "has ended" if gone else f"has published nothing for {self.silence:g} s"
            self._disengage(f"the leader '{self.leader.segment}' {how}")
            if gone:
                raise
            return False
        if seen.halted:
            self._disengage(f"the leader '{self.leader.segment}' is halted: resume it first")
            return False
        is_new, self._last = seen.iteration != self._last, seen.iteration
        why = self._refused()
        if why or not self.engaged:  # else a pulse does both
            with contextlib.suppress(TimeoutError):
                self.follower.wait_for(self.follower.published + 1, 0.0)  # raises if it has ended
            self.follower.keep_alive()
        if why:
            self.engaged, self._near_since, self.why = False, None, why
            self.far, self.moves = {}, []
            return False
        if not is_new:
            return self.engaged
        wanted = self.targets(seen)
        jumped = not bool(np.all(np.abs(wanted - self._wanted) <= self.near))  # or is not finite
        self._wanted = wanted
        if jumped:
            self.engaged, self._near_since = False, None
        if not self.engaged:
            self._check_distance(seen, wanted)
        if self.engaged:
            for joint, field, place in zip(self.joints, self._fields, wanted.tolist(), strict=True):
                state = {field: place} if field else place
                self.follower.add_command(joint.follower, state, every=self._every)
            self._sent = self.follower.pulse(seen=seen)
        return self.engaged

    def targets(self, seen: _core.Observation) -> NDArray[np.float64]:
        """Returns the follower's targets for a row of the leader, clamped to the joints' bounds."""
        places = _places(seen, self._from)
        targets: NDArray[np.float64] = np.clip(
            self._scale * places + self._offset, self._low, self._high
        )
        return targets

    def delay(self, seconds: float = 30.0) -> "Latency | None":
        """Estimates the follower's delay behind the leader in the last seconds, at the joint that
        moved most; None if nothing moved enough.
        """
        from o80.joining.latency import latency

        rows = self.leader.history(seconds=seconds)
        if not len(rows):
            return None
        moved = [float(np.ptp(values_of(rows, column))) for column in self._from]
        chosen = int(np.argmax(np.abs(self._scale) * moved))
        try:
            return latency(
                (self.leader, self._from[chosen].name),
                (self.follower, self._to[chosen].name),
                seconds=seconds,
            )
        except Error:
            return None

    def _next_row(self) -> _core.Observation:
        """Waits for the newest row; skips rows of a fast leader."""
        if self.leader.bursting:  # it may be idle
            with contextlib.suppress(TimeoutError):
                self._wait_for_row(1, 0.01)
        else:
            self._wait_for_row(1, self.silence)
            with contextlib.suppress(TimeoutError):
                self._wait_for_row(self._stride, self.silence)
        return self.leader.latest()

    def _wait_for_row(self, after: int, timeout: float) -> None:
        if self.leader.published < self._last + after:
            self.leader.wait_for(self._last + after, timeout)

    def _refused(self) -> str:
        """Returns why the follower takes no commands; empty if it does."""
        if (halt := self.follower.halted) is not None:
            return f"'{self.follower.segment}' is halted: {halt.text or halt.cause}"
        sent, self._sent = self._sent, None
        if sent is not None and sent[0].status == Status.REJECTED:
            return f"'{self.follower.segment}' rejects commands: {sent[0].text or sent[0].reason}"
        return ""

    def _disengage(self, why: str) -> None:
        self.why, self._near_since, self.far, self.moves = why, None, {}, []
        if self.engaged:
            self.engaged = False
            self.follower.halt(why)

    def _check_distance(self, seen: _core.Observation, wanted: NDArray[np.float64]) -> None:
        here = _places(self.follower.latest(), self._to)
        distant = ~(np.abs(wanted - here) <= self.near)
        self.far = {
            self.joints[i].follower: (float(wanted[i]), float(here[i]))
            for i in np.flatnonzero(distant)
        }
        there = _places(seen, self._from)
        self.moves = [
            self._move(self.joints[i], float(there[i]), float(here[i]))
            for i in np.flatnonzero(distant)
        ]
        if self.far:
            self._near_since = None
            self.why = "move the leader to where the follower is"
            return
        if self._near_since is None:
            self._near_since = seen.time
        self.engaged = seen.time - self._near_since >= HELD * 1e9
        self.why = "" if self.engaged else "both have been near for less than half a second"

    def _move(self, joint: Joint, leader: float, follower: float) -> str:
        """Describes the motion of the leader that brings the follower near, in its own numbers."""
        # enough digits that a rounded place is near, too
        digits = max(2, math.ceil(math.log10(abs(joint.scale) / self.near)))
        target = (follower - joint.offset) / joint.scale + 0.0  # never -0
        places = [
            f"{place:.{digits}f}" if math.isfinite(place) else "an unknown place"
            for place in (leader, target)
        ]
        return f"{joint.leader} from {places[0]} to {places[1]}"


def _check_numbers(joint: Joint) -> None:
    if joint.scale == 0 or not math.isfinite(joint.scale) or not math.isfinite(joint.offset):
        raise InvalidArgument(
            f"'{joint.follower}' follows '{joint.leader}' with scale {joint.scale:g} and offset "
            f"{joint.offset:g}: the scale must not be 0, and both must be finite"
        )


def _check_units(joint: Joint, leader: "Actuator", follower: "Actuator") -> None:
    one, other = leader.numbers[0].unit, follower.numbers[0].unit
    if one != other and joint.scale == 1:
        raise InvalidArgument(
            f"'{joint.leader}' is in {one or 'no unit'} and '{joint.follower}' in "
            f"{other or 'no unit'}: give a scale, {joint.follower}=SCALE*{joint.leader}"
        )


def _column(robot: "Frontend", actuator: "Actuator") -> Column:
    """Returns the column of an actuator's first observed number."""
    path = ".".join(filter(None, ("observed", actuator.name, actuator.numbers[0].name)))
    return next(column for column in columns_of(robot.schema) if column.name == path)


def _places(row: _core.Observation, columns: list[Column]) -> NDArray[np.float64]:
    return np.array([value_of(row, column) for column in columns], np.float64)
