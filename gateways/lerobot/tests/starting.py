"""Starts robots in processes for the tests of this folder; arms have fake servos."""

import itertools
import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import o80
from o80_arms import fakes

#: Starts a robot in real time by name and options; returns its segment. moved: distance of the
#: fake servos from the middle of their ranges [steps].
Start = Callable[..., str]
_count = itertools.count()


@contextmanager
def starting() -> Iterator[Start]:
    """Returns a function that starts robots, and ends them at the end of the block."""
    with ExitStack() as stack:

        def start(robot: str, moved: int = 0, **options: Any) -> str:
            if hasattr(fakes, robot):
                fake = stack.enter_context(getattr(fakes, robot)())
                for servo in fake.chain.servos.values():
                    servo.stand_at(servo.shown + moved)
                options |= fake.options | {"answer_timeout": 9.0}  # a busy machine
            segment = f"test-{os.getpid()}-{next(_count)}"
            stack.enter_context(o80.robots.load(robot).start(segment, gap=60.0, **options))
            return segment

        yield start
