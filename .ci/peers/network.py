"""Runs three drone nodes and a fusion node as programs, kills one of each, and judges the log.

network.py MIDDLEWARE FOXHUNT [signed] [PYTHON]: PYTHON runs the observer, peer_MIDDLEWARE.py beside this, which
receives the estimates, sends a reception, and prints what it received as one JSON value. Where the hunt is
signed the observer has no key: nothing that it sends may count, and no drone's node with a key of its own.
"""

import json
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

SPEED = 10
OWN_LEVEL_DBM = -61.0625  # the level of the observer's reception

here = pathlib.Path(__file__).parent
middleware, foxhunt, *more = sys.argv[1:]
signed = more[:1] == ["signed"]
python = (more[signed:] or [sys.executable])[0]
folder = pathlib.Path(tempfile.mkdtemp(prefix="foxhunt-network-"))
log = folder / "hunt.jsonl"
key, other_key = folder / "team.key", folder / "other.key"
for file in (key, other_key):
    subprocess.run([foxhunt, "node", "key", file], check=True, stdout=subprocess.DEVNULL)
common = ["--over", middleware, "--speed", str(SPEED)]
keyed = ["--key", key] if signed else ["--unsigned"]
running = []


def start(name, *command, **more):
    stderr = open(folder / f"{name}.txt", "a")
    process = subprocess.Popen([str(part) for part in command], stderr=stderr, **more)
    running.append(process)
    return process


def drone(number, *more, name="drone", keyed=keyed):
    return start(f"{name}_{number}", foxhunt, "node", "drone", "--simulate", folder / "field.toml",
                 "--drone", number, *common, *keyed, *more)


def fusion():
    return start("fusion", foxhunt, "--json", "node", "fusion", folder / "field.toml", "--log", log,
                 "--resume", *common, *keyed, stdout=subprocess.PIPE, text=True)


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
    raise SystemExit(f"{middleware}: {reason}; see {folder}")


def wait_for(what, met, fusing, limit_s=300):
    end = time.monotonic() + limit_s
    while not met():
        if fusing.poll() is not None:
            fail(f"the fusion node ended with {fusing.returncode} while waiting for {what}")
        if time.monotonic() > end:
            fail(f"{what} did not come in {limit_s} s")
        time.sleep(0.2)


def hunt():
    (folder / "field.toml").write_text(
        (here.parent.parent / "hunt" / "scenarios" / "pritzl-6.1.toml").read_text()
        # A computer that is busy for a moment is busy for long by a fast clock: 30 s on the wall.
        + "\n[hunt]\nshared_turns = true\nattendance = { lost_after_s = 300 }\n")
    observer = start("observer", python, here / f"peer_{middleware}.py", SPEED, OWN_LEVEL_DBM,
                     *["signed"] * signed, stdout=subprocess.PIPE, text=True)
    fusing = fusion()
    drones = [drone(0), drone(1), drone(2, "--drop", 0.2)]
    # ROS 1 ends the first of two nodes with one name, whoever they are.
    if signed and middleware != "ros1":
        drone(0, "--seed", 2, name="stranger", keyed=["--key", other_key])
    wait_for("8 receptions", lambda: len(events("received")) >= 8, fusing)
    drones[1].kill()
    drones[1].wait()
    time.sleep(1)
    drones[1] = drone(1)
    before = len(events("received"))
    wait_for("the drone that began anew",
             lambda: any(e["drone"] == 1 for e in events("received")[before:]), fusing)
    wait_for("12 more", lambda: len(events("received")) >= before + 12, fusing)
    fusing.kill()
    fusing.wait()
    killed_at = len(events("received"))
    time.sleep(1)
    fusing = fusion()
    wait_for("the hunt to go on", lambda: len(events("received")) > killed_at, fusing)
    try:
        out, _ = fusing.communicate(timeout=420)
    except subprocess.TimeoutExpired:
        fail("the hunt does not end")
    if fusing.returncode != 0:
        fail(f"the fusion node ended with {fusing.returncode}")
    observer.send_signal(signal.SIGTERM)
    observed, _ = observer.communicate(timeout=20)
    return json.loads(out), json.loads(observed)


def name(drone, reception, epoch):
    return drone, reception["beacon"], round((reception["time"] + epoch) * 1e6)


def judge(report, observed):
    header = json.loads(log.read_text().splitlines()[0])
    epoch = header["epoch_unix_s"]
    received = events("received")
    logged = [name(e["drone"], e["reception"], epoch) for e in received]
    if len(set(logged)) != len(logged):
        fail("a reception was counted twice")
    over = {e["fix"]["beacon"]: e["time"] for e in events("beacon_finished")}
    for drone, beacon, micros in map(tuple, observed["taken"]):
        useful = micros / 1e6 - epoch < over[beacon] - 30
        was_received = [drone, beacon, micros] in observed["received"]
        if was_received and useful and not any(
                (drone, beacon) == other[:2] and abs(micros - other[2]) < 2 for other in logged):
            fail(f"taken in and not in the log: {(drone, beacon, micros)}")
    own = [e for e in received if e["reception"]["rss_dbm"] == OWN_LEVEL_DBM]
    if len(own) != (0 if signed else 1):
        fail(f"the observer's reception is in the log {len(own)} times")
    if signed:
        refused = " ".join(event["reason"] for event in events("device_failed"))
        for why in ("no message of a foxhunt node", "too long for a message",
                    "not signed with the key of this node"):
            if why not in refused:
                fail(f"the log does not name what was {why!r}")
        if not observed["intruded"]:
            fail("the stranger has sent nothing")
    if observed["estimates"] < 10 or not observed["last_estimate"]:
        fail(f"the observer received {observed['estimates']} estimates")
    replay = subprocess.run([foxhunt, "--json", "replay", str(log)], check=True, capture_output=True,
                            text=True)
    replay = json.loads(replay.stdout)
    if replay["compared"] < 20 or replay["compared"] != replay["identical"]:
        fail(f"{replay['identical']} of {replay['compared']} estimates are the same")
    fixes = {fix["name"]: fix["estimate"]["mean"] for fix in report["fixes"]}
    for beacon in replay["beacons"]:
        one = beacon["estimate"]
        if beacon["estimate"] != beacon["logged_estimate"]:
            fail(f"one process finds {beacon['name']} elsewhere")
        if [one["east_m"], one["north_m"]] != fixes[beacon["name"]]:
            fail(f"the fusion node reported another fix of {beacon['name']}")
        print(f"{beacon['name']}: {beacon['steps']} receptions, {beacon['error_m']:.2f} m off, "
              "fusion node and one process the same to the bit")
    print(f"{middleware}: {len(logged)} receptions of three drones, none twice; drone 1 and the fusion "
          f"node killed and begun anew ({len(events('resumed'))} times from the log), 20 % of drone 2's "
          f"messages lost; {replay['identical']} of {replay['compared']} estimates identical; the "
          f"observer received {observed['estimates']} estimates, {observed['paths']} paths, "
          f"{observed['diagnostics']} diagnostics, "
          + ("signed: who lacks the key was refused" if signed else
             "and its reception was taken in once"))


try:
    judge(*hunt())
finally:
    for process in running:
        if process.poll() is None:
            process.kill()
