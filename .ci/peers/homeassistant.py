"""Takes the places of a hunt from mosquitto with paho-mqtt: homeassistant.py FOXHUNT

Each device tracker is held against the rules that Home Assistant's MQTT integration has for discovery topics,
configurations and attributes (homeassistant/components/mqtt: discovery.py, device_tracker.py, entity.py, schemas.py).
"""

import json
import math
import os
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time

import paho.mqtt.client as mqtt

foxhunt = sys.argv[1]
folder = pathlib.Path(tempfile.mkdtemp(prefix="foxhunt-homeassistant-"))
mosquitto = shutil.which("mosquitto", path="/usr/sbin:/usr/bin:/usr/local/sbin")
with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    port = free.getsockname()[1]
running = []
NAMES = ["Fuchs 1", "Füchsin+#/1", "狐", "狐"]
DISCOVERY = re.compile(r"homeassistant/device_tracker/([a-zA-Z0-9_-]+)/config")
# What the integration takes out of the attributes, so that nobody would see it.
BLOCKED = {"available", "device_class", "device_info", "entity_category", "entity_picture", "icon", "name", "state",
           "supported_features", "unique_id", "unit_of_measurement"}
DEPRECATED = {"state_topic", "value_template", "payload_home", "payload_not_home", "payload_reset", "object_id"}


def start(*command, **more):
    with open(folder / "stderr.txt", "a") as stderr:
        running.append(subprocess.Popen([str(part) for part in command], stderr=stderr, stdin=subprocess.DEVNULL,
                                        stdout=subprocess.DEVNULL, **more))
    return running[-1]


def broker():
    started = start(mosquitto, "-c", folder / "mosquitto.conf")
    while True:
        try:
            socket.create_connection(("127.0.0.1", port), 1).close()
            return started
        except OSError:
            assert started.poll() is None, (folder / "stderr.txt").read_text()
            time.sleep(0.1)


class Listener:
    """A client that sees what is kept for late ones, and all that comes."""

    def __init__(self):
        self.last, self.count = {}, {}
        self.client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        self.client.username_pw_set("fox", "hound")
        self.client.on_connect = lambda client, *_: client.subscribe("#", qos=1)
        self.client.on_message = self.take
        self.client.connect("127.0.0.1", port)
        self.client.loop_start()

    def take(self, _client, _data, message):
        self.last[message.topic] = message.payload.decode()
        self.count[message.topic] = self.count.get(message.topic, 0) + 1

    def wait(self, what, met, limit_s=120):
        end = time.monotonic() + limit_s
        while not met():
            assert time.monotonic() < end, f"{what} did not come: {self.last} {(folder / 'stderr.txt').read_text()}"
            time.sleep(0.1)


def trackers(listener):
    """Each thing by its kind and name, after its configuration was checked."""
    found, ids = {}, set()
    for topic, text in list(listener.last.items()):
        if not topic.startswith("homeassistant/"):
            continue
        config = json.loads(text)
        assert DISCOVERY.fullmatch(topic), topic
        assert config["unique_id"] not in ids, config
        ids.add(config["unique_id"])
        assert not DEPRECATED & set(config), config
        assert config["source_type"] == "gps" and isinstance(config["name"], str)
        assert config["unique_id"] == topic.split("/")[2], config
        assert config["device"]["identifiers"] == ["__".join(config["unique_id"].split("__")[:2])], config
        assert set(config["device"]) <= {"identifiers", "name", "manufacturer", "model", "sw_version"}
        assert set(config["origin"]) <= {"name", "sw_version", "support_url"} and config["origin"]["name"]
        place_topic = config["json_attributes_topic"]
        assert not re.search(r"[+#\s\0]", place_topic), place_topic
        place = listener.last.get(place_topic)
        if place is None:
            continue  # on its way
        place = json.loads(place)
        assert not BLOCKED & set(place), place
        for name, most in (("latitude", 90), ("longitude", 180)):
            assert type(place[name]) is float and abs(place[name]) < most, place
        assert math.isfinite(place.get("gps_accuracy", 0)), place
        kind = "beacon" if "beacon" in place else "receiver"
        assert ("availability_topic" in config) == (kind == "receiver"), config
        if kind == "beacon":
            assert place["gps_accuracy"] == place["semi_major_95_m"] > 0, place
        found.setdefault((kind, place[kind]), []).append((place_topic, place))
    return found


def hunt(name, pace):
    return start(foxhunt, "hunt", folder / "foxes.toml", "--pace", pace, "--out", folder / name, "--mqtt",
                 f"127.0.0.1:{port}", "--mqtt-user", "fox", "--origin", "50.0755,14.4378",
                 env=os.environ | {"FOXHUNT_MQTT_PASSWORD": "hound"})


def all_beacons(listener):
    found = trackers(listener)
    return all(len(found.get(("beacon", name), [])) == NAMES.count(name) for name in NAMES)


def judge():
    password = folder / "passwords"
    subprocess.run([shutil.which("mosquitto_passwd", path="/usr/bin:/usr/local/bin"), "-b", "-c", password, "fox",
                    "hound"], check=True)
    password.chmod(0o644)
    folder.chmod(0o755)
    (folder / "mosquitto.conf").write_text(f"listener {port} 127.0.0.1\nallow_anonymous false\n"
                                           f"password_file {password}\npersistence false\n")
    scenario = pathlib.Path("hunt/scenarios/three-beacons.toml").read_text()
    beacons = ", ".join(f'{{ name = "{name}", east_m = {20 + 15 * index}.0, north_m = {30 - 20 * index}.0 }}'
                        for index, name in enumerate(NAMES))
    scenario, count = re.subn(r"beacons = \[.*?\n\]", f"beacons = [{beacons}]", scenario, flags=re.S)
    assert count == 1, scenario
    (folder / "foxes.toml").write_text(scenario)

    serving = broker()
    listener = Listener()
    hunting = hunt("one", 20)
    availability = "foxhunt/three-beacons/availability"
    listener.wait("a beacon", lambda: any(kind == "beacon" for kind, _ in trackers(listener)))
    assert listener.last[availability] == "online"
    serving.kill()
    serving.wait()
    listener.client.loop_stop()
    time.sleep(1)
    serving = broker()
    # This one has nothing but what the hunt sends again.
    listener = Listener()
    begun = time.monotonic()
    listener.wait("the hunt again", lambda: listener.last.get(availability) == "online")
    listener.wait("all beacons", lambda: all_beacons(listener))
    assert hunting.wait(300) == 0, (folder / "stderr.txt").read_text()
    elapsed_s = time.monotonic() - begun
    listener.wait("the end", lambda: listener.last[availability] == "offline")
    most = max(listener.count.values())
    assert most <= elapsed_s + 3, f"{most} messages of a topic in {elapsed_s:.0f} s"
    late = Listener()
    late.wait("what was kept", lambda: late.last == listener.last)
    fixes = trackers(late)
    # The log of a hunt tells beacons of one name apart by their order alone, and has the outcome of the last.
    for name in NAMES:
        assert any(place["outcome"] for _, place in fixes["beacon", name]), fixes
    sent = sum(listener.count.values())

    hunting = hunt("two", 5)
    listener.wait("the next hunt", lambda: listener.last[availability] == "online")
    hunting.kill()
    listener.wait("the will", lambda: listener.last[availability] == "offline", 30)
    remarks = (folder / "stderr.txt").read_text().count("it is tried again")
    assert remarks == 1, f"{remarks} remarks about one lost broker"

    before = set(listener.last)
    subprocess.run([foxhunt, "locate", "docs/walk.csv", "--mqtt", f"127.0.0.1:{port}", "--mqtt-user", "fox"],
                   check=True, stdout=subprocess.DEVNULL, env=os.environ | {"FOXHUNT_MQTT_PASSWORD": "hound"})
    listener.wait("the place of a recording", lambda: len(set(listener.last) - before) == 3)
    assert not any("/receiver/" in topic for topic in set(listener.last) - before)
    print(f"homeassistant: {len(fixes)} names as device trackers, {sent} messages in {elapsed_s:.0f} s, {most} at most "
          f"of one topic; the broker killed and begun anew; the will of a killed hunt; a recording")


try:
    judge()
finally:
    for process in running:
        if process.poll() is None:
            process.kill()
