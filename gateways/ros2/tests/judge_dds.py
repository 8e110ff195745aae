"""Client with Cyclone DDS: prints sample times [ns], as `judge.py listen`; bare: no IGNORING."""

# mypy: disable-error-code="type-arg"
import json
import os
import sys
import time
from dataclasses import dataclass

IGNORING = "<Compatibility><IgnoreTypeInformation>1.15</IgnoreTypeInformation></Compatibility>"
LOCAL = """<General><Interfaces><NetworkInterface address='127.0.0.1'/></Interfaces>
<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers><Peer address='127.0.0.1'/></Peers>
</Discovery>"""  # same as ROS with ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
robot, count, *bare = sys.argv[1:]
domain = f"<Domain Id='any'>{LOCAL if bare else IGNORING + LOCAL}</Domain>"
os.environ["CYCLONEDDS_URI"] = f"<CycloneDDS>{domain}</CycloneDDS>"

from cyclonedds.core import Policy, Qos  # noqa: E402
from cyclonedds.domain import DomainParticipant  # noqa: E402
from cyclonedds.idl import IdlStruct  # noqa: E402
from cyclonedds.idl.types import float64, int32, sequence, uint32  # noqa: E402
from cyclonedds.sub import DataReader  # noqa: E402
from cyclonedds.topic import Topic  # noqa: E402


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


participant = DomainParticipant(int(os.environ["ROS_DOMAIN_ID"]))
qos = Qos(Policy.Reliability.Reliable(10**9), Policy.History.KeepLast(int(count) + 10))
topic = Topic(participant, f"rt/{robot}/joint_states", JointState, qos=qos)
reader, times = DataReader(participant, topic, qos=qos), list[int]()
while len(times) <= int(count):
    found = reader.take(100)
    if found and not times:
        print("ready", flush=True)
    times += [each.header.stamp.sec * 10**9 + each.header.stamp.nanosec for each in found]
    time.sleep(0.005)
print(json.dumps(times), flush=True)
