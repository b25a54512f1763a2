"""Two strict autopilots, after the documents of ArduCopter 4.6 and PX4 1.16, over pymavlink: what
flies is a point. They share no code with our emulated ones. Differences between the two:

| | ArduCopter | PX4 |
| --- | --- | --- |
| telemetry | nothing but heartbeats until it is requested | its usual rates by itself |
| take-off | armed in GUIDED, height above home | any armed mode, height above sea level |
| orders | GUIDED, which needs a position | OFFBOARD, which needs set-points at 2 Hz before |
| speed | WPNAV_SPEED again at each entry into GUIDED and at the first set-point | its own |
| set-points stop | it stays | after COM_OF_LOSS_T the mode of COM_OBL_RC_ACT |
| heights of set-points | above home | converted as PX4 1.12 to 1.18 does, about the zero of its estimator |
| the estimator's flags | 0x33F | from 1.16 on CONST_POS_MODE whenever it stands still |
| checks before arming | enabled and health of SYS_STATUS | health alone |
| texts | up to 50 bytes | longer ones in chunks |
| its target in OFFBOARD | POSITION_TARGET_GLOBAL_INT | POSITION_TARGET_LOCAL_NED; the global one keeps an old target |
| the station that it follows is silent | RTL after 4.8 s (FS_GCS_ENABLE), out of the climb and a landing too; the pilot's modes go on (FS_OPTIONS 16); on the ground its motors stop | nothing |
| goals outside its fence | ignored without an answer | flown to; beyond the border GF_ACTION |
| its GPS is 55 m aside | "GPS Glitch or Compass error" and flags at once, the new place after 10 s, "Glitch cleared" after 20 s | rejected innovations and a flag at once, the new place after 7 s |
| dead compasses, in the air | the health in SYS_STATUS alone | the same |
| down by RTL or LAND | disarmed 2 s later | disarmed 2 s later, and HOLD by itself |
| armed and left alone | disarmed after 10 s (DISARM_DELAY) | disarmed after 10 s (COM_DISARM_PRFLT) |
"""

import math
import os
import socket
import struct
import time

os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil  # noqa: E402

m = mavutil.mavlink
METRES = 111_319.5
# Where East and North are 0, and its height.
LAT, LON, SEA_M = 47.397742, 8.545594, 488.0
WPNAV_SPEED = 5.0
CLIMB = 2.0


def px4(main, sub=0):
    return main << 16 | sub << 24


MODES = {
    "ardupilot": {"HAND": 0, "LOITER": 5, "GUIDED": 4, "RTL": 6, "LAND": 9},
    "px4": {
        "HAND": px4(3), "LOITER": px4(4, 3), "GUIDED": px4(6), "RTL": px4(4, 5), "LAND": px4(4, 6),
        "TAKEOFF": px4(4, 2),
    },
}

# The messages that each can be requested to send.
KNOWN = {
    "ardupilot": {1, 24, 30, 33, 87, 148, 193, 242, 245},
    "px4": {1, 24, 30, 32, 33, 85, 87, 148, 230, 242, 245},
}

# Whole numbers of PX4 are sent as the bits of a float.
PARAMETERS = {
    "ardupilot": {
        "SYSID_MYGCS": 255.0, "FS_GCS_ENABLE": 1.0, "FS_GCS_TIMEOUT": 5.0, "FS_THR_ENABLE": 1.0,
        "BATT_FS_LOW_ACT": 2.0, "RTL_ALT": 800.0, "FENCE_ENABLE": 0.0, "FENCE_TYPE": 7.0, "FENCE_ACTION": 1.0,
        "FENCE_RADIUS": 300.0, "FENCE_ALT_MAX": 100.0, "FENCE_ALT_MIN": -10.0, "FENCE_MARGIN": 2.0,
        "FENCE_TOTAL": 0.0,
    },
    "px4": {
        "COM_OF_LOSS_T": 3.5, "COM_OBL_RC_ACT": 3, "NAV_DLL_ACT": 2, "NAV_RCL_ACT": 2,
        "COM_LOW_BAT_ACT": 3, "RTL_RETURN_ALT": 13.0, "MPC_XY_VEL_MAX": 3.0, "GF_ACTION": 2,
        "GF_MAX_HOR_DIST": 0.0, "GF_MAX_VER_DIST": 0.0,
    },
}
WITHOUT_SETPOINTS = {0: "HAND", 3: "RTL", 4: "LAND", 5: "LOITER"}
BEYOND_FENCE = {2: "LOITER", 3: "RTL", 5: "LAND"}
# Bits of SYS_STATUS.
COMPASS, GPS, PREARM = 0x4, 0x20, 0x10000000
# The station fails this much before FS_GCS_TIMEOUT: 4.6 to 5 s were seen with 5.
EARLY_S = 0.2
TOUCHED_S = 2.0
# Speed over the way that is left, per second.
SLOWS = 0.95
NAN = math.nan


def towards(value, target, most):
    return value + max(-most, min(most, target - value))


class Order:
    """A message of foxhunt, as it arrived: `what` is beat, mode, arm, disarm, climb, goal or speed."""

    def __init__(self, at, what, value=None):
        self.at, self.what, self.value = at, what, value

    def __repr__(self):
        return f"{self.what} {self.value or ''} at {self.at:.1f}"


class Autopilot:
    def __init__(self, kind, system, home, port, copy_port, minor=16, reference=0.0, drift=0.0, **parameters):
        """`reference`: the zero of PX4's estimator above home in metres, whose altitude drifts by `drift` m/s."""
        self.minor, self.reference, self.drift = minor, reference, drift
        self.parameters, self.texts = PARAMETERS[kind] | parameters, 0
        self.own_goal = self.wanted_up = None
        # While what is sent to it is lost, while its own messages are, and by how much both are late.
        self.deaf = self.unheard = False
        self.late = 0.0
        self.inbox, self.outbox = [], []
        # The worst that a goal was missed by in height, three seconds after the last one came.
        self.worst_up, self.goal_since = 0.0, math.inf
        self.kind, self.system, self.modes = kind, system, MODES[kind]
        self.ardupilot = kind == "ardupilot"
        self.link = mavutil.mavlink_connection(
            f"udpout:127.0.0.1:{port}", source_system=system, source_component=1
        )
        self.link.mav.file = self
        # Who follows the telemetry has a link of its own, and has nothing to send.
        self.copy, self.copy_to = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), ("127.0.0.1", copy_port)
        self.copy.setblocking(False)
        self.home, self.place, self.yaw = home, [*home, 0.0], 0.3
        self.velocity, self.goal, self.goal_yaw = [0.0, 0.0, 0.0], None, None
        self.mode, self.armed, self.speed = self.modes["HAND"], False, WPNAV_SPEED
        self.begun = self.now = time.monotonic()
        self.sent, self.period = {}, {} if self.ardupilot else {
            30: 0.1, 33: 0.2, 24: 0.5, 1: 0.5, 245: 0.5, 230: 1.0, 242: 2.0, 87: 0.5, 32: 0.5, 85: 0.5,
        }
        self.station = self.armed_at = self.fed_since = self.fed = -math.inf
        self.positioned = False
        # The station is lost; a failsafe acts; when it touched down; where the pilot's switch stands.
        self.lost = self.critical = False
        self.touched = self.touched_at = self.switch = None
        self.velocity_goal, self.velocity_at = None, -math.inf
        # How far its GPS is aside, how much of that it believes, and since when it has noticed.
        self.aside, self.believed, self.glitch_at = (0.0, 0.0), (0.0, 0.0), None
        self.compass = self.gps = self.healthy = self.arms_at_all = True
        self.placed_after, self.misreads = 6.0, 0.0
        # Stations that a router puts on its link.
        self.forwarded, self.forwarded_at = [], -math.inf
        # What a test looks at.
        self.refused, self.failsafes, self.disturbed, self.flown = [], [], 0, False
        # Orders of foxhunt, the pilot's modes, failsafes and armings with their times.
        self.orders, self.pilots, self.acted, self.armings, self.ignored = [], [], [], [], 0
        # The fastest that it flew to set-points, by entries into GUIDED.
        self.fastest, self.speeds = [], []

    # The model of the world.

    def is_placed(self):
        return self.now - self.begun > self.placed_after

    def airborne(self):
        return self.place[2] > 0.3

    def enter(self, name):
        self.mode = self.modes[name]
        self.goal = self.goal_yaw = self.velocity_goal = self.wanted_up = None
        self.positioned = False
        if name == "GUIDED":
            self.fastest.append(0.0)
            self.speed = WPNAV_SPEED
        if name in ("LAND", "RTL"):
            self.goal = list(self.place)
        if name == "RTL":
            # Up, over to its home, and down.
            self.goal = [*self.place[:2], max(self.place[2], self.return_up()) if self.airborne() else 0.0]

    def is_in(self, name):
        return self.mode == self.modes.get(name)

    def step(self, dt):
        self.now = time.monotonic()
        self.fly(dt)
        self.glitch()
        self.settle()
        self.failsafe()
        self.judge_height()
        if not self.is_in("GUIDED"):
            self.own_goal = self.goal
        while (message := self.link.recv_msg()) is not None:
            if not self.deaf:
                self.inbox.append((self.now + self.late, message))
        while self.inbox and self.inbox[0][0] <= self.now:
            message = self.inbox.pop(0)[1]
            self.note(message)
            self.take(message)
        try:
            while self.copy.recv(4096):
                self.disturbed += 1
        except BlockingIOError:
            pass
        self.report()
        while self.outbox and self.outbox[0][0] <= self.now:
            self.link.write(self.outbox.pop(0)[1])

    def fly(self, dt):
        before = list(self.place)
        if self.armed and self.goal is not None:
            way = math.hypot(self.goal[0] - before[0], self.goal[1] - before[1])
            # It brakes in proportion to the way that is left (MPC_XY_P, PSC_POSXY_P).
            share = min(1.0, min(self.speed, max(SLOWS * way, 0.2)) * dt / way) if way > 0 else 0.0
            self.place[0] += (self.goal[0] - before[0]) * share
            self.place[1] += (self.goal[1] - before[1]) * share
            if self.is_in("RTL") and self.goal[2] > 0.0 and abs(before[2] - self.goal[2]) < 0.1:
                self.goal = [*self.home, 0.0 if math.dist(before[:2], self.home) < 0.5 else self.goal[2]]
            if self.is_in("LAND"):
                self.goal[2] = 0.0
            self.place[2] = towards(before[2], self.goal[2], CLIMB * dt)
            if self.goal_yaw is not None:
                turn = (self.goal_yaw - self.yaw + math.pi) % (2 * math.pi) - math.pi
                self.yaw += max(-dt, min(dt, turn))
            if self.is_in("TAKEOFF") and self.goal and abs(self.place[2] - self.goal[2]) < 0.2:
                self.mode = self.modes["LOITER"]
        if self.armed and self.velocity_goal is not None:
            # ArduCopter stops when no further one comes for 3 s.
            if self.now - self.velocity_at < 3.0:
                self.place = [a + b * dt for a, b in zip(self.place, self.velocity_goal)]
        self.velocity = [(a - b) / dt for a, b in zip(self.place, before)]
        self.flown |= self.airborne()
        self.speeds.append((self.now, math.hypot(*self.velocity[:2])))
        # How fast it flies to set-points, a second after the last order that might change that.
        if self.is_in("GUIDED") and self.goal and self.positioned and self.now - self.positioned > 2.0:
            self.fastest[-1] = max(self.fastest[-1], math.hypot(*self.velocity[:2]))

    def settle(self):
        """Motors stop after a touch-down, and when it is armed and left alone on the ground."""
        down = self.armed and self.place[2] <= 0.0 and (self.is_in("RTL") or self.is_in("LAND"))
        self.touched = (self.touched or self.now) if down else None
        if self.touched is not None and self.now - self.touched > TOUCHED_S:
            self.armed, self.goal, self.critical, self.touched_at = False, None, False, self.touched
            if not self.ardupilot:
                self.mode = self.modes["LOITER"]
        on_ground = self.armed and not self.airborne() and self.goal is None
        if on_ground and self.now - self.armed_at > 10.0:
            self.armed = False

    def glitch(self):
        """A place of its GPS that is aside is believed after a while."""
        if self.aside != self.believed and self.glitch_at is None:
            self.glitch_at = self.now
            if self.ardupilot:
                self.text("EKF3 lane switch 1")
                self.text("GPS Glitch or Compass error")
        if self.glitch_at is None:
            return
        since = self.now - self.glitch_at
        if since > (10.0 if self.ardupilot else 7.0) and self.aside != self.believed:
            steps = [a - b for a, b in zip(self.aside, self.believed)]
            self.place[:2] = [a + b for a, b in zip(self.place, steps)]
            self.believed = self.aside
        if since > 20.0:
            self.glitch_at = None
            if self.ardupilot:
                self.text("Glitch cleared")

    def rejects(self):
        return self.aside != self.believed

    def truth(self):
        """Where it really is."""
        return [self.place[0] - self.believed[0], self.place[1] - self.believed[1], self.place[2]]

    def restart(self):
        """Its power is gone for a moment, on the ground."""
        self.begun, self.placed_after, self.armed = self.now, 30.0, False
        self.enter("HAND")
        self.sent, self.critical, self.lost = {}, False, False
        if self.ardupilot:
            self.period = {}

    # What differs on PX4.

    def return_up(self):
        return self.parameters["RTL_ALT"] * 0.01 if self.ardupilot else self.parameters["RTL_RETURN_ALT"]

    def home_alt(self):
        """The altitude of home in the terms of those that it reports."""
        return SEA_M + (0.0 if self.ardupilot else self.drift * (self.now - self.begun))

    def up_of(self, alt, frame):
        """How high above home a set-point is flown. PX4 has `home.alt - alt - ref_alt` for heights
        above home, where it should be `ref_alt - home.alt - alt`, from 1.12 to 1.18."""
        above_home = frame == m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
        if self.ardupilot:
            return alt if above_home else alt - SEA_M
        home_alt, ref_alt = SEA_M, self.home_alt() + self.reference
        down = home_alt - alt - ref_alt if above_home else ref_alt - alt
        # Home lies as far below the estimator's zero as it was when it was set.
        return self.reference - down - self.misreads

    def local(self, place):
        """North, East and Down from the zero of its estimator, which is where it was switched on."""
        return place[1], place[0], self.reference - place[2]

    def flags(self):
        if not self.is_placed():
            return 0xA7 if self.minor >= 16 else 0
        standing = self.minor >= 16 and not self.airborne()
        return 0x33F | (0x80 if standing else 0) | (0x400 if self.rejects() else 0)

    def parameter(self, query):
        name = query.param_id.rstrip("\0")
        value = self.parameters.get(name)
        if value is None:
            return
        whole = isinstance(value, int)
        sent = struct.unpack("f", struct.pack("i", value))[0] if whole else value
        kind = m.MAV_PARAM_TYPE_INT32 if whole else m.MAV_PARAM_TYPE_REAL32
        self.send(m.MAVLink_param_value_message(name.encode(), sent, kind, len(self.parameters), 0))

    def judge_height(self):
        """How far it is from the height of a goal that it was sent to three seconds ago and longer."""
        level = abs(self.velocity[2]) < 0.05
        if self.is_in("GUIDED") and self.wanted_up is not None and level and self.now - self.goal_since > 3.0:
            self.worst_up = max(self.worst_up, abs(self.place[2] - self.wanted_up))

    def failsafe(self):
        silent = self.now - self.station
        if self.ardupilot and self.parameters["FS_GCS_ENABLE"] > 0 and math.isfinite(silent):
            if self.lost and silent < 1.0:
                self.lost, self.critical = False, False
                self.text("GCS Failsafe Cleared")
            elif not self.lost and silent > self.parameters["FS_GCS_TIMEOUT"] - EARLY_S:
                self.lost = True
                if self.armed and not self.airborne():
                    self.armed, self.goal = False, None
                elif self.armed and not (self.is_in("HAND") or self.is_in("LOITER")):
                    self.act("GCS Failsafe", "RTL")
        if not (self.armed and self.airborne()) or self.ardupilot or not self.is_in("GUIDED"):
            return
        if self.now - self.fed > self.parameters["COM_OF_LOSS_T"]:
            self.act("Offboard control lost", WITHOUT_SETPOINTS[self.parameters["COM_OBL_RC_ACT"]])
        border, action = self.parameters["GF_MAX_HOR_DIST"], self.parameters["GF_ACTION"]
        if border > 0 and math.dist(self.place[:2], self.home) > border and action in BEYOND_FENCE:
            self.act("Geofence violation", BEYOND_FENCE[action])

    def act(self, words, name):
        """A failsafe acts."""
        self.text(words)
        self.critical = True
        self.failsafes.append(words)
        if not self.is_in(name):
            self.enter(name)
            self.acted.append((self.now, name))

    def pilot(self, name):
        """The pilot's switch acts when it moves, not where it stands."""
        if name == self.switch:
            return
        self.switch, self.critical = name, False
        self.enter(name)
        self.pilots.append((self.now, name))

    # The wire.

    def write(self, packet):
        """Takes what is sent to the station, as the file of its encoder."""
        if not self.unheard:
            self.outbox.append((self.now + self.late, packet))

    def hear(self, number, message):
        """Takes a message of another station of this number, which comes by a link of its own."""
        message.get_header().srcSystem = number
        self.take(message)

    def note(self, message):
        """Notes what foxhunt has sent."""
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self.orders.append(Order(self.now, "beat"))
        if kind == "SET_POSITION_TARGET_GLOBAL_INT":
            east, north, up = self.place_of(message)
            self.orders.append(Order(self.now, "goal", (round(east, 1), round(north, 1), round(up, 1))))
        if kind != "COMMAND_LONG":
            return
        if message.command == m.MAV_CMD_DO_SET_MODE:
            mode = int(message.param2) if self.ardupilot else px4(int(message.param2), int(message.param3))
            self.orders.append(Order(self.now, "mode", self.name_of(mode)))
        elif message.command == m.MAV_CMD_COMPONENT_ARM_DISARM:
            self.orders.append(Order(self.now, "arm" if message.param1 > 0.5 else "disarm"))
        elif message.command == m.MAV_CMD_NAV_TAKEOFF:
            self.orders.append(Order(self.now, "climb"))
        elif message.command == m.MAV_CMD_DO_CHANGE_SPEED:
            self.orders.append(Order(self.now, "speed", message.param2))

    def name_of(self, mode):
        return next((name for name, number in self.modes.items() if number == mode), str(mode))

    def place_of(self, t):
        """East, North and Up of a set-point, as they are flown."""
        north = (t.lat_int * 1e-7 - LAT) * METRES
        east = (t.lon_int * 1e-7 - LON) * METRES * math.cos(math.radians(LAT))
        return east, north, self.up_of(t.alt, t.coordinate_frame)

    def take(self, message):
        kind = message.get_type()
        if kind == "HEARTBEAT":
            # PX4 hears every station.
            if message.get_srcSystem() == self.parameters.get("SYSID_MYGCS", message.get_srcSystem()):
                self.station = self.now
        elif getattr(message, "target_system", self.system) not in (0, self.system):
            return
        elif kind == "SET_MODE":
            self.order_mode(message.custom_mode)
        elif kind in ("COMMAND_LONG", "COMMAND_INT"):
            result = self.command(message)
            if result != m.MAV_RESULT_ACCEPTED:
                name = m.enums["MAV_CMD"][message.command].name
                self.refused.append((round(self.now - self.begun, 1), name, result))
            self.send(m.MAVLink_command_ack_message(
                message.command, result, 0, 0, message.get_srcSystem(), message.get_srcComponent()
            ))
        elif kind == "SET_POSITION_TARGET_GLOBAL_INT":
            self.target(message)
        elif kind == "PARAM_REQUEST_READ":
            self.parameter(message)

    def command(self, c):
        accepted, failed, denied = m.MAV_RESULT_ACCEPTED, m.MAV_RESULT_FAILED, m.MAV_RESULT_DENIED
        if c.command == m.MAV_CMD_SET_MESSAGE_INTERVAL:
            number = int(c.param1)
            if number not in KNOWN[self.kind]:
                return denied
            self.period[number] = c.param2 * 1e-6 if c.param2 > 0 else math.inf
            return accepted
        if c.command == m.MAV_CMD_REQUEST_MESSAGE:
            message = self.message(int(c.param1))
            self.send(message)
            return denied if message is None else accepted
        if c.command == m.MAV_CMD_DO_SET_MODE:
            mode = int(c.param2) if self.ardupilot else px4(int(c.param2), int(c.param3))
            return self.order_mode(mode)
        if c.command == m.MAV_CMD_COMPONENT_ARM_DISARM:
            if c.param1 < 0.5:
                if self.airborne():
                    return failed
                self.armed = False
                return accepted
            ready = self.is_placed() and self.healthy and self.arms_at_all
            if not ready or self.is_in("LAND") or self.is_in("RTL"):
                if self.ardupilot:
                    why = "Hardware safety switch" if self.is_placed() else "Need Position Estimate"
                    self.text(f"PreArm: {why}")
                    return failed
                if not self.is_placed():
                    self.text("Preflight Fail: no global position")
                self.text("Arming denied: Resolve system health failures first")
                return m.MAV_RESULT_TEMPORARILY_REJECTED
            if not self.armed:
                self.armings.append((self.now, c.get_srcSystem()))
            self.armed, self.armed_at, self.home = True, self.now, tuple(self.place[:2])
            return accepted
        if c.command == m.MAV_CMD_NAV_TAKEOFF:
            if not self.armed or self.airborne() or self.ardupilot and not self.is_in("GUIDED"):
                return failed
            up = c.param7 if self.ardupilot else c.param7 - self.home_alt()
            if not 0.5 < up < 100.0:
                return denied
            if not self.ardupilot:
                self.enter("TAKEOFF")
            self.goal = [*self.place[:2], up]
            return accepted
        if c.command == m.MAV_CMD_DO_CHANGE_SPEED:
            if self.ardupilot and not self.is_in("GUIDED"):
                return failed
            if self.ardupilot:
                self.speed = c.param2
                self.positioned = self.now if self.positioned else self.positioned
            return accepted
        if c.command == m.MAV_CMD_NAV_LAND:
            return self.order_mode(self.modes["LAND"])
        if c.command == m.MAV_CMD_NAV_RETURN_TO_LAUNCH:
            return self.order_mode(self.modes["RTL"])
        return m.MAV_RESULT_UNSUPPORTED

    def order_mode(self, mode):
        names = [name for name, number in self.modes.items() if number == mode]
        if not names:
            return m.MAV_RESULT_FAILED
        if not self.is_placed() and names[0] != "HAND":
            self.text("Mode change failed: requires position")
            return m.MAV_RESULT_FAILED
        fed = self.now - self.fed < 0.5 and self.now - self.fed_since > 0.4
        if names[0] == "GUIDED" and not self.ardupilot and not fed:
            return m.MAV_RESULT_TEMPORARILY_REJECTED
        if not self.is_in(names[0]):
            self.enter(names[0])
            self.critical = False
        return m.MAV_RESULT_ACCEPTED

    def target(self, t):
        if self.now - self.fed > 0.5:
            self.fed_since = self.now
        self.fed = self.now
        if not (self.is_in("GUIDED") and self.armed and self.airborne()):
            return
        if t.type_mask & 7:
            if not t.type_mask & 0x38:
                self.goal, self.positioned = None, False
                most = math.inf if self.ardupilot else self.parameters["MPC_XY_VEL_MAX"]
                east, north = (max(-most, min(most, v)) for v in (t.vy, t.vx))
                self.velocity_goal, self.velocity_at = (east, north, -t.vz), self.now
            return
        east, north, up = self.place_of(t)
        if self.ardupilot and self.parameters["FENCE_ENABLE"] > 0:
            beyond = math.dist((east, north), self.home) > self.parameters["FENCE_RADIUS"]
            if beyond or up > self.parameters["FENCE_ALT_MAX"]:
                self.ignored += 1
                return
        self.velocity_goal = None
        # The height that was meant.
        above_home = t.coordinate_frame == m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT
        wanted = t.alt if above_home else t.alt - self.home_alt()
        if self.wanted_up is None or abs(wanted - self.wanted_up) > 0.2:
            self.goal_since = self.now
        self.wanted_up = wanted
        if not self.ardupilot:
            self.speed = self.parameters["MPC_XY_VEL_MAX"]
        if self.ardupilot and not self.positioned:
            # From velocities or a take-off to positions: WPNAV's own speed again.
            self.speed = WPNAV_SPEED
        self.positioned = self.positioned or self.now
        self.goal = [east, north, up]
        if not t.type_mask & 0x400:
            self.goal_yaw = t.yaw

    def message(self, number):
        boot = int((self.now - self.begun) * 1000)
        east, north, up = self.place
        lat = int((LAT + north / METRES) * 1e7)
        lon = int((LON + east / METRES / math.cos(math.radians(LAT))) * 1e7)
        alt, relative = int((self.home_alt() + up) * 1000), int(up * 1000)
        vx, vy, vz = (int(v * 100) for v in (self.velocity[1], self.velocity[0], -self.velocity[2]))
        ready = self.is_placed()
        if number == 33:
            heading = int(math.degrees(self.yaw) % 360 * 100)
            return m.MAVLink_global_position_int_message(boot, lat, lon, alt, relative, vx, vy, vz, heading)
        if number == 30:
            return m.MAVLink_attitude_message(boot, 0.0, 0.0, self.yaw, 0.0, 0.0, 0.0)
        if number == 24:
            return m.MAVLink_gps_raw_int_message(
                boot * 1000, 3 if ready and self.gps else 1, lat, lon, alt, 80, 120, 0, 0, 12 if ready else 3
            )
        if number == 193:
            flags = (0x33F | (0x8000 if self.rejects() else 0)) if ready else 0x400
            place = 3.0 if self.rejects() else 0.1
            return m.MAVLink_ekf_status_report_message(flags, 0.1, place, 0.1, 0.1, 0.1)
        if number == 230:
            place = 3.0 if self.rejects() else 0.1
            return m.MAVLink_estimator_status_message(
                boot * 1000, self.flags(), 0.1, place, *[0.1] * 4, 0.5, 0.5
            )
        if number == 1:
            sensors = COMPASS | GPS
            enabled = sensors | (PREARM if self.ardupilot else 0)
            health = sensors | (PREARM if ready and self.healthy else 0)
            health &= ~((0 if self.compass else COMPASS) | (0 if self.gps else GPS))
            return m.MAVLink_sys_status_message(
                enabled, enabled, health, 300, 12000, 500, 80, 0, 0, 0, 0, 0, 0
            )
        if number == 245:
            landed = 2 if self.airborne() else 1
            return m.MAVLink_extended_sys_state_message(0, landed)
        if number == 242 and ready:
            east, north = self.home
            lat = int((LAT + north / METRES) * 1e7)
            lon = int((LON + east / METRES / math.cos(math.radians(LAT))) * 1e7)
            return m.MAVLink_home_position_message(
                lat, lon, int(SEA_M * 1000), 0, 0, 0, [1.0, 0.0, 0.0, 0.0], 0, 0, 0
            )
        if number == 32:
            x, y, z = self.local(self.place)
            return m.MAVLink_local_position_ned_message(boot, x, y, z, vx * 0.01, vy * 0.01, vz * 0.01)
        if number == 85 and self.velocity_goal is not None:
            return m.MAVLink_position_target_local_ned_message(boot, 1, 0, *[NAN] * 3, *[0.0] * 8)
        if number == 85 and self.goal is not None:
            return m.MAVLink_position_target_local_ned_message(boot, 1, 0, *self.local(self.goal), *[0.0] * 8)
        # PX4 keeps there what its own modes flew to.
        target = self.goal if self.ardupilot else self.own_goal
        if number == 87 and target is not None:
            east, north, up = target
            lat = int((LAT + north / METRES) * 1e7)
            lon = int((LON + east / METRES / math.cos(math.radians(LAT))) * 1e7)
            return m.MAVLink_position_target_global_int_message(
                boot, 5, 0xDF8, lat, lon, self.home_alt() + up, *[0.0] * 8
            )
        if number == 148:
            return m.MAVLink_autopilot_version_message(
                0x2000, 0x04060300 if self.ardupilot else 0x010000FF | self.minor << 16, 0, 0, 0,
                [0] * 8, [0] * 8, [0] * 8, 0, 0, self.system,
            )
        return None

    def report(self):
        if self.now - self.sent.get(0, -math.inf) > 1.0:
            self.sent[0] = self.now
            base = m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
            base |= m.MAV_MODE_FLAG_SAFETY_ARMED if self.armed else 0
            firmware = m.MAV_AUTOPILOT_ARDUPILOTMEGA if self.ardupilot else m.MAV_AUTOPILOT_PX4
            state = m.MAV_STATE_ACTIVE if self.armed else m.MAV_STATE_STANDBY
            state = m.MAV_STATE_CRITICAL if self.critical else state
            self.send(m.MAVLink_heartbeat_message(m.MAV_TYPE_QUADROTOR, firmware, base, self.mode, state, 3))
        if self.forwarded and self.now - self.forwarded_at > 1.0:
            self.forwarded_at = self.now
            for number in self.forwarded:
                station = m.MAVLink_heartbeat_message(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, 0, 3)
                router = m.MAVLink(self, number, 190)
                router.send(station)
                self.hear(number, station)
        for number, period in self.period.items():
            if self.now - self.sent.get(number, -math.inf) >= period:
                self.sent[number] = self.now
                self.send(self.message(number))

    def text(self, words):
        chunks = [words[at : at + 50] for at in range(0, len(words), 50)]
        self.texts += len(chunks) > 1
        number = self.texts if len(chunks) > 1 else 0
        for sequence, chunk in enumerate(chunks):
            self.send(m.MAVLink_statustext_message(m.MAV_SEVERITY_CRITICAL, chunk.encode(), number, sequence))

    def send(self, message):
        if message is None:
            return
        self.link.mav.send(message)
        try:
            self.copy.sendto(message.get_msgbuf(), self.copy_to)
        except ConnectionRefusedError:
            pass
