"""Halts of a task's robots: a halt ends an episode, and a reset ends the halt."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from o80.base.errors import BackendHalted, CopyFailed
from o80.frontend.frontend import Frontend
from o80.frontend.results import Halt
from o80.groups.inline_group import InlineGroup

Robots = Sequence[InlineGroup | Frontend]


_OF_THE_ROBOT = ("driver", "silence", "error", "overruns")
"""Causes of halts that a reset ends for a robot in another process: nobody requested them."""


def halts_of(robots: Robots, copies: int) -> dict[int, str]:
    """Returns the text of the halt of each halted copy.

    A group may have several robots for each of `copies` copies, in order.
    """
    found: dict[int, str] = {}
    for robot in robots:
        if isinstance(robot, InlineGroup):
            each = max(1, robot.copies // copies)
            for number, halt in robot.halted.items():
                found.setdefault(number // each, _text(halt))
        elif (halt_of_robot := robot.halted) is not None:
            found = dict.fromkeys(range(copies), _text(halt_of_robot)) | found
    return found


def resume(
    robots: Robots, copies: NDArray[np.intp], of: int, resumes: bool = True
) -> CopyFailed | None:
    """Ends the halts of these copies; returns the failure of copies that stay halted.

    of: number of all copies. resumes: also end halts that a robot with a clock caused itself.
    """
    failures: list[CopyFailed] = []
    for robot in robots:
        each = max(1, robot.copies // of) if isinstance(robot, InlineGroup) else 1
        try:
            if isinstance(robot, InlineGroup):
                if robot.halted:
                    robot.resume((copies[:, np.newaxis] * each + np.arange(each)).ravel())
            else:
                _resume(robot, resumes)
        except CopyFailed as failed:
            errors = {number // each: error for number, error in failed.errors.items()}
            failures.append(failed if each == 1 else CopyFailed(str(failed), errors))
        except BackendHalted as error:
            failures.append(CopyFailed(str(error), dict.fromkeys(copies.tolist(), error)))
    if len(failures) < 2:
        return failures[0] if failures else None
    errors = {copy: error for failed in failures for copy, error in failed.errors.items()}
    return CopyFailed(". ".join(map(str, failures)), errors)


def _resume(robot: Frontend, resumes: bool) -> None:
    """Resumes one robot. Raises BackendHalted if a reset must not end its halt."""
    halt = robot.halted
    if halt is None:
        return
    allowed = halt.cause in _OF_THE_ROBOT and (resumes or robot.bursting)
    if not (robot._is_inline or allowed):
        by = f" by {halt.who}" if halt.who else ""
        name, number = robot.segment, halt.number
        raise BackendHalted(
            f"'{name}' was halted{by} (cause {halt.cause}): {halt.text or 'no reason was given'}. "
            f"A reset does not end this halt: `o80 resume {name} {number}`, in "
            f"Python resume({number}), then reset again"
        )
    at_rest = not robot.bursting  # in real time `resume` waits for rest
    while not at_rest:
        row = robot.latest()
        at_rest = row.halted and not row.braking.any()
        robot.burst(1)  # the braking has ended one iteration after it is last seen
    robot.resume(halt.number)


def _text(halt: Halt) -> str:
    return halt.text or f"cause {halt.cause}"
