"""Three emulated drones fly through one MAVProxy, which our driver reaches at one endpoint; when each
has been heard from twice the flight is broken off, and all come home."""

import collections
import json
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time

FOXHUNT, MAVPROXY = sys.argv[1:]
LONGEST_S = 240.0

folder = pathlib.Path(tempfile.mkdtemp())
with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
    free.bind(("127.0.0.1", 0))
    port = free.getsockname()[1]
field = folder / "field.toml"
programs = [subprocess.Popen(
    [FOXHUNT, "emulate", "field", "--scenario", "pritzl-6.1", "--config", field], cwd=folder,
    stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)]


def events():
    log = folder / "out" / "fly-1.jsonl"
    lines = log.read_text().splitlines(keepends=True) if log.exists() else []
    return [json.loads(line) for line in lines if line.endswith("\n")]


def by_drone(kind):
    return collections.Counter(e["drone"] for e in events() if e.get("event") == kind)


try:
    while not field.exists():
        time.sleep(0.1)
    time.sleep(0.5)
    text = field.read_text()
    masters = sorted(set(re.findall(r"udpin:127\.0\.0\.1:\d+", text)))
    assert len(masters) == 3, masters
    field.write_text(re.sub(r"udpin:127\.0\.0\.1:\d+", f"udpin:127.0.0.1:{port}", text))
    programs.append(subprocess.Popen(
        [sys.executable, MAVPROXY, *[f"--master={m}" for m in masters], f"--out=udpout:127.0.0.1:{port}",
         "--non-interactive", "--nowait", f"--state-basedir={folder}", "--default-modules="],
        cwd=folder, stdin=subprocess.DEVNULL, stdout=open(folder / "router.txt", "w"), stderr=subprocess.STDOUT))
    flight = subprocess.Popen(
        [FOXHUNT, "--json", "fly", field, "--yes", "--out", folder / "out"], stdin=subprocess.DEVNULL,
        stdout=open(folder / "result.json", "w"), stderr=open(folder / "messages.txt", "w"))
    programs.append(flight)
    begun = time.monotonic()
    broken_off = False
    while flight.poll() is None and time.monotonic() - begun < LONGEST_S:
        time.sleep(0.5)
        heard = by_drone("received")
        if not broken_off and len(heard) == 3 and min(heard.values()) >= 2:
            broken_off = True
            flight.send_signal(signal.SIGINT)
    messages = (folder / "messages.txt").read_text()
    assert broken_off, f"not all were heard: {by_drone('received')}\n{messages}"
    assert flight.poll() is not None, f"they did not come home\n{messages}"
finally:
    for program in programs:
        program.kill()

sent, failed = by_drone("sent"), by_drone("device_failed")
assert set(sent) == {0, 1, 2} and not failed, (sent, failed)
# Each flew by its own orders, and is down again.
last = {}
places = collections.defaultdict(list)
for event in events():
    if event.get("event") == "aircraft":
        last[event["drone"]] = event
    if event.get("event") == "received":
        places[event["drone"]].append(tuple(round(x) for x in event["reception"]["receiver"]["position"][:2]))
assert all(not e["airborne"] and not e["armed"] for e in last.values()), last
assert len({place for own in places.values() for place in own}) >= 4, places
assert all(f"system {n}" in messages for n in (1, 2, 3)), messages
print(f"three drones through one MAVProxy: heard {dict(by_drone('received'))}, sent {dict(sent)}, all down")
