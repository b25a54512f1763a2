"""What happens on a field, on a strict ArduCopter and a strict PX4 of another program: pilots, lost links,
failsafes, other stations, places that jump, and the end of foxhunt itself. Each row is a flight with its
expected end. It is judged by what came to the autopilots, with the rules that every flight keeps:

- after its pilot has taken a drone, or while it flies by a rule of its own, no order reaches it;
- while it is not heard nothing is ordered, and after the limit no heartbeat is sent;
- it is armed once, and not after somebody else's motors;
- it flies within 0.3 m of the heights of its goals;
- the flight ends, and says in whose hands each drone is.

scenarios.py FOXHUNT [WORDS ...]: the rows whose names hold one of the words, or all. The rows and what became
of them are printed as a table. JOBS is the number of flights at once."""

import dataclasses
import json
import math
import multiprocessing
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

from strict_autopilot import LAT, LON, METRES, Autopilot, m

FOXHUNT = sys.argv[1] if len(sys.argv) > 1 else ""
JOBS = int(os.environ.get("JOBS", "3"))
STEP = 0.02
LINK_TIMEOUT = 3.5
# An order may have been sent when the heartbeat after a change was on its way, and machines are busy.
GRACE_S = 1.6
BOTH = ("ardupilot", "px4")
SHOWN = {
    "ardupilot": {"HAND": "STABILIZE"},
    "px4": {"HAND": "POSITION", "LOITER": "HOLD", "GUIDED": "OFFBOARD", "RTL": "RETURN"},
}
SCENARIO = """
name = "foreign vehicles"
description = "radios and motors of a simulated field on vehicles of another program"
estimator = "default"

[world]
beacons = [{{ name = "fox", east_m = 28.0, north_m = 22.0 }}]
drones = [{drones}]

[world.channel]
path_loss = {{ reference_dbm = -29.06, exponent = 2.765 }}
antenna = "reference-patch"
pattern_sigma_db = 2.0
sample_sigma_db = 2.0
bearing_sigma_deg = 10.0

[model]
reference_dbm = -29.06
exponent = 2.765

[source]
kind = "stepper"
positions = 16
samples_per_position = 1

[extractor]
kind = "pritzl2018"

[planner]
kind = "{planner}"
{places}
"""
ROUND = "places_m = [[14.0, 0.0], [14.0, 14.0], [-14.0, 14.0], [-14.0, 0.0]]\nup_m = 4.0\nrounds = 6"

FAR = "places_m = [[60.0, 0.0], [0.0, 0.0]]\nup_m = 4.0\nrounds = 6"


def free_ports(count):
    """Ports that nobody has at the moment."""
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


class Flight:
    """One flight of foxhunt with its autopilots, and what happens in it."""

    def __init__(self, row, kind):
        self.row, self.kind, self.ports = row, kind, free_ports(2 * row.drones)
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="foxhunt-scenario-"))
        self.phases, self.pending = {}, list(row.happenings)
        self.timers, self.processes, self.streams = [], [], []
        self.foxhunt, self.runs, self.stranger = None, 0, None
        self.nearest_m, self.late_s, self.faults = math.inf, 0.0, []
        parameters = row.parameters.get(kind, {})
        zeros = row.zeros if kind == "px4" else {}
        self.drones = [
            Strict(kind, number + 1, (12.0 * number, 0.0), *self.ports[2 * number : 2 * number + 2],
                   **zeros, **parameters)
            for number in range(row.drones)
        ]
        self.drone = self.drones[0]

    # What may happen.

    def begin(self, *arguments):
        """Starts foxhunt, or starts it anew."""
        self.runs += 1
        self.phases["begun"] = time.monotonic()
        self.foxhunt = subprocess.Popen(
            [FOXHUNT, "fly", self.folder / "field.toml", "--yes", "--out", self.folder / f"out-{self.runs}",
             *arguments],
            env=os.environ | {"COLUMNS": "1000"}, stdin=subprocess.PIPE, stdout=open(self.folder / "result.txt", "a"),
            stderr=open(self.folder / "messages.txt", "a"),
        )
        self.processes.append(self.foxhunt)

    def signal(self, number):
        if self.foxhunt.poll() is None:
            self.foxhunt.send_signal(number)

    def type(self, words):
        self.foxhunt.stdin.write(f"{words}\n".encode())
        self.foxhunt.stdin.flush()

    def later(self, seconds, what):
        self.timers.append((time.monotonic() + seconds, what))

    def stream(self, seconds, message):
        """Another station sends a message at 5 Hz."""
        self.streams.append([time.monotonic() + seconds, 0.0, message])

    # How it goes.

    def field(self):
        places = ", ".join(f"{{ east_m = {d.home[0]}, north_m = {d.home[1]}, up_m = 4.0 }}" for d in self.drones)
        one = self.row.drones == 1 and not self.row.follows
        (self.folder / "scenario.toml").write_text(SCENARIO.format(
            drones=places, planner="waypoints" if one else "follow-estimate", places=self.row.places if one else ""))
        vehicles = "".join(
            f'[[vehicles]]\nflown = "udpin:127.0.0.1:{self.ports[2 * n]}"\n'
            f'pose = "udpin:127.0.0.1:{self.ports[2 * n + 1]}"\nsystem_id = {n + 1}\n'
            for n in range(self.row.drones)
        )
        (self.folder / "foreign.toml").write_text(f"site = {{ lat_deg = {LAT}, lon_deg = {LON} }}\n{vehicles}")
        self.processes.append(subprocess.Popen(
            [FOXHUNT, "emulate", "field", "--scenario", self.folder / "scenario.toml", "--faults",
             self.folder / "foreign.toml", "--config", self.folder / "field.toml"],
            stdout=subprocess.DEVNULL, stderr=open(self.folder / "field.txt", "w"),
        ))

    def configure(self):
        file = self.folder / "field.toml"
        text = file.read_text()
        for name, value in ({"climb_timeout_s": 25.0, "ready_timeout_s": 60.0} | self.row.settings).items():
            if name in ("cruise_speed_mps", "ground_system_id"):
                text = re.sub(rf"^{name} = .*\n", "", text, flags=re.M)
                text = text.replace("[drones.vehicle.settings]\n", f"[drones.vehicle.settings]\n{name} = {value}\n")
                continue
            text, count = re.subn(rf"^{name} = .*$", f"{name} = {value}", text, flags=re.M)
            assert count, f"{name} is not in\n{text}"
        file.write_text(text)

    def notice(self, now):
        """The phases of the flight, which happenings count from."""
        drone = self.drone
        reached = {
            "asked": any(order.what == "mode" for order in drone.orders),
            "armed": drone.armed,
            "climb": drone.armed and drone.place[2] > 1.0,
            "hunt": drone.is_in("GUIDED") and drone.positioned and drone.place[2] > 3.3,
            "away": drone.is_in("GUIDED") and drone.airborne() and drone.positioned
            and math.dist(drone.place[:2], drone.home) > 3.0,
            "home": drone.airborne() and (drone.is_in("RTL") or drone.is_in("LAND")),
        }
        for name, holds in reached.items():
            if holds:
                self.phases.setdefault(name, now)
        for happening in list(self.pending):
            phase, seconds, what = happening
            if phase in self.phases and now - self.phases[phase] >= seconds:
                self.pending.remove(happening)
                what(self)
        for timer in [timer for timer in self.timers if timer[0] <= now]:
            self.timers.remove(timer)
            timer[1](self)
        for stream in self.streams:
            if now < stream[0] and now - stream[1] >= 0.2:
                stream[1] = now
                for message in stream[2](self.drone):
                    self.drone.hear(254, message)
        if self.stranger is not None:
            self.stranger.step(now)

    def is_over(self, now):
        if self.runs == 0 or self.foxhunt.poll() is None or self.timers:
            return False
        if any(phase in self.phases for phase, *_ in self.pending):
            return False
        self.phases.setdefault("over", now)
        since = now - self.phases["over"]
        down = not any(drone.armed for drone in self.drones)
        waits = 1.5 if self.row.expected[self.kind][0] in ("left", "flies on") else 45.0
        return since > waits or (down and since > 1.5)

    def fly(self):
        begun = last = time.monotonic()
        self.field()
        try:
            while True:
                now = time.monotonic()
                self.late_s = max(self.late_s, now - last - STEP)
                dt, last = min(max(now - last, 0.001), 0.5), now
                for drone in self.drones:
                    drone.step(dt)
                up = [drone.place for drone in self.drones if drone.airborne()]
                for one in range(len(up)):
                    for other in up[:one]:
                        self.nearest_m = min(self.nearest_m, math.dist(up[one], other))
                written = (self.folder / "field.toml").exists()
                if self.processes[0].poll() is not None:
                    raise RuntimeError(f"there is no field: {(self.folder / 'field.txt').read_text()}")
                if self.runs == 0 and written and now - begun > 3.0:
                    self.configure()
                    self.begin(*self.row.arguments)
                self.notice(now)
                if self.is_over(now):
                    break
                if now - begun > self.row.over_s + 100.0:
                    self.faults.append("the flight does not end")
                    break
                time.sleep(max(0.0, STEP - (time.monotonic() - now)))
        finally:
            for process in self.processes:
                if process.poll() is None:
                    process.kill()
                process.wait()
        return self.judge()

    # What became of it.

    def words(self):
        file = self.folder / "messages.txt"
        return file.read_text() if file.exists() else ""

    def events(self):
        for log in sorted(self.folder.glob("out-*/fly-1.jsonl")):
            for line in log.read_text().splitlines():
                try:
                    yield json.loads(line)
                except json.JSONDecodeError:
                    continue

    def shown(self, mode):
        return SHOWN[self.kind].get(mode, mode)

    def failsafe_after(self):
        """Seconds from the last heartbeat or set-point to its failsafe for that."""
        drone = self.drone
        if not drone.acted:
            return math.inf
        at, what = drone.acted[0][0], "beat" if drone.ardupilot else "goal"
        return at - max((o.at for o in drone.orders if o.what == what and o.at < at), default=-math.inf)

    def judge(self):
        words, faults = self.words(), self.faults
        if any(phase not in self.phases for phase, *_ in self.pending):
            faults.append(f"never came about: {[phase for phase, *_ in self.pending]}")
        for drone in self.drones:
            faults += [f"drone-{drone.system}: {fault}" for fault in drone.faults()]
        drone = self.drone
        mode, up = self.shown(drone.name_of(drone.mode)), drone.place[2]
        end, *named = self.row.expected[self.kind]
        down = [not drone.armed and drone.place[2] < 0.3 for drone in self.drones]
        ordered = any(order.what == "mode" and order.value in ("RTL", "LAND") for order in drone.orders)
        holds = {
            "home": all(down) and ordered,
            "down": all(down),
            "failsafe": all(down) and not ordered and bool(drone.failsafes),
            "stays": all(down) and "it stays down until" in words,
            "refused": not any(drone.armings for drone in self.drones) and self.foxhunt.returncode != 0,
            "left": up > 1.0 and mode == (named or [""])[0] and "drone-1 is left to" in words,
            "flies on": up > 1.0 and mode == (named or [""])[0],
        }[end]
        if not holds:
            home = "ordered home" if ordered else "not ordered home"
            faults.append(f"expected {' '.join([end, *named])}, and it is {up:.1f} m up in {mode}, {home}")
        for wanted in self.row.words:
            if not re.search(wanted, words):
                faults.append(f"not said: {wanted}")
        for unwanted in (*self.row.silent_on, "panicked"):
            if found := re.search(unwanted, words):
                faults.append(f"said: {found[0]}")
        for check in self.row.checks:
            faults += [fault for fault in [check(self)] if fault]
        whose = "another station" if "is left to another station" in words else "its pilot"
        happened = {
            "home": "home", "down": "down", "stays": "stays down", "refused": "refused",
            "failsafe": f"failsafe after {self.failsafe_after():.1f} s", "flies on": f"stays in {mode}",
            "left": f"{whose} has it in {mode}",
        }[end]
        if not holds:
            happened = f"{'down' if all(down) else f'{up:.0f} m up'} in {mode}"
        result = {
            "expected": " ".join([end, *named]), "happened": happened, "faults": faults,
            "folder": f"{self.folder} (at most {self.late_s:.1f} s late)",
        }
        if faults:
            orders = "\n".join(f"drone-{d.system}: {d.story()}" for d in self.drones)
            (self.folder / "orders.txt").write_text(orders)
        else:
            shutil.rmtree(self.folder, ignore_errors=True)
        return result


class Strict(Autopilot):
    """An autopilot that judges what reaches it."""

    def __init__(self, *arguments, **more):
        super().__init__(*arguments, **more)
        self.silences, self.late_by = [], 0.0

    def lose(self, unheard, deaf):
        """Loses what it sends, and what is sent to it."""
        if unheard and not self.unheard:
            self.silences.append([self.now, math.inf])
        if self.unheard and not unheard:
            self.silences[-1][1] = self.now
        self.unheard, self.deaf = unheard, deaf

    def taken(self):
        """Times in which somebody else has it: its pilot until he gives it back, or a rule of its own."""
        changes = [(at, name, True) for at, name in self.pilots]
        changes += [(at, name, False) for at, name in self.acted if name in ("RTL", "LAND")]
        spans, since = [], None
        for at, name, by_pilot in sorted(changes):
            if since is None:
                # GUIDED straight out of a return that foxhunt ordered is a mode that he has chosen.
                since = at
            elif by_pilot and name == "GUIDED" and self.ardupilot:
                spans.append((since, at))
                since = None
        return spans if since is None else [*spans, (since, math.inf)]

    def faults(self):
        grace = GRACE_S + 2.0 * self.late_by
        orders = [order for order in self.orders if order.what != "beat"]
        # Set-points go on until a silence has passed the limit, which is judged below.
        unknown = [(since, until + grace) for since, until in self.silences]
        known = [o for o in orders if o.what != "goal" or not any(a < o.at < b for a, b in unknown)]
        for since, until in self.taken():
            late = [order for order in known if since + grace < order.at < until]
            if late:
                yield f"{len(late)} orders while somebody else had it, the first {late[0]}, taken at {since:.1f}"
        for since, until in self.silences:
            # Its last messages may still be under way.
            blind = [o for o in orders if o.what != "goal" and since + 0.8 + self.late_by < o.at < until]
            limit = since + LINK_TIMEOUT + self.late_by
            goals = [o for o in orders if o.what == "goal" and limit + 0.7 < o.at < until]
            beats = [o for o in self.orders if o.what == "beat" and limit + 1.3 < o.at < until]
            if blind or goals or beats:
                yield f"not heard from {since:.1f} on: orders {blind[:3]}, goals {goals[:2]}, heartbeats {beats[:2]}"
        own = [at for at, sender in self.armings if sender != 254]
        if len(own) > 1:
            yield f"armed {len(own)} times"
        if self.worst_up > 0.3 and not self.misreads:
            yield f"{self.worst_up:.2f} m from the height of a goal"
        if self.disturbed:
            yield f"{self.disturbed} datagrams came to its telemetry"

    def story(self):
        told, last = [], None
        for order in self.orders:
            if order.what == "beat" or (order.what, order.value) == last:
                continue
            last = (order.what, order.value)
            told.append(str(order))
        return (f"{told}\npilot {self.pilots}\nfailsafes {self.failsafes} {self.acted}\narmed {self.armings}\n"
                f"silences {self.silences}\nrefused {self.refused}\nlast heartbeat "
                f"{max((o.at for o in self.orders if o.what == 'beat'), default=0.0):.1f}, now {self.now:.1f}")


class Stranger:
    """Somebody who sends heartbeats with the drone's number to foxhunt's port, and counts what comes back."""

    def __init__(self, flight, mode):
        self.link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.link.setblocking(False)
        self.to, self.at, self.received = ("127.0.0.1", flight.ports[0]), -math.inf, 0
        drone = flight.drone
        firmware = m.MAV_AUTOPILOT_ARDUPILOTMEGA if drone.ardupilot else m.MAV_AUTOPILOT_PX4
        base = m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | m.MAV_MODE_FLAG_SAFETY_ARMED
        self.beat = m.MAVLink_heartbeat_message(
            m.MAV_TYPE_QUADROTOR, firmware, base, drone.modes[mode], m.MAV_STATE_ACTIVE, 3)
        self.mav = m.MAVLink(self, 1, 1)

    def write(self, packet):
        self.link.sendto(packet, self.to)

    def step(self, now):
        if now - self.at > 0.5:
            self.at = now
            self.mav.send(self.beat)
        try:
            while data := self.link.recv(4096):
                self.received += len(data)
        except (BlockingIOError, ConnectionRefusedError):
            pass


@dataclasses.dataclass
class Row:
    """A flight: what happens so many seconds after which phase, and how it ends by firmware."""

    name: str
    expected: dict
    happenings: list = dataclasses.field(default_factory=list)
    words: tuple = ()
    silent_on: tuple = ()
    checks: tuple = ()
    settings: dict = dataclasses.field(default_factory=dict)
    parameters: dict = dataclasses.field(default_factory=dict)
    arguments: tuple = ()
    # Reference and drift of PX4's estimator.
    zeros: dict = dataclasses.field(default_factory=dict)
    drones: int = 1
    follows: bool = False
    places: str = ROUND
    over_s: float = 90.0


# What happens.


def pilot(mode, drone=0):
    return lambda flight: flight.drones[drone].pilot(mode)


def by_hand(flight):
    """The mode in which a pilot takes it."""
    flight.drone.pilot("LOITER" if flight.kind == "ardupilot" else "HAND")


def lost(seconds, unheard=True, deaf=True, drone=0):
    def happens(flight):
        flight.drones[drone].lose(unheard, deaf)
        flight.later(seconds, lambda flight: flight.drones[drone].lose(False, False))
    return happens


def one_way(seconds):
    return lost(seconds, deaf=False)


def late(by, seconds):
    def happens(flight):
        flight.drone.late = flight.drone.late_by = by
        flight.later(seconds, lambda flight: setattr(flight.drone, "late", 0.0))
    return happens


def ctrl_c(flight):
    flight.signal(signal.SIGINT)


def terminal_closed(flight):
    flight.signal(signal.SIGHUP)


def killed(flight):
    flight.signal(signal.SIGKILL)


def stopped(seconds):
    def happens(flight):
        flight.signal(signal.SIGSTOP)
        flight.later(seconds, lambda flight: flight.signal(signal.SIGCONT))
    return happens


def begins(*arguments):
    return lambda flight: flight.begin(*arguments)


def clears(flight):
    flight.type("up")


def failsafe(words, mode):
    return lambda flight: flight.drone.act(words, mode)


def lands_by_itself(flight):
    """PX4 has no rule for a silence in its own climb: another failsafe lands it."""
    if flight.kind == "px4":
        flight.drone.act("Failsafe activated", "LAND")


def set_point(drone, mask, east, north, up, velocity):
    lat = int((LAT + north / METRES) * 1e7)
    lon = int((LON + east / METRES / math.cos(math.radians(LAT))) * 1e7)
    frame = m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT if drone.ardupilot else m.MAV_FRAME_GLOBAL_INT
    alt = up if drone.ardupilot else up + drone.home_alt()
    return m.MAVLink_set_position_target_global_int_message(
        0, 1, 1, frame, mask, lat, lon, alt, *velocity, 0.0, 0.0, 0.0, 0.0, 0.0)


def velocities(seconds, north=2.0):
    """Another station sends velocities."""
    return lambda flight: flight.stream(seconds, lambda drone: [set_point(drone, 0xDC7, 0, 0, 0, (north, 0.0, 0.0))])


def positions(seconds, east, north):
    """Another station sends it elsewhere."""
    return lambda flight: flight.stream(
        seconds, lambda drone: [set_point(drone, 0xDF8, east, north, 4.0, (0.0, 0.0, 0.0))])


def command(number, *parameters):
    parameters = [*parameters, *[0.0] * (7 - len(parameters))]
    return m.MAVLink_command_long_message(1, 1, number, 0, *parameters)


def motors(seconds):
    """Another station runs its motors on the ground."""
    def happens(flight):
        flight.drone.hear(254, command(m.MAV_CMD_COMPONENT_ARM_DISARM, 1.0))
        flight.later(seconds, lambda flight: flight.drone.hear(254, command(m.MAV_CMD_COMPONENT_ARM_DISARM, 0.0)))
    return happens


def speed(mps):
    return lambda flight: flight.drone.hear(254, command(m.MAV_CMD_DO_CHANGE_SPEED, 1.0, mps, -1.0))


def gps_aside(seconds, east, north):
    def happens(flight):
        flight.drone.aside = (east, north)
        flight.later(seconds, lambda flight: setattr(flight.drone, "aside", (0.0, 0.0)))
    return happens


def fails(name, seconds):
    """A device of its own is dead, or one of its rules holds, for a while."""
    def happens(flight):
        setattr(flight.drone, name, False)
        flight.later(seconds, lambda flight: setattr(flight.drone, name, True))
    return happens


def misreads(metres):
    return lambda flight: setattr(flight.drone, "misreads", metres)


def restarts(flight):
    flight.drone.restart()


def forwards(number):
    return lambda flight: setattr(flight.drone, "forwarded", [number])


def stranger(mode, seconds):
    def happens(flight):
        flight.stranger = Stranger(flight, mode)
        flight.later(seconds, lambda flight: setattr(flight.stranger, "at", math.inf))
    return happens


# What is looked at besides.


def receives(flight):
    return None if any(event.get("event") == "received" for event in flight.events()) else "it has received nothing"


def doubts(phase, since, until):
    """Nothing that is received between these seconds after a phase is believed."""
    def check(flight):
        wall = [event for event in flight.events() if event.get("event") == "flight_stage"]
        hunting = next((e["time"] for e in wall if e.get("stage") == "hunting"), None)
        if hunting is None:
            return "it did not hunt"
        zero = hunting + flight.phases[phase] - flight.phases["hunt"]
        taken = [
            e["reception"]["time"] - zero for e in flight.events()
            if e.get("event") == "received" and since < e["reception"]["time"] - zero < until
        ]
        return f"receptions are believed at {taken[:3]} s" if taken else None
    return check


def goals_within(metres):
    def check(flight):
        goals = [order.value for order in flight.drone.orders if order.what == "goal"]
        far = [goal for goal in goals if math.dist(goal[:2], flight.drone.home) > metres + 0.2]
        if not goals:
            return "no goals"
        return f"goals beyond {metres} m: {far[:3]}" if far else None
    return check


def no_failsafe(flight):
    return f"failsafes {flight.drone.failsafes}" if flight.drone.failsafes else None


def failsafe_within(low, high):
    """Its failsafe for a lost station acts so many seconds after its last heartbeat or set-point."""
    def check(flight):
        after = flight.failsafe_after()
        return None if low <= after <= high else f"its failsafe acted {after:.1f} s after the last it followed"
    return check


def unheard_stranger(flight):
    got = flight.stranger.received
    return f"the stranger was sent {got} bytes" if got else None


def apart(metres):
    return lambda flight: None if flight.nearest_m >= metres else f"two were {flight.nearest_m:.2f} m apart"


def one_by_one(flight):
    """No two fly home at once."""
    spans = []
    for drone in flight.drones:
        homes = [order.at for order in drone.orders if order.what == "mode" and order.value == "RTL"]
        if homes:
            spans.append((homes[0], drone.touched_at or math.inf))
    spans.sort()
    both = [one for one, other in zip(spans, spans[1:]) if other[0] < one[1] - 0.5]
    return f"{len(both)} pairs return at once" if both else None


def lands_once(flight):
    """What the hunt has landed at its home is not sent up again."""
    modes = [order.value for order in flight.drone.orders if order.what == "mode"]
    after = modes[modes.index("LAND") :] if "LAND" in modes else []
    return "it is returned out of its landing" if "RTL" in after else None


def slows_again(mps):
    """After another station's speed its own is ordered again, and flown."""
    def check(flight):
        ordered = [order.at for order in flight.drone.orders if order.what == "speed"]
        since, until = flight.phases["away"] + 1.0, flight.phases["home"]
        again = next((at for at in ordered if at > since), None)
        if again is None:
            return "its speed is not ordered again"
        fastest = max(v for at, v in flight.drone.speeds if again + 0.5 < at < until)
        return None if fastest <= mps else f"flown at {fastest:.1f} m/s"
    return check


def rows():
    def same(*end):
        return {kind: end for kind in BOTH}

    def only(kind, *end):
        return {kind: end}

    home, down, refused = same("home"), same("down"), same("refused")
    stays = same("stays")
    left = {"ardupilot": ("left", "LOITER"), "px4": ("left", "POSITION")}
    not_ordered = ("which we did not order",)
    in_ours = {"ardupilot": ("left", "GUIDED"), "px4": ("left", "OFFBOARD")}
    return [
        # What held.
        Row("a whole hunt", home, follows=True, over_s=400.0,
            silent_on=(*not_ordered, r"vehicle: position +NO"), checks=(receives, no_failsafe, lands_once)),
        Row("Ctrl-C before it is armed", refused, [("begun", 4, ctrl_c)], settings={"ready_timeout_s": 40.0}),
        Row("Ctrl-C in the climb", home, [("climb", 0, ctrl_c)]),
        Row("Ctrl-C while it hunts", home, [("away", 1, ctrl_c)], silent_on=not_ordered, checks=(no_failsafe,)),
        Row("Ctrl-C twice", {"ardupilot": ("home",), "px4": ("home",)}, [("away", 1, ctrl_c), ("away", 3, ctrl_c)]),
        Row("the terminal is closed", home, [("away", 1, terminal_closed)]),
        Row("the pilot takes it in the climb", left, [("climb", 0, by_hand)]),
        Row("the pilot takes it while it hunts, Ctrl-C", left, [("away", 1, by_hand), ("away", 6, ctrl_c)]),
        Row("the pilot takes it and gives it back", only("ardupilot", "home"),
            [("away", 1, by_hand), ("away", 5, pilot("GUIDED")), ("away", 14, ctrl_c)],
            checks=(lambda f: None if any(o.what == "goal" and o.at > f.phases["away"] + 6 for o in f.drone.orders)
                    else "it takes no part again",)),
        Row("the pilot takes it while it leaves", left, [("away", 1, ctrl_c), ("away", 4, by_hand)]),
        Row("the pilot lands it by his switch", down, [("away", 1, pilot("LAND"))]),
        Row("the pilot lands it while it leaves", down, [("away", 1, ctrl_c), ("away", 4, pilot("LAND"))]),
        Row("GUIDED straight out of our return", only("ardupilot", "left", "GUIDED"),
            [("away", 1, ctrl_c), ("home", 2, pilot("GUIDED"))]),
        Row("the pilot returns it and gives it back", only("ardupilot", "home"),
            [("away", 1, pilot("RTL")), ("away", 3, pilot("GUIDED")), ("away", 10, ctrl_c)]),
        Row("foxhunt is killed", same("failsafe"), [("away", 1, killed)], checks=(failsafe_within(3.3, 5.3),)),
        Row("foxhunt is killed in the climb", {"ardupilot": ("failsafe",), "px4": ("flies on", "HOLD")},
            [("climb", 0, killed), ("climb", 7, lambda flight: None)],
            checks=(lambda f: failsafe_within(4.4, 5.3)(f) if f.drone.ardupilot else None,)),
        Row("foxhunt is killed while it lands", only("ardupilot", "down"),
            [("hunt", 0, ctrl_c), ("home", 0.3, killed)], settings={"on_abort": '"land"', "takeoff_up_m": 14.0},
            checks=(failsafe_within(4.4, 5.3),)),
        Row("foxhunt is stopped for 10 s", {"ardupilot": ("down",), "px4": ("down",)}, [("away", 1, stopped(10.0))]),
        Row("killed, and taken over", {"ardupilot": ("home",), "px4": ("home",)},
            [("away", 1, killed), ("away", 2, begins("--take-over")), ("away", 25, ctrl_c)],
            parameters={"px4": {"COM_OBL_RC_ACT": 5}}),
        Row("killed, begun anew without a take-over",
            {"ardupilot": ("flies on", "GUIDED"), "px4": ("flies on", "HOLD")},
            [("away", 1, killed), ("away", 2, begins())], words=("is in the air",),
            parameters={"px4": {"COM_OBL_RC_ACT": 5}, "ardupilot": {"FS_GCS_ENABLE": 0.0}}),
        Row("killed in POSITION, and to be taken over", only("px4", "flies on", "POSITION"),
            [("away", 1, killed), ("away", 2, begins("--take-over"))], words=("HOLD",),
            parameters={"px4": {"COM_OBL_RC_ACT": 0}}),
        Row("killed while it returns, and to be taken over", down,
            [("away", 1, ctrl_c), ("home", 0.3, killed), ("home", 1, begins("--take-over"))],
            words=("is in the air",)),
        Row("it is to hold when it is broken off", same("failsafe"), [("away", 1, ctrl_c)],
            settings={"on_abort": '"hold"', "leaving_timeout_s": 15.0}, checks=(failsafe_within(3.3, 5.3),)),
        Row("one of two is its pilot's, Ctrl-C", left, [("away", 1, by_hand), ("away", 4, ctrl_c)], drones=2,
            checks=(lambda f: "the other is not down" if f.drones[1].armed else None,)),
        Row("a failsafe returns it, Ctrl-C", same("down"),
            [("away", 1, failsafe("Battery Failsafe", "RTL")), ("away", 3, ctrl_c)], words=("Battery Failsafe",)),
        Row("nothing is heard or sent for 60 s", same("failsafe"), [("away", 1, lost(60.0))], over_s=130.0),
        Row("nothing is heard or sent for 1, 2.2 and 3 s", home,
            [("away", 1, lost(1.0)), ("away", 6, lost(2.2)), ("away", 13, lost(3.0)), ("away", 26, ctrl_c)],
            checks=(no_failsafe,), silent_on=not_ordered),
        Row("nothing is heard or sent for 10 s", same("down"), [("away", 1, lost(10.0)), ("away", 15, ctrl_c)]),
        Row("orders are lost for 10 s", {"ardupilot": ("down",), "px4": ("down",)},
            [("away", 1, lost(10.0, unheard=False)), ("away", 14, ctrl_c)]),
        Row("the link is 1.5 s late, and the pilot takes it", left,
            [("away", 1, late(1.5, 30.0)), ("away", 6, by_hand), ("away", 12, ctrl_c)]),
        Row("its autopilot restarts before it is armed", home, [("begun", 3, restarts), ("away", 1, ctrl_c)],
            over_s=150.0, settings={"ready_timeout_s": 90.0}),
        Row("its autopilot restarts when it is armed", stays, [("armed", 0.3, restarts)], over_s=150.0),
        # The ten of the first issue.
        Row("one way, Ctrl-C, and the pilot takes it", left,
            [("away", 1, one_way(25.0)), ("away", 2, ctrl_c), ("away", 3, by_hand)]),
        Row("one way for 40 s while it hunts", {"ardupilot": ("failsafe",), "px4": ("failsafe",)},
            [("away", 1, one_way(40.0))], over_s=120.0, checks=(failsafe_within(3.3, 5.3),)),
        Row("one way while it leaves, and the pilot takes it", left,
            [("away", 1, ctrl_c), ("away", 2, one_way(20.0)), ("away", 4, by_hand)]),
        Row("taken in a silence while it leaves", left,
            [("away", 1, lost(8.0)), ("away", 2.5, ctrl_c), ("away", 3, by_hand)]),
        Row("its failsafe lands it out of the climb, in a silence", stays,
            [("climb", 0, lost(25.0)), ("climb", 0.5, lands_by_itself)], over_s=150.0,
            settings={"climb_timeout_s": 45.0}),
        Row("the same beside two others", stays, [("climb", 0, lost(25.0)), ("climb", 0.5, lands_by_itself)],
            drones=3, over_s=200.0, settings={"climb_timeout_s": 45.0}),
        Row("nothing is heard or sent for 25 s out of the climb", only("px4", "home"),
            [("climb", 0, lost(25.0)), ("away", 1, ctrl_c)], over_s=150.0, settings={"climb_timeout_s": 45.0}),
        Row("its failsafes are off, and Ctrl-C in a silence", home, [("away", 1, lost(12.0)), ("away", 3, ctrl_c)],
            parameters={"ardupilot": {"FS_GCS_ENABLE": 0.0}, "px4": {"COM_OF_LOSS_T": 30.0}}),
        Row("another station runs its motors before the take-off", stays, [("asked", 0, motors(4.0))]),
        Row("another station runs them, and its pilot clears it", home,
            [("asked", 0, motors(4.0)), ("asked", 9, clears), ("away", 1, ctrl_c)]),
        Row("taken and given back while another returns", only("ardupilot", "home"),
            [("away", 1, ctrl_c), ("away", 2.5, pilot("LOITER", 1)), ("away", 6, pilot("GUIDED", 1))], drones=2),
        Row("behind a router with a station of its number, killed", only("ardupilot", "flies on", "GUIDED"),
            [("begun", 0, forwards(255)), ("away", 1, killed), ("away", 12, lambda flight: None)],
            words=("another station on this link has foxhunt's number 255",)),
        Row("behind a router, with a number of its own, killed", only("ardupilot", "failsafe"),
            [("begun", 0, forwards(255)), ("away", 1, killed)], settings={"ground_system_id": 254},
            parameters={"ardupilot": {"SYSID_MYGCS": 254.0}}, checks=(failsafe_within(4.4, 5.3),)),
        Row("behind a router, killed", only("px4", "failsafe"), [("begun", 0, forwards(255)), ("away", 1, killed)],
            checks=(failsafe_within(3.3, 4.0),)),
        Row("its GPS is 55 m aside for 25 s", home, [("away", 1, gps_aside(25.0, 55.0, 0.0)), ("away", 70, ctrl_c)],
            words=("GPS|jumped|rejects",), checks=(doubts("away", 3.0, 50.0),), over_s=150.0),
        Row("its compasses are dead for 20 s", home, [("away", 1, fails("compass", 20.0)), ("away", 30, ctrl_c)],
            words=("compass is not healthy",), checks=(doubts("away", 2.5, 21.0),)),
        Row("its GPS is gone for 2.4 s", home, [("away", 1, fails("gps", 2.4)), ("away", 15, ctrl_c)],
            words=("GPS",), checks=(doubts("away", 2.0, 4.0),)),
        Row("a stranger with its number, while it is silent for 5 s", same("down"),
            [("away", 1, lost(6.0)), ("away", 2, stranger("GUIDED", 12.0)), ("away", 20, ctrl_c)],
            words=("anybody who reaches this port",), checks=(unheard_stranger,)),
        Row("a stranger with its number on a live link", home,
            [("away", 1, stranger("LOITER", 10.0)), ("away", 14, ctrl_c)], checks=(unheard_stranger, no_failsafe),
            silent_on=not_ordered),
        Row("its remote control fails, and the pilot takes it out of that", left,
            [("away", 1, failsafe("Radio Failsafe", "RTL")), ("away", 4, by_hand), ("away", 12, ctrl_c)],
            silent_on=(r"became (LOITER|POSITION), which we did not order \(Radio",)),
        Row("another station sends it 46 m away, Ctrl-C", in_ours,
            [("away", 1, positions(25.0, 46.0, 30.0)), ("away", 12, ctrl_c)],
            words=("another station",)),
        Row("another station sends it velocities, Ctrl-C", in_ours,
            [("away", 1, velocities(25.0)), ("away", 14, ctrl_c)], words=("another station",)),
        Row("another station orders 8 m/s", only("ardupilot", "home"),
            [("away", 1, speed(8.0)), ("away", 40, ctrl_c)], settings={"cruise_speed_mps": 2.0},
            places=FAR, checks=(slows_again(2.4),)),
        Row("its own fence is at 12 m", home, [("away", 45, ctrl_c)],
            parameters={"ardupilot": {"FENCE_ENABLE": 1.0, "FENCE_RADIUS": 12.0}, "px4": {"GF_MAX_HOR_DIST": 12.0}},
            words=("within 10 m",), checks=(goals_within(10.0), no_failsafe),
            silent_on=("does not confirm", "did not take"),
            follows=True, over_s=140.0),
        Row("its own fence returns it", only("px4", "down"),
            [("away", 0, lambda f: f.drone.parameters.update(GF_MAX_HOR_DIST=5.0, GF_ACTION=3))],
            words=("Geofence",)),
        # The eight of the second.
        Row("1.18: it stands still, and takes off", only("px4", "home"), [("away", 1, ctrl_c)], zeros={"minor": 18},
            silent_on=("flags are 0x03ff",)),
        Row("its zero is 2.5 m above home, drifting", only("px4", "home"), [("hunt", 45, ctrl_c)],
            zeros={"minor": 18, "reference": 2.5, "drift": -0.05}, over_s=140.0),
        Row("its zero is 2.5 m below home, drifting", only("px4", "home"), [("hunt", 45, ctrl_c)],
            zeros={"minor": 15, "reference": -2.5, "drift": 0.05}, over_s=140.0),
        Row("it flies 2.5 m below its goals", only("px4", "home"), [("hunt", 3, misreads(2.5))],
            words=("m below the one to which it was sent|it sinks at",)),
        Row("HOLD in the climb", only("px4", "left", "HOLD"), [("climb", 0, pilot("LOITER"))], over_s=120.0),
        Row("POSITION, then HOLD in the climb", only("px4", "left", "HOLD"),
            [("climb", 0, pilot("HAND")), ("climb", 2, pilot("LOITER"))], over_s=120.0),
        Row("HOLD while it hunts, Ctrl-C", only("px4", "left", "HOLD"),
            [("away", 1, pilot("LOITER")), ("away", 6, ctrl_c)]),
        Row("HOLD in a silence, Ctrl-C", only("px4", "left", "HOLD"),
            [("away", 1, lost(6.0)), ("away", 2, pilot("LOITER")), ("away", 3, ctrl_c)]),
        Row("POSITION in a silence of 20 s", only("px4", "left", "POSITION"),
            [("away", 1, lost(20.0)), ("away", 2, pilot("HAND")), ("away", 30, ctrl_c)]),
        Row("one way, and POSITION against RETURN", only("px4", "left", "POSITION"),
            [("away", 1, ctrl_c), ("away", 1.5, one_way(20.0)), ("away", 3, by_hand)]),
        Row("COM_OBL_RC_ACT 0, a silence of 10 s", only("px4", "left", "POSITION"),
            [("away", 1, lost(10.0)), ("away", 16, ctrl_c)], parameters={"px4": {"COM_OBL_RC_ACT": 0}}),
        Row("COM_OBL_RC_ACT 5, a silence of 10 s, Ctrl-C", only("px4", "home"),
            [("away", 1, lost(10.0)), ("away", 16, ctrl_c)], parameters={"px4": {"COM_OBL_RC_ACT": 5}}),
        Row("arming is refused, in chunks of text", refused,
            [("begun", 0, lambda f: setattr(f.drone, "arms_at_all", False))],
            words=("Resolve system health failures first|Hardware safety switch",)),
        Row("its own checks fail", refused, [("begun", 0, lambda f: setattr(f.drone, "healthy", False))],
            settings={"ready_timeout_s": 15.0}, words=("checks|PreArm|not ready",)),
        Row("its parameters: no fence, 9 m/s, set-points lost after 1 s", only("px4", "home"), [("away", 1, ctrl_c)],
            parameters={"px4": {"MPC_XY_VEL_MAX": 9.0, "COM_OF_LOSS_T": 1.0, "GF_ACTION": 2}},
            settings={"cruise_speed_mps": 2.0},
            words=("all its distances are 0", "MPC_XY_VEL_MAX", "COM_OF_LOSS_T to 3.5")),
        Row("three come home together", home, [("away", 1, ctrl_c)], drones=3, checks=(apart(2.0), one_by_one),
            over_s=200.0),
    ]


def fly(flight):
    name, kind = flight
    row = next(row for row in rows() if row.name == name)
    try:
        result = Flight(row, kind).fly()
    except Exception as error:
        expected = " ".join(row.expected[kind])
        result = {"expected": expected, "happened": "no flight", "faults": [repr(error)], "folder": ""}
    end = f"{result['faults']}, {result['folder']}" if result["faults"] else "as expected"
    print(f"{kind}, {row.name}: {result['happened']}: {end}", file=sys.stderr, flush=True)
    return row.name, kind, result


def main():
    chosen = [row for row in rows() if not sys.argv[2:] or any(word in row.name for word in sys.argv[2:])]
    flights = [(row.name, kind) for row in chosen for kind in BOTH if kind in row.expected]
    with multiprocessing.Pool(JOBS, maxtasksperchild=1) as pool:
        results = pool.map(fly, flights, chunksize=1)
    found = {(name, kind): result for name, kind, result in results}
    print("| what happens | ArduCopter | PX4 |\n| --- | --- | --- |")
    for row in chosen:
        cells = []
        for kind in BOTH:
            result = found.get((row.name, kind))
            if result is None:
                cells.append("")
            elif result["faults"]:
                cells.append(f"**{result['expected']} expected; {'; '.join(result['faults'])}**")
            else:
                cells.append(result["happened"])
        print(f"| {row.name} | {cells[0]} | {cells[1]} |")
    failed = [result for *_, result in results if result["faults"]]
    print(f"{len(results) - len(failed)} passed, {len(failed)} failed")
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
