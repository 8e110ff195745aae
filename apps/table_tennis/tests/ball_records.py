"""Records of balls for the tests of rewards: single ones, and many stacked."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from hypothesis import strategies as st

from o80_table_tennis.task.ball_record import BallRecord
from o80_table_tennis.task.state import State
from o80_table_tennis.world.table import NET_Y, TABLE, TARGET

SOMEWHERE = (0.3, 0.4, 1.1, 0.0, 1.0, 0.0)
NOTHING = np.zeros(8)


def state_of(record: BallRecord, ball: Sequence[float] = SOMEWHERE, steps: int = 80) -> State:
    return State(
        steps, NOTHING, NOTHING, NOTHING, NOTHING[:3], np.array(ball), record, np.array(TARGET)
    )


def stacked_records(records: Sequence[BallRecord]) -> BallRecord:
    names = BallRecord.__slots__
    return BallRecord(*(np.array([getattr(one, name) for one in records]) for name in names))


def stacked(states: Sequence[State]) -> State:
    """Stacks many states to one."""
    names = ("steps", "motion", "pressures", "asked", "racket", "ball", "goal")
    columns: dict[str, Any] = {
        name: np.array([getattr(one, name) for one in states]) for name in names
    }
    return State(record=stacked_records([one.record for one in states]), **columns)


def landing_at(x: float, y: float, largest_speed: float = 5.0, z: float = TABLE.top) -> BallRecord:
    return BallRecord(
        0.0, touched=True, landed=True, landing=(x, y, z), largest_speed=largest_speed
    )


coordinate = st.floats(-6.0, 6.0)
place = st.tuples(coordinate, coordinate, st.floats(-0.5, 3.0))
height = st.one_of(st.just(TABLE.top), st.floats(0.5, TABLE.top))
landing = st.tuples(
    st.floats(-0.3625, 1.1625), st.one_of(st.floats(0.2, 2.94), st.just(NET_Y)), height
)


@st.composite
def records(draw: st.DrawFn) -> BallRecord:
    """Strategy: any record of a running or ended episode."""
    touched = draw(st.booleans())
    return BallRecord(
        draw(st.floats(0.0, 5.0)) if not touched else 0.0,
        touched=touched,
        landed=touched and draw(st.booleans()),
        landing=draw(landing),
        largest_speed=draw(st.floats(0.0, 30.0)),
        touched_net=draw(st.booleans()),
        touched_floor=draw(st.booleans()),
        net_position=draw(place),
        floor_position=draw(place),
    )


@st.composite
def states(draw: st.DrawFn) -> State:
    """Strategy: any state of a ball."""
    ball = (*draw(place), *draw(place))
    return state_of(draw(records()), ball, draw(st.integers(1, 300)))
