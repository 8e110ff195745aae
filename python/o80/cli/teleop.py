"""``o80 teleop``: move one robot by hand, and another one follows."""

import contextlib
import os
import select
import signal
import sys
import termios
import time
import tty
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from o80.base.errors import BackendGone
from o80.base.screen import complain, overwrite
from o80.base.stop_request import StopRequest
from o80.cli.attach import attach

if TYPE_CHECKING:
    from o80.joining.teleoperation import Teleoperation

_BETWEEN_REPORTS = 0.5  # [s]
_LONGEST_TASK = 900  # a mark holds 976 bytes
_KEYS = "space begins and ends a demonstration, x throws it away, q ends"


def teleop(
    leader: Annotated[str, typer.Argument(help="Segment of the robot that is moved by hand.")],
    follower: Annotated[str, typer.Argument(help="Segment of the robot that follows.")],
    joint: Annotated[
        list[str] | None,
        typer.Option(
            help="FOLLOWER=SCALE*LEADER+OFFSET, for example elbow=-1*elbow+0.3; again for each "
            "joint. Without it all joints of the same name.",
        ),
    ] = None,
    near: Annotated[
        float, typer.Option(help="It begins when each joint is so near, in the joint's unit.")
    ] = 0.15,
    silence: Annotated[
        float, typer.Option(help="Halt the follower after so many seconds without the leader.")
    ] = 0.2,
    task: Annotated[str, typer.Option(help="Name of what is demonstrated, for the data set.")] = "",
) -> None:
    """Move one robot by hand, and another one follows within its limits.

    The follower begins once both are near to each other. Record demonstrations with `o80 record`.
    """
    stop = StopRequest()
    from o80.joining.teleoperation import Joint, Teleoperation

    joints = [Joint.parse(each) for each in joint] if joint else None
    if not task.isprintable() or len(task.encode()) > _LONGEST_TASK:
        raise typer.BadParameter(
            f"give one line of at most {_LONGEST_TASK} bytes", param_hint="--task"
        )
    with (
        attach(leader) as hand,
        attach(follower, read_only=False) as arm,
        contextlib.ExitStack() as controls,  # a second controller would conflict
        _keyboard() as keys,
    ):
        robots = Teleoperation(hand, arm, joints=joints, near=near, silence=silence)
        controls.enter_context(arm.control())
        session = _Session(robots, f"episode: {task}" if task else "episode")
        print(session.head(keys), file=sys.stderr, flush=True)
        halted = False
        try:
            while not stop.requested and not session.press(_pressed() if keys else ""):
                robots.step()
                session.report()
                before, halted = halted, arm.halted is not None
                if before and not halted:  # a halt by the watchdog has ended the control
                    controls.close()
                    controls.enter_context(arm.control())
        except BackendGone as error:
            overwrite("")
            complain(str(error))
            raise typer.Exit(1) from None
        finally:
            session.end()


class _Session:
    """User interface of a session: shows its state, and makes marks by keys."""

    def __init__(self, robots: "Teleoperation", episode: str) -> None:
        self._robots = robots
        self._episode = episode
        self._open = False  # whether a demonstration is open
        self._shown = 0  # number of demonstrations
        self._reported = ""
        self._report_at = 0.0
        self._mark("episode_dropped")  # drops a demonstration that a killed session left open

    def head(self, keys: bool) -> str:
        robots = self._robots
        pairs = ", ".join(
            joint.follower if joint.follower == joint.leader else f"{joint.follower}={joint.leader}"
            for joint in robots.joints
        )
        text = f"{robots.follower.segment} follows {robots.leader.segment}: {pairs}"
        return f"{text}\n{_KEYS}" if keys else text

    def press(self, key: str) -> bool:
        """Acts on a key; True if it ends the session."""
        if key == " " and (self._open or self._robots.engaged):
            self._mark("episode_end" if self._open else self._episode)
            self._open = not self._open
            self._shown += self._open
        elif key in ("x", "\x7f"):
            self._throw_away()
        elif key == "q" and self._open:
            self._mark("episode_end")
            self._open = False
        return key == "q"

    def _throw_away(self) -> None:
        if self._open:
            self._open = False
            self._shown -= 1
            self._mark("episode_dropped")

    def report(self) -> None:
        """Prints changes of the state; distances repeatedly while the follower waits."""
        robots = self._robots
        if robots.engaged:
            state = "follows"
            if self._open:
                state += f", demonstration {self._shown} (space ends it)"
            elif self._shown:
                state += f", {self._demonstrations()}"
        else:
            self._throw_away()
            state = f"does not follow: {robots.why}"
            if robots.moves:
                state = f"does not follow: move the leader's {', '.join(robots.moves)}"
        now = time.monotonic()
        terminal = sys.stderr.isatty()
        # places change all the time: only a terminal shows each
        shown = state if terminal else robots.why if robots.moves else state.split(",")[0]
        if shown == self._reported or (terminal and now < self._report_at):
            return
        self._reported, self._report_at = shown, now + _BETWEEN_REPORTS / 5
        overwrite(state, end="" if terminal else "\n")

    def end(self) -> None:
        """Prints the delay of the follower. Drops a demonstration that no key has ended."""
        with contextlib.suppress(BackendGone):
            self._throw_away()
        overwrite("")
        delay = None
        with contextlib.suppress(BackendGone):
            delay = self._robots.delay()
        measured = "not measured: too little motion" if delay is None else str(delay)
        print(f"{self._demonstrations()}; delay from hand to motor {measured}")

    def _demonstrations(self) -> str:
        return f"{self._shown} demonstration{'' if self._shown == 1 else 's'}"

    def _mark(self, text: str) -> None:
        self._robots.follower.mark(text)


@contextlib.contextmanager
def _keyboard() -> Iterator[bool]:
    """Makes keys come one by one, without echo; False where there is no keyboard."""
    if not sys.stdin.isatty():
        yield False
        return
    before = termios.tcgetattr(sys.stdin)

    def take(*_: object) -> None:
        tty.setcbreak(sys.stdin)

    signal.signal(signal.SIGCONT, take)  # a shell had the terminal meanwhile
    try:
        take()
        yield True
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def _pressed() -> str:
    """Returns the pressed key; empty for none."""
    if not select.select([sys.stdin], [], [], 0)[0]:
        return ""
    return os.read(sys.stdin.fileno(), 1).decode(errors="replace") or "q"
