"""Observes a hunt over DDS with PyPI cyclonedds, as any ROS 2 node would, and sends a reception.

peer_ros2.py SPEED LEVEL_DBM [signed]; on SIGTERM prints what it received as JSON. Where the hunt is signed it
is a stranger without the key, who also sends orders to land, garbage and what he has recorded.
"""

import json
import math
import signal
import sys
import time
from dataclasses import dataclass, field

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float64, int32, int64, sequence, uint8, uint16, uint32, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

SPEED, LEVEL_DBM = float(sys.argv[1]), float(sys.argv[2])
SIGNED = sys.argv[3:] == ["signed"]


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time = field(default_factory=Time)
    frame_id: str = "map"


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    header: Header
    pose: Pose


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovariance_"):
    pose: Pose
    covariance: array[float64, 36]


@dataclass
class PoseWithCovarianceStamped(
        IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovarianceStamped_"):
    header: Header
    pose: PoseWithCovariance


@dataclass
class Path(IdlStruct, typename="nav_msgs::msg::dds_::Path_"):
    header: Header
    poses: sequence[PoseStamped]


@dataclass
class KeyValue(IdlStruct, typename="diagnostic_msgs::msg::dds_::KeyValue_"):
    key: str
    value: str


@dataclass
class DiagnosticStatus(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticStatus_"):
    level: uint8
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@dataclass
class DiagnosticArray(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticArray_"):
    header: Header
    status: sequence[DiagnosticStatus]


@dataclass
class Reception(IdlStruct, typename="foxhunt_msgs::msg::dds_::Reception_"):
    header: Header
    beacon: uint16
    heard: bool
    reason: str
    position: Point
    heading: float64
    pitch: float64
    roll: float64
    position_sigma: sequence[float64]
    rss_dbm: float64
    rss_sigma_db: float64
    has_bearing: bool
    bearing: float64
    bearing_sigma: float64
    bearing_confidence: float64
    covariance: float64
    mode_weights: sequence[float64]
    mode_bearings: sequence[float64]
    mode_sigmas: sequence[float64]
    velocity: sequence[float64]
    quantity_names: sequence[str]
    quantity_values: sequence[float64]
    quantity_sigmas: sequence[float64]


@dataclass
class String(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    data: str


@dataclass
class Order(IdlStruct, typename="foxhunt_msgs::msg::dds_::Order_"):
    header: Header
    number: uint64
    has_goal: bool
    goal: Point
    land: bool
    turn: uint64
    beacons: sequence[uint16]
    taken_beacons: sequence[uint16]
    taken_sec: sequence[int64]
    taken_nanosec: sequence[uint32]
    take_off: bool
    leave: uint8
    echo_sec: sequence[int64]
    echo_nanosec: sequence[uint32]


def now():
    """UNIX time as all nodes of this speed have it."""
    base = math.floor(time.time() / 1048576) * 1048576
    return base + (time.time() - base) * SPEED


def micros(stamp_sec, stamp_nanosec):
    return round(stamp_sec * 1e6 + stamp_nanosec / 1e3)


reliable = Policy.Reliability.Reliable(duration(seconds=1))
live = Qos(reliable, Policy.History.KeepLast(100), Policy.Durability.Volatile)
latched = Qos(reliable, Policy.History.KeepLast(1), Policy.Durability.TransientLocal)
# ROS 2 speaks the first version of CDR.
spoken = Qos(reliable, Policy.History.KeepLast(10), Policy.Durability.Volatile,
             Policy.DataRepresentation(use_cdrv0_representation=True))
participant = DomainParticipant(0)


def reader(topic, kind, qos):
    return DataReader(participant, Topic(participant, "rt" + topic, kind), qos=qos)


estimates = reader("/foxhunt/beacon_0/estimate", PoseWithCovarianceStamped, latched)
diagnostics = reader("/diagnostics", DiagnosticArray, live)
paths = reader("/foxhunt/drone_0/path", Path, latched)
poses = reader("/foxhunt/drone_2/pose", PoseStamped, live)
receptions = [reader(f"/foxhunt/drone_{n}/reception", Reception, live) for n in range(3)]
orders = [reader(f"/foxhunt/drone_{n}/order", Order, live) for n in range(3)]


def writer(topic, kind):
    return DataWriter(participant, Topic(participant, "rt" + topic, kind), qos=spoken)


speaker = writer("/foxhunt/drone_2/reception", Reception)
signed = [f"/foxhunt/drone_{n}/signed_{what}" for n in range(3) for what in ("report", "order")]
texts = [reader(topic, String, live) for topic in signed] if SIGNED else []
forgers = [writer(topic, String) for topic in signed] if SIGNED else []
landers = [writer(f"/foxhunt/drone_{n}/order", Order) for n in range(3)] if SIGNED else []
recorded = [[] for _ in texts]


def intrude():
    """Has all drones land, and sends garbage and what was recorded."""
    stamp = Time(int(now()), 0)
    for lander in landers:
        lander.write(Order(
            header=Header(stamp=stamp), number=2**63, has_goal=False, goal=Point(), land=True, turn=0,
            beacons=[], taken_beacons=[], taken_sec=[], taken_nanosec=[], take_off=False, leave=2,
            echo_sec=[], echo_nanosec=[]))
    for n, forger in enumerate(forgers):
        # On its own channel, on another one, and what nobody has sent.
        for data in recorded[n] + recorded[n - 2] + ["garbage", "x" * 200_000]:
            forger.write(String(data))


observed = {"estimates": 0, "last_estimate": None, "diagnostics": 0, "paths": 0}
received, taken = set(), set()
own, own_taken, place = None, False, None
stop, intruded = False, False


def on_stop(*_):
    global stop
    stop = True


signal.signal(signal.SIGTERM, on_stop)
while not stop:
    for estimate in estimates.take(N=100):
        at = estimate.pose.pose.position
        assert estimate.header.frame_id == "map" and estimate.pose.covariance[0] > 0, estimate
        observed["estimates"] += 1
        observed["last_estimate"] = [at.x, at.y]
    for message in diagnostics.take(N=100):
        assert any(status.name == "foxhunt: fusion" for status in message.status), message
        observed["diagnostics"] += 1
    for path in paths.take(N=100):
        observed["paths"] += bool(path.poses)
    for pose in poses.take(N=100):
        place = pose.pose.position
    for drone, listener in enumerate(receptions):
        for reception in listener.take(N=100):
            if reception.heard:
                stamp = reception.header.stamp
                received.add((drone, reception.beacon, micros(stamp.sec, stamp.nanosec)))
    for drone, listener in enumerate(orders):
        for order in listener.take(N=100):
            for beacon, sec, nanosec in zip(
                    order.taken_beacons, order.taken_sec, order.taken_nanosec):
                taken.add((drone, beacon, micros(sec, nanosec)))
    if own is None and observed["estimates"] >= 5 and place is not None:
        at = now()
        east, north = (-10.0 - place.x), (-10.0 - place.y)
        own = Reception(
            header=Header(stamp=Time(int(at), int((at % 1) * 1e9))), beacon=0, heard=True, reason="",
            position=place, heading=0.0, pitch=0.0, roll=0.0, position_sigma=[1.0, 1.0, 2.0],
            rss_dbm=LEVEL_DBM, rss_sigma_db=8.0, has_bearing=True,
            bearing=math.atan2(north, east), bearing_sigma=0.5, bearing_confidence=0.5,
            covariance=0.0, mode_weights=[], mode_bearings=[], mode_sigmas=[], velocity=[],
            quantity_names=[], quantity_values=[], quantity_sigmas=[])
    if not intruded:
        for text, kept in zip(texts, recorded):
            kept.extend(message.data for message in text.take(N=100))
            del kept[:-20]
    if SIGNED and own is not None and not intruded and all(recorded):
        intruded = True
        intrude()
    if own is not None and not own_taken:
        stamp = own.header.stamp
        own_taken = (2, 0, micros(stamp.sec, stamp.nanosec)) in taken
        speaker.write(own)
    time.sleep(0.05)
if own is not None:
    # Once more, though it was taken in.
    speaker.write(own)
observed["intruded"] = intruded
observed["received"], observed["taken"] = sorted(received), sorted(taken)
print(json.dumps(observed))
