"""Publishes the rows of one robot as messages of ROS 2."""

from array import array
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

import o80
from o80.errors import Error
from o80.recording.joint_states import joints_of
from o80.rows.columns import Column, columns_of_part, is_within
from o80.view.urdf import WORLD, Links, Place
from o80_ros2 import ros
from o80_ros2.sensors import Sensor, png, sensors_of

BETWEEN_IMAGES = 100_000_000  # least interval of images, whose compression is slow [ns]
DEPTH = 1000  # queue of unacknowledged messages of a reliable topic
STATE, TEXT = "sensor_msgs.msg.JointState", "std_msgs.msg.String"
TYPES = {
    "pose": ("geometry_msgs.msg.PoseStamped", ("pose.position", "pose.orientation")),
    "point": ("geometry_msgs.msg.PointStamped", ("point",)),
    "wrench": ("geometry_msgs.msg.WrenchStamped", ("wrench.force", "wrench.torque")),
    "image": ("sensor_msgs.msg.CompressedImage", ()),
    "transform": (
        "geometry_msgs.msg.TransformStamped",
        ("transform.translation", "transform.rotation"),
    ),
}
"""Message type of each kind, and the parts with numbers x, y, z, w."""


class Topics:
    """Publishes rows of backends with one schema. Used by one thread."""

    def __init__(self, shared: ros.Shared, robot: o80.Frontend) -> None:
        schema = self.schema = robot.schema
        self._shared, settings = shared, shared.settings
        self._name = settings.robot(robot.segment)
        self.is_simulated: bool = schema["clock"] == "simulated"
        self.time = 0  #: time of the newest published row [ns]
        self._images: dict[str, int] = {}  # time of each topic's last image [ns]
        self._made: list[Any] = []
        self._states: list[tuple[Any, list[str], dict[str, tuple[Column, ...]]]] = []
        joints, names = joints_of(robot._layout), dict[int, str]()
        if joints is not None:
            texts = settings.joints(joints.names)
            self._states.append((self._publisher(STATE, "joint_states"), texts, joints.numbers))
            places = (number.offset for number in joints.numbers["position"])
            names = dict(zip(places, texts, strict=True))
        if schema["actuators"]:
            texts = settings.joints(each["name"] for each in schema["actuators"])
            numbers = {"position": tuple(desired_numbers(schema))}
            self._states.append((self._publisher(STATE, "desired"), texts, numbers))
        self._sensors = [
            (each, self._publisher(TYPES[each.kind][0], each.name, newest=each.kind == "image"))
            for each in sensors_of(schema, robot.provenance.options)
        ]
        self._links = None
        try:
            self._links = Links.of(robot, self._name)
        except Error as error:
            shared.node.get_logger().warning(f"no URDF of '{self._name}': {error}")
        if self._links is not None:
            durable = ros.of("rclpy.qos.DurabilityPolicy").TRANSIENT_LOCAL
            latched = ros.of("rclpy.qos.QoSProfile")(depth=1, durability=durable)
            publisher = self._publisher(TEXT, "robot_description", latched)
            publisher.publish(ros.of(TEXT)(data=self._links.urdf(schema, names)))

    def _publisher(self, kind: str, name: str, qos: Any = DEPTH, *, newest: bool = False) -> Any:
        qos = ros.of("rclpy.qos.qos_profile_sensor_data") if newest else qos
        path = "/".join(["", self._name, *(ros.names_of([part])[0] for part in name.split("/"))])
        self._made.append(self._shared.node.create_publisher(ros.of(kind), path, qos))
        return self._made[-1]

    def destroy(self) -> None:
        """Removes the topics."""
        for made in self._made:
            self._shared.node.destroy_publisher(made)

    def publish(self, rows: NDArray[Any]) -> None:
        """Publishes rows, oldest first; images and transforms only of the last row."""
        extended = self.schema.get("extended", {"fields": []})
        captures = "capture_time" in [each["name"] for each in extended["fields"]]
        captured = rows["extended"]["capture_time"] if captures else rows["time"]
        times = np.where(captured, captured, rows["time"]).tolist()
        kind = ros.of(STATE)
        for publisher, names, members in self._states:
            values = {name: _numbers_of(rows, each) for name, each in members.items() if each}
            for i, time in enumerate(times):
                message = kind(header=self._header(time), name=names)
                for member, numbers in values.items():
                    setattr(message, member, array("d", numbers[i].tobytes()))
                publisher.publish(message)
        for i, row in enumerate(rows):
            holds = bool(captured[i]) or not captures
            for sensor, publisher in self._sensors if holds else ():
                last, is_image = i == len(rows) - 1, sensor.kind == "image"
                if is_image and not (last and self._is_image_due(sensor, publisher, times[i])):
                    continue
                if (found := sensor.values(row)) is not None:
                    publisher.publish(_message(sensor.kind, self._header(times[i]), found))
        self.time = int(rows["time"][-1])
        if self._shared.tf is not None and (places := [*self._places(rows[-1])]):
            header = self._header(times[-1])
            message = ros.of("tf2_msgs.msg.TFMessage")()
            for frame, *place in places:
                message.transforms.append(_message("transform", header, place, frame))
            self._shared.tf.publish(message)

    def _header(self, time: int) -> Any:
        """Builds a header with wall-clock or simulated time."""
        seconds, rest = divmod(
            time if self.is_simulated else time + self._shared.clock.offset, 10**9
        )
        stamp = ros.of("builtin_interfaces.msg.Time")(sec=seconds, nanosec=rest)
        return ros.of("std_msgs.msg.Header")(stamp=stamp, frame_id=WORLD)

    def _is_image_due(self, sensor: Sensor, publisher: Any, time: int) -> bool:
        """Whether an image is due: it has a subscriber, and the last one is old enough."""
        before = self._images.get(sensor.name, time - BETWEEN_IMAGES)
        if not publisher.get_subscription_count() or 0 <= time - before < BETWEEN_IMAGES:
            return False
        self._images[sensor.name] = time
        return True

    def _places(self, row: NDArray[Any]) -> Iterator[Place]:
        """Frames of the model's bodies and of measured poses."""
        if self._links is not None:
            yield from self._links.places(row.tobytes())
        for sensor, _ in self._sensors:
            if sensor.kind == "pose" and (values := sensor.values(row)) is not None:
                frame = sensor.name.rpartition("/")[0] or sensor.kind
                yield f"{self._name}/{frame}", values[0], values[1]


def _message(kind: str, header: Any, values: Sequence[NDArray[Any]], frame: str = "") -> Any:
    name, parts = TYPES[kind]
    message = ros.of(name)(header=header)
    if kind == "image":
        message.format, message.data = "png", array("B", png(values[0]))
    if frame:
        message.child_frame_id = frame
    for part, numbers in zip(parts, values, strict=False):
        into = message
        for word in part.split("."):
            into = getattr(into, word)
        for axis, number in zip("xyzw", numbers, strict=False):
            setattr(into, axis, float(number))
    return message


def _numbers_of(rows: NDArray[Any], columns: Iterable[Column]) -> NDArray[np.float64]:
    """Reads numbers from rows: (n,) => (n, numbers)."""
    found = [rows.getfield(each.dtype, each.offset) for each in columns]
    return np.stack(found, axis=1).astype(float)


def desired_numbers(schema: dict[str, Any]) -> Iterator[Column]:
    """Finds the first number of each actuator's desired state."""
    columns = columns_of_part(schema, "desired")
    for actuator in schema["actuators"]:
        yield next(each for each in columns if is_within(each.name, f"desired.{actuator['name']}"))
