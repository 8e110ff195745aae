"""LeRobot's client of asynchronous inference, with answers executed in their own iterations.

python -m lerobot_robot_o80.chunks --robot.type=o80 --robot.segment=so101 --fps=30 \\
    --policy_type=act --pretrained_name_or_path=user/model --actions_per_chunk=50

Takes the flags of `python -m lerobot.async_inference.robot_client`, but ignores
aggregate_fn_name. Uses LeRobot's server. Needs grpcio. See docs/lerobot.md.
"""

import math
import threading
from typing import Any

import draccus
import numpy as np
from lerobot.async_inference.configs import RobotClientConfig
from lerobot.async_inference.helpers import TimedAction, TimedObservation
from lerobot.async_inference.robot_client import RobotClient
from lerobot.utils.import_utils import register_third_party_plugins
from numpy.typing import NDArray

import o80
from lerobot_robot_o80.robot import O80
from o80.frontend.chunk_parts import SentChunk
from o80.rows.columns import value_of

PATIENCE = 2.0
"""Timeout of an answer, after which the request is repeated [s]."""


class ChunkClient(RobotClient):
    """Executes a policy server's answers through a plan of chunks (docs/chunks.md).

    The timestep of an observation is the iteration of its row, and the server returns it: action
    i of the answer is due i + 1 steps after that row, however late the answer is. A request is
    sent when at most the share chunk_size_threshold of an answer is still planned.

    Threads: control_loop in one, receive_actions in another, as LeRobot runs them.
    """

    def __init__(self, config: RobotClientConfig) -> None:
        super().__init__(config)
        if not isinstance(self.robot, O80):
            self.robot.disconnect()
            raise o80.InvalidArgument(
                f"chunks are for robots of o80: use --robot.type=o80, not {config.robot.type}"
            )
        try:
            arm = self.robot.segment.checked()
            self._numbers = [*self.robot.segment.numbers("desired").values()]
            self._wall = arm.provenance.wall_clock_offset
            names = [number.actuator for number in self._numbers]
            step = arm.frequency / config.fps
            self.plan = arm.chunks(names, step=step)
            self._step: float = step
            self._usual: int = self.plan.ease
            self.sent: list[SentChunk] = []  #: the answers
        except BaseException:
            self.robot.disconnect()
            raise
        self._lead: int = round(config.chunk_size_threshold * config.actions_per_chunk * step)
        self._answered = threading.Event()
        self._failure: BaseException | None = None

    def control_loop(self, task: str, verbose: bool = False) -> tuple[Any, Any]:
        """Requests answers until `stop`. Returns the last observation and None.

        Raises BackendHalted, BackendGone.
        """
        self.start_barrier.wait()
        seen = None
        while self.running:
            try:
                self.plan.wait(lead=self._lead, timeout=0.5)
            except o80.TimeoutError:
                continue
            try:
                seen = self._ask(task)
            except RuntimeError:  # LeRobot's error, if the client was stopped meanwhile
                if self.running:
                    raise
            self._answered.wait(PATIENCE)
        if self._failure is not None:
            raise self._failure
        return seen, None

    def _ask(self, task: str) -> dict[str, Any]:
        self._answered.clear()
        observation: dict[str, Any] = self.robot.get_observation()
        row = self.robot.seen
        assert row is not None
        self.send_observation(
            TimedObservation(
                timestamp=(row.time + self._wall) * 1e-9,
                timestep=row.iteration,
                observation={**observation, "task": task},
                must_go=True,
            )
        )
        return observation

    def _aggregate_action_queues(
        self, incoming_actions: list[TimedAction], aggregate_fn: Any = None
    ) -> None:
        """Adds an answer to the plan. LeRobot calls this in the thread of receive_actions."""
        try:
            actions = np.array([each.get_action().numpy() for each in incoming_actions])
            rows = self.robot.segment.targets(actions)
            seen = incoming_actions[0].get_timestep()
            self.plan.ease = self._ease(rows, seen)
            self.sent.append(self.plan.send(rows, seen=seen))
        except o80.Error as error:
            self._failure = error
            self.shutdown_event.set()
        finally:
            self._answered.set()

    def _ease(self, rows: NDArray[np.float64], seen: int) -> int:
        """Number of iterations for a take-over within the joints' limits (docs/chunks.md)."""
        arm: o80.Frontend = self.robot.segment.checked()
        now: int = min(int((arm.published - seen) / self._step), len(rows) - 1)
        planned = self.plan.planned(seen, now + 1)
        here = planned[now] if len(planned) > now else self._desired(arm.latest())
        needed = 0.0
        for number, distance in zip(self._numbers, np.abs(rows[now] - here), strict=True):
            limits = next(each for each in arm.actuators if each.name == number.actuator).limits
            needed = max(
                needed,
                (5.8 * distance / limits.acceleration) ** (1 / 2),
                (60 * distance / limits.jerk) ** (1 / 3),
                1.9 * distance / limits.speed,
            )
        enough = math.ceil(float(needed) * float(arm.frequency))
        return max(self._usual, enough)

    def _desired(self, row: o80.Observation) -> NDArray[np.float64]:
        return np.array([value_of(row, number.column) for number in self._numbers])

    def stop(self) -> None:
        """Ends the plan after the last sent action, and disconnects the robot."""
        self.plan.close()
        super().stop()


@draccus.wrap()
def main(config: RobotClientConfig) -> None:
    """Runs the client until Ctrl-C, a halt, or the end of the robot."""
    client = ChunkClient(config)
    try:
        if not client.start():
            raise o80.Error(f"no policy server answers at {config.server_address}: start it")
        receiver = threading.Thread(target=client.receive_actions, daemon=True)
        receiver.start()
        client.control_loop(config.task)
    except KeyboardInterrupt:
        pass
    finally:
        client.stop()


if __name__ == "__main__":
    register_third_party_plugins()
    main()
