"""Client with rclpy, run by ROS 2's Python: prints its observations as one line of JSON.

judge.py listen ROBOT COUNT: prints `ready` after the first message, then receives COUNT more.
judge.py command ROBOT: moves, halts, resumes and requests.
"""

import json
import signal
import sys
from collections.abc import Callable
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

signal.alarm(120)  # fails without a gateway
rclpy.init()
node = rclpy.create_node("judge")


def spin_until(condition: Callable[[], object]) -> None:
    while not condition():
        rclpy.spin_once(node, timeout_sec=0.1)


def listen(robot: str, count: int) -> dict[str, Any]:
    """Returns samples as serialized bytes, and the graph's data of the topic."""
    raw, texts = list[bytes](), list[String]()
    reports, clocks = list[DiagnosticArray](), list[Clock]()
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    topic = f"/{robot}/joint_states"
    node.create_subscription(JointState, topic, raw.append, count + 10, raw=True)
    node.create_subscription(String, f"/{robot}/robot_description", texts.append, latched)
    node.create_subscription(DiagnosticArray, "/diagnostics", reports.append, 10)
    node.create_subscription(Clock, "/clock", clocks.append, 10)
    spin_until(lambda: raw and texts and reports and clocks)
    print("ready", flush=True)
    spin_until(lambda: len(raw) > count)
    (publisher,) = node.get_publishers_info_by_topic(topic)
    return {
        "node": publisher.node_name,
        "hash": str(publisher.topic_type_hash),
        "services": sorted(name for name, _ in node.get_service_names_and_types()),
        "urdf": texts[0].data,
        "reports": {each.name: each.message for each in reports[-1].status},
        "samples": [each.hex() for each in raw],
    }


def command(robot: str) -> dict[str, Any]:
    states: list[JointState] = []
    node.create_subscription(JointState, f"/{robot}/joint_states", states.append, 10)
    publisher = node.create_publisher(JointTrajectory, f"/{robot}/joint_trajectory", 10)
    spin_until(lambda: states and publisher.get_subscription_count())
    point = JointTrajectoryPoint(positions=[0.5])
    point.time_from_start.sec = 1
    message = JointTrajectory(joint_names=["elbow"], points=[point])
    message.header.stamp = node.get_clock().now().to_msg()
    publisher.publish(message)
    spin_until(lambda: abs(states[-1].position[1] - 0.5) < 1e-3)
    speed = Parameter(name="speed", value=ParameterValue(type=3, double_value=5.0))
    home = SetParametersAtomically.Request(parameters=[speed])
    halt, resume = (call(Trigger, f"/{robot}/{n}", Trigger.Request()) for n in ("halt", "resume"))
    homed = call(SetParametersAtomically, f"/{robot}/requests/home", home)
    return {"halt": halt.message, "resume": resume.message, "home": homed.result.reason}


def call(kind: Any, name: str, request: Any) -> Any:
    client = node.create_client(kind, name)
    spin_until(client.service_is_ready)
    future = client.call_async(request)
    spin_until(future.done)
    return future.result()


what, robot, *rest = sys.argv[1:]
found = listen(robot, int(rest[0])) if what == "listen" else command(robot)
print(json.dumps(found), flush=True)
