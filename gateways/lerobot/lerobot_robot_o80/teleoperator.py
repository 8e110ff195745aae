"""O80Teleop: any o80 robot as a teleoperator of LeRobot, for example a leader moved by hand."""

from dataclasses import dataclass
from typing import Any

from lerobot.teleoperators import Teleoperator, TeleoperatorConfig
from lerobot.utils.decorators import check_if_already_connected, check_if_not_connected

from lerobot_robot_o80.segment import Segment


@TeleoperatorConfig.register_subclass("o80")
@dataclass(kw_only=True)
class O80TeleopConfig(TeleoperatorConfig):
    """Flags `--teleop.NAME` of LeRobot's programs."""

    segment: str  #: name of the leader's segment
    units: str = ""  #: as in O80Config
    timeout: float = 5.0  #: timeout of the leader, and of its next row [s]


class O80Teleop(Teleoperator):
    """Returns the observed numbers of an o80 robot as actions; commands nothing."""

    config_class = O80TeleopConfig
    name = "o80"

    def __init__(self, config: O80TeleopConfig) -> None:
        super().__init__(config)
        self.config = config
        self.segment = Segment(config.segment, config.units, config.timeout)

    @property
    def action_features(self) -> dict[str, type]:
        """Maps each observed number to `float`."""
        return dict.fromkeys(self.segment.numbers(), float)

    @property
    def feedback_features(self) -> dict[str, type]:
        return {}

    @property
    def is_connected(self) -> bool:
        return self.segment.arm is not None

    @property
    def is_calibrated(self) -> bool:
        """Always True: a driver of o80 refuses to start without its calibration."""
        return True

    def calibrate(self) -> None:
        """Does nothing: `o80 arms calibrate --leader` does."""

    def configure(self) -> None:
        """Does nothing: the driver did when it was started."""

    @check_if_already_connected
    def connect(self, calibrate: bool = True) -> None:
        """Attaches read-only. Raises TimeoutError without the robot."""
        self.segment.open(read_only=True)

    @check_if_not_connected
    def get_action(self) -> dict[str, float]:
        """Returns the newest row in LeRobot's units; raises as `Segment.read`."""
        return self.segment.read()[1]

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Does nothing: there is no feedback."""

    @check_if_not_connected
    def disconnect(self) -> None:
        self.segment.close()
