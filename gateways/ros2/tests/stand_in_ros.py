"""Stand-ins for rclpy: message classes and a node; rosbags defines and encodes messages."""

import re
from collections.abc import Callable
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

STORE: Any = get_typestore(Stores.ROS2_JAZZY)
BASE, NAME, ARRAY, SEQUENCE = 1, 2, 3, 4  # kinds of a field, as rosbags numbers them


def default(kind: int, of: Any) -> Any:
    if kind == BASE:
        return "" if of[0] == "string" else 0
    return message_class(of)() if kind == NAME else []


@cache
def message_class(name: str) -> type:
    """Builds a class with the fields of a message, all with defaults, as in rclpy."""
    _, fields = STORE.fielddefs[name]

    def fill(self: Any, **given: Any) -> None:
        for field, (kind, of) in fields:
            setattr(self, field, given.pop(field) if field in given else default(int(kind), of))
        assert not given, f"{name} has no fields {given}"

    return type(name, (), {"__init__": fill, "ros_name": name})


def encoded(message: Any) -> Any:
    """Encodes a message and decodes it with rosbags; fails for a value of a wrong type."""
    name = message.ros_name
    return STORE.deserialize_cdr(STORE.serialize_cdr(_plain(message), name), name)


def _plain(message: Any) -> Any:
    values = {}
    for field, (kind, of) in STORE.fielddefs[message.ros_name][1]:
        value = getattr(message, field)
        if int(kind) == NAME:
            value = _plain(value)
        elif int(kind) in (ARRAY, SEQUENCE):
            inner, element = of[0]
            if int(inner) == NAME:
                value = [_plain(each) for each in value]
            elif element[0] != "string":
                value = np.array(value, element[0])
        values[field] = value
    return STORE.types[message.ros_name](**values)


def of(path: str) -> Any:
    """Returns the stand-in for a name of ROS 2."""
    package, kind, name = path.split(".", 2)
    if kind == "msg":
        return message_class(f"{package}/msg/{name}")
    return {
        "QoSProfile": lambda **given: given,
        "qos_profile_sensor_data": "best effort",
        "DurabilityPolicy": SimpleNamespace(TRANSIENT_LOCAL="transient local"),
        "parameter_value_to_python": lambda value: value,
        "deserialize_message": lambda data, kind: data.message,
    }.get(name, object)


class Raw:
    """Serialized message, with its size."""

    def __init__(self, message: Any) -> None:
        self.message = message

    def __len__(self) -> int:
        return len(STORE.serialize_cdr(_plain(self.message), self.message.ros_name))


class Publisher:
    def __init__(self) -> None:
        self.sent: list[Any] = []

    def publish(self, message: Any) -> None:
        self.sent.append(encoded(message))

    def get_subscription_count(self) -> int:
        return 1


class Node:
    """Node that stores publishers, subscriptions and services by name."""

    def __init__(self) -> None:
        self.published: dict[str, Publisher] = {}
        self.subscribed: dict[str, Callable[[Any], None]] = {}
        self.served: dict[str, Callable[[Any, Any], Any]] = {}
        self.qos: dict[str, Any] = {}
        self.logged: list[str] = []

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=lambda text, **_: self.logged.append(text))

    def count_publishers(self, name: str) -> int:
        return int(name in self.published)

    def create_publisher(self, kind: type, name: str, qos: Any) -> Publisher:
        assert re.fullmatch(r"(/[A-Za-z][A-Za-z0-9_]*)+", name), name
        assert name not in self.published, name
        self.qos[name] = qos
        self.published[name] = Publisher()
        return self.published[name]

    def create_subscription(
        self, kind: type, name: str, take: Callable[[Any], None], qos: Any, *, raw: bool
    ) -> str:
        assert raw
        self.subscribed[name] = take
        return name

    def create_service(self, kind: type, name: str, serve: Callable[[Any, Any], Any]) -> str:
        self.served[name] = serve
        return name

    def destroy_publisher(self, publisher: Publisher) -> None:
        self.published = {k: v for k, v in self.published.items() if v is not publisher}

    def destroy_subscription(self, name: str) -> None:
        del self.subscribed[name]

    def destroy_service(self, name: str) -> None:
        del self.served[name]

    def call(self, name: str, **parameters: Any) -> tuple[bool, str]:
        """Calls a service; returns success and text."""
        pairs = [SimpleNamespace(name=key, value=value) for key, value in parameters.items()]
        answer = SimpleNamespace(result=SimpleNamespace())
        self.served[name](SimpleNamespace(parameters=pairs), answer)
        if parameters:
            return answer.result.successful, answer.result.reason
        return answer.success, answer.message


class Served:
    """Node of services that run in the caller's thread."""

    def __init__(self, others: Node, name: str) -> None:
        """others: node that also finds the services of this one."""
        self.node, self._others = Node(), others

    def start(self) -> None:
        self._others.served |= self.node.served

    def close(self) -> None:
        for name in self.node.served:
            del self._others.served[name]
