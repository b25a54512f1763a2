"""Observes a hunt with Debian's rospy, and sends a reception.

peer_ros1.py SPEED LEVEL_DBM [signed]; on SIGTERM prints what it received as JSON. The messages of foxhunt_msgs
are made from their files by genpy, with MD5 sums that rospy holds against ours. Where the hunt is signed it is a
stranger without the key, who also sends orders to land, garbage and what he has recorded.
"""

import json
import math
import pathlib
import signal
import sys
import threading
import time

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from genpy import Time
from genpy.dynamic import generate_dynamic
from geometry_msgs.msg import Point, PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import Path
from std_msgs.msg import Header, String

SPEED, LEVEL_DBM = float(sys.argv[1]), float(sys.argv[2])
SIGNED = sys.argv[3:] == ["signed"]
SEPARATOR = "=" * 80
messages = pathlib.Path(__file__).parent.parent.parent / "hardware/ros/foxhunt_msgs/msg"


def made(name):
    nested = {"std_msgs/Header": Header, "geometry_msgs/Point": Point}
    text = (messages / f"{name}.msg").read_text()
    for kind, message in nested.items():
        text += f"\n{SEPARATOR}\nMSG: {kind}\n{message._full_text}"
    return generate_dynamic(f"foxhunt_msgs/{name}", text)[f"foxhunt_msgs/{name}"]


Reception, Order = made("Reception"), made("Order")
lock = threading.Lock()
observed = {"estimates": 0, "last_estimate": None, "diagnostics": 0, "paths": 0}
received, taken = set(), set()
place, stop = None, False


def now():
    """UNIX time as all nodes of this speed have it."""
    base = math.floor(time.time() / 1048576) * 1048576
    return base + (time.time() - base) * SPEED


def micros(sec, nanosec):
    return round(sec * 1e6 + nanosec / 1e3)


def on_estimate(message):
    with lock:
        at = message.pose.pose.position
        assert message.header.frame_id == "map" and message.pose.covariance[0] > 0, message
        observed["estimates"] += 1
        observed["last_estimate"] = [at.x, at.y]


def on_diagnostics(message):
    with lock:
        assert any(status.name == "foxhunt: fusion" for status in message.status), message
        observed["diagnostics"] += 1


def on_path(message):
    with lock:
        observed["paths"] += bool(message.poses)


def on_pose(message):
    global place
    place = message.pose.position


def on_reception(message, drone):
    with lock:
        if message.heard:
            stamp = message.header.stamp
            received.add((drone, message.beacon, micros(stamp.secs, stamp.nsecs)))


def on_order(message, drone):
    with lock:
        for beacon, sec, nanosec in zip(
                message.taken_beacons, message.taken_sec, message.taken_nanosec):
            taken.add((drone, beacon, micros(sec, nanosec)))


def on_text(message, kept):
    with lock:
        if not intruded:
            kept.append(message.data)
            del kept[:-20]


def on_stop(*_):
    global stop
    stop = True


rospy.init_node("observer", disable_signals=True)
rospy.Subscriber("/foxhunt/beacon_0/estimate", PoseWithCovarianceStamped, on_estimate)
rospy.Subscriber("/diagnostics", DiagnosticArray, on_diagnostics)
rospy.Subscriber("/foxhunt/drone_0/path", Path, on_path)
rospy.Subscriber("/foxhunt/drone_2/pose", PoseStamped, on_pose)
for number in range(3):
    rospy.Subscriber(f"/foxhunt/drone_{number}/reception", Reception, on_reception, number)
    rospy.Subscriber(f"/foxhunt/drone_{number}/order", Order, on_order, number)
speaker = rospy.Publisher("/foxhunt/drone_2/reception", Reception, queue_size=10)
signed = [f"/foxhunt/drone_{n}/signed_{what}" for n in range(3) for what in ("report", "order")]
recorded = [[] for _ in signed] if SIGNED else []
intruded = False
for topic, kept in zip(signed, recorded):
    rospy.Subscriber(topic, String, on_text, kept)
forgers = [rospy.Publisher(topic, String, queue_size=100) for topic in signed] if SIGNED else []
landers = [rospy.Publisher(f"/foxhunt/drone_{n}/order", Order, queue_size=10)
           for n in range(3)] if SIGNED else []


def intrude():
    """Has all drones land, and sends garbage and what was recorded."""
    for lander in landers:
        lander.publish(Order(header=Header(stamp=Time(int(now()), 0), frame_id="map"), number=2**63,
                             land=True, leave=2))
    with lock:
        sent = [list(kept) for kept in recorded]
    for n, forger in enumerate(forgers):
        # On its own channel, on another one, and what nobody has sent.
        for data in sent[n] + sent[n - 2] + ["garbage", "x" * 200_000]:
            forger.publish(String(data))


signal.signal(signal.SIGTERM, on_stop)

own, own_taken = None, False
while not stop:
    with lock:
        ready = own is None and observed["estimates"] >= 5 and place is not None
    if ready:
        at = now()
        own = Reception(
            header=Header(stamp=Time(int(at), int((at % 1) * 1e9)), frame_id="map"), beacon=0,
            heard=True, position=place, position_sigma=[1.0, 1.0, 2.0], rss_dbm=LEVEL_DBM,
            rss_sigma_db=8.0, has_bearing=True, bearing=math.atan2(-10.0 - place.y, -10.0 - place.x),
            bearing_sigma=0.5, bearing_confidence=0.5)
    if SIGNED and own is not None and not intruded and all(recorded):
        with lock:
            intruded = True
        intrude()
    if own is not None and not own_taken:
        stamp = own.header.stamp
        with lock:
            own_taken = (2, 0, micros(stamp.secs, stamp.nsecs)) in taken
        speaker.publish(own)
    time.sleep(0.05)
if own is not None:
    # Once more, though it was taken in.
    speaker.publish(own)
with lock:
    observed["intruded"] = intruded
    observed["received"], observed["taken"] = sorted(received), sorted(taken)
    print(json.dumps(observed), flush=True)
