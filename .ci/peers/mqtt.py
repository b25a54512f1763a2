"""Flies a scenario with three drone nodes, a fusion node and mosquitto, all of them programs.

mqtt.py FOXHUNT [SCENARIO]: the devices are emulated, in real time, behind pseudo-terminals and UDP
ports. A drone's node, the fusion node and the broker are killed with SIGKILL and started again.
Strangers without the key publish garbage, long messages and what they have recorded.
"""

import json
import os
import pathlib
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time

foxhunt = sys.argv[1]
scenario = sys.argv[2] if len(sys.argv) > 2 else "pritzl-6.1"
folder = pathlib.Path(tempfile.mkdtemp(prefix="foxhunt-mqtt-"))
log, flight, key = folder / "hunt.jsonl", folder / "field.toml", folder / "team.key"
running = []
with socket.socket() as free:
    free.bind(("127.0.0.1", 0))
    port = str(free.getsockname()[1])
shared = ["--over", "mqtt", "--broker", f"127.0.0.1:{port}"]


def start(name, *command, **more):
    stderr = open(folder / f"{name}.txt", "a")
    process = subprocess.Popen([str(part) for part in command], stderr=stderr,
                               stdin=subprocess.DEVNULL, **more)
    process.begun, process.most_mb = time.monotonic(), 0.0
    running.append(process)
    return process


def broker():
    (folder / "mosquitto.conf").write_text(f"listener {port} 127.0.0.1\nallow_anonymous true\n")
    program = shutil.which("mosquitto", path="/usr/sbin:/usr/bin:/usr/local/sbin")
    return start("broker", program, "-c", folder / "mosquitto.conf")


def drone(number, *more, key=key):
    with_key = ["--key", key] if key else ["--unsigned"]
    return start(f"drone_{number}", foxhunt, "node", "drone", flight, "--drone", number, *shared,
                 *with_key, *more)


def fusion():
    return start("fusion", foxhunt, "--json", "node", "fusion", flight, "--yes", "--log", log,
                 "--resume", *shared, "--key", key, stdout=subprocess.PIPE, text=True)


def publish(topic, payload):
    subprocess.run(["mosquitto_pub", "-h", "127.0.0.1", "-p", port, "-t", topic, "-s"],
                   input=payload, check=False, stderr=subprocess.DEVNULL)


def strangers(recorded):
    """Publishes garbage, what is too long, and what was recorded, on every channel."""
    for number in range(3):
        for what in ("report", "order"):
            for payload in (b"garbage", b"foxhunt1 0 0 0 unsigned\n{}", b"x" * 200_000):
                publish(f"foxhunt/drone_{number}/{what}", payload)
    for line in recorded.read_text().splitlines()[:60]:
        topic, payload = line.split(" ", 1)
        publish(topic, bytes.fromhex(payload))


def events(kind):
    found = []
    if log.exists():
        for line in log.read_text().splitlines():
            try:
                event = json.loads(line)
            except json.JSONDecodeError:
                continue  # being written
            if event.get("event") == kind:
                found.append(event)
    return found


def fail(reason):
    for text in sorted(folder.glob("*.txt")):
        print(f"--- {text.name}\n" + "\n".join(text.read_text().splitlines()[-15:]), file=sys.stderr)
    raise SystemExit(f"mqtt: {reason}; see {folder}")


def wait_for(what, met, fusing, limit_s=900):
    end = time.monotonic() + limit_s
    while not met():
        if fusing.poll() is not None:
            fail(f"the fusion node ended with {fusing.returncode} while waiting for {what}")
        if time.monotonic() > end:
            fail(f"{what} did not come in {limit_s} s")
        time.sleep(0.2)


def received():
    return len(events("received"))


def hunt():
    subprocess.run([foxhunt, "node", "key", key], check=True, stdout=subprocess.DEVNULL)
    assert key.stat().st_mode & 0o777 == 0o600, "others may read the key"
    serving = broker()
    start("field", foxhunt, "emulate", "field", "--scenario", scenario, "--config", flight,
          stdout=subprocess.DEVNULL)
    while not flight.exists():
        time.sleep(0.1)
    recorded = folder / "recorded"
    recorder = start("recorder", "mosquitto_sub", "-h", "127.0.0.1", "-p", port, "-t",
                     "foxhunt/+/report", "-t", "foxhunt/+/order", "-F", "%t %x",
                     stdout=open(recorded, "w"))
    fusing = fusion()
    drones = [drone(number) for number in range(3)]
    wait_for("3 receptions", lambda: received() >= 3, fusing)
    strangers(recorded)
    drones[1].kill()
    drones[1].wait()
    time.sleep(1)
    drones[1] = drone(1, "--take-over")
    before = received()
    wait_for("the drone that began anew",
             lambda: any(e["drone"] == 1 for e in events("received")[before:]), fusing)
    serving.kill()
    serving.wait()
    time.sleep(3)
    serving = broker()
    before = received()
    wait_for("receptions over the new broker", lambda: received() > before, fusing)
    fusing.kill()
    fusing.wait()
    before = received()
    time.sleep(2)
    fusing = fusion()
    strangers(recorded)
    wait_for("the hunt to go on", lambda: received() > before, fusing)
    try:
        out, _ = fusing.communicate(timeout=2400)
    except subprocess.TimeoutExpired:
        fail("the hunt does not end")
    if fusing.returncode != 0:
        fail(f"the fusion node ended with {fusing.returncode}")
    recorder.kill()
    for number, process in enumerate(drones):
        code, usage = ended(process)
        if code != 0:
            fail(f"the node of drone {number} ended with {code}")
        elapsed_s = time.monotonic() - process.begun
        share = 100 * (usage.ru_utime + usage.ru_stime) / elapsed_s
        print(f"the node of drone {number}: {share:.1f} % of a core over {elapsed_s:.0f} s, "
              f"{process.most_mb:.1f} MB at most")
    return json.loads(out)


def watch_memory():
    """Notes the most memory of each process; the kernel's ru_maxrss counts that of Python before it, too."""
    while True:
        for process in list(running):
            try:
                status = pathlib.Path(f"/proc/{process.pid}/status").read_text()
            except OSError:
                continue
            # One that has ended has none.
            for line in status.splitlines():
                if line.startswith("VmHWM:"):
                    process.most_mb = int(line.split()[1]) / 1024
        time.sleep(0.5)


def ended(process, limit_s=120):
    """The exit code of a process, and what it has used."""
    end = time.monotonic() + limit_s
    while time.monotonic() < end:
        pid, status, usage = os.wait4(process.pid, os.WNOHANG)
        if pid:
            process.returncode = os.waitstatus_to_exitcode(status)
            return process.returncode, usage
        time.sleep(0.2)
    fail(f"a node does not end in {limit_s} s")


def name(event):
    return event["drone"], event["reception"]["beacon"], event["reception"]["time"]


def judge(report):
    logged = [name(event) for event in events("received")]
    if len(set(logged)) != len(logged):
        fail("a reception was counted twice")
    refused = " ".join(event["reason"] for event in events("device_failed"))
    for why in ("no message of a foxhunt node", "too long for a message"):
        if why not in refused:
            fail(f"the log does not name what was {why!r}")
    replay = subprocess.run([foxhunt, "--json", "replay", str(log)], check=True, capture_output=True,
                            text=True)
    replay = json.loads(replay.stdout)
    if replay["compared"] < 10 or replay["compared"] != replay["identical"]:
        fail(f"{replay['identical']} of {replay['compared']} estimates are the same")
    fixes = {fix["name"]: fix["estimate"]["mean"] for fix in report["fixes"]}
    truth = subprocess.run([foxhunt, "--json", "fly", "--emulate", scenario, "--out",
                            str(folder / "one")], check=True, capture_output=True, text=True,
                           stdin=subprocess.DEVNULL)
    for one in json.loads(truth.stdout)["beacons"]:
        beacon = next(b for b in replay["beacons"] if b["name"] == one["name"])
        if beacon["estimate"] != beacon["logged_estimate"]:
            fail(f"one process finds {one['name']} elsewhere")
        east, north = fixes[one["name"]]
        error = ((east - one["truth"]["east_m"])**2 + (north - one["truth"]["north_m"])**2)**0.5
        print(f"{one['name']}: {error:.2f} m off, {beacon['steps']} receptions, the same to the bit "
              f"in one process; {one['truth']['error_m']:.2f} m off from one computer")
        if error > 15:
            fail(f"{one['name']} is {error:.2f} m off")
    offsets = [(e["drone"], round(e["offset_s"], 3)) for e in events("clock_offset")]
    print(f"mqtt: {len(logged)} receptions of three drones, none twice; the node of drone 1, the "
          f"fusion node and the broker killed and begun anew ({len(events('resumed'))} times from "
          f"the log); {replay['identical']} of {replay['compared']} estimates identical; clock "
          f"offsets {offsets}; strangers refused")


threading.Thread(target=watch_memory, daemon=True).start()
try:
    judge(hunt())
finally:
    for process in running:
        if process.poll() is None:
            process.kill()
