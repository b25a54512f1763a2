"""pymavlink flies our emulated ArduCopter, and signs as we do."""

import math
import os
import subprocess
import sys
import time

os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil  # noqa: E402

FOXHUNT = sys.argv[1]
PORT = 14661
SPEED = 2.0
m = mavutil.mavlink


def emulate(*more):
    return subprocess.Popen(
        [FOXHUNT, "emulate", "vehicle", "--port", str(PORT), "--speed", str(SPEED), *more],
        stdout=subprocess.DEVNULL,
    )


class Station:
    """A ground station: heartbeats go out whatever is waited for."""

    def __init__(self, key=None):
        self.link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{PORT}", source_system=255)
        if key:
            self.link.setup_signing(key, sign_outgoing=True)
        self.beaten = 0.0
        self.last = {}

    def step(self):
        now = time.time()
        # The field's time is faster than ours.
        if now - self.beaten > 0.5 and self.link.address_known():
            self.beaten = now
            self.link.mav.heartbeat_send(m.MAV_TYPE_GCS, m.MAV_AUTOPILOT_INVALID, 0, 0, m.MAV_STATE_ACTIVE)
        message = self.link.recv_match(blocking=True, timeout=0.05)
        if message is not None and message.get_type() != "BAD_DATA":
            self.last[message.get_type()] = message
        return message

    def until(self, what, holds, limit=40.0):
        end = time.time() + limit
        while not holds(self.last):
            if time.time() > end:
                sys.exit(f"pymavlink: {what} did not come; the last: {self.last}")
            self.step()

    def command(self, name, *parameters):
        number = getattr(m, name)
        self.last.pop("COMMAND_ACK", None)
        values = list(parameters) + [0.0] * (7 - len(parameters))
        self.link.mav.command_long_send(1, 1, number, 0, *values)
        self.until(f"an answer to {name}", lambda l: "COMMAND_ACK" in l and l["COMMAND_ACK"].command == number, 10.0)
        return self.last["COMMAND_ACK"].result

    def order(self, name, *parameters):
        result = self.command(name, *parameters)
        if result != m.MAV_RESULT_ACCEPTED:
            sys.exit(f"pymavlink: {name} was answered {result}; the last: {self.last}")


# The socket knows where to send once something came.
mavutil.mavudp.address_known = lambda self: bool(self.clients) or self.last_address is not None


def fly():
    emulator = emulate()
    station = Station()
    try:
        station.until("a heartbeat", lambda l: "HEARTBEAT" in l)
        assert station.last["HEARTBEAT"].autopilot == m.MAV_AUTOPILOT_ARDUPILOTMEGA
        refused = station.command("MAV_CMD_NAV_TAKEOFF", 0, 0, 0, 0, 0, 0, 8)
        assert refused == m.MAV_RESULT_FAILED, "a take-off in STABILIZE"
        refused = station.command("MAV_CMD_DO_CHANGE_SPEED", 1, 1, -1)
        assert refused == m.MAV_RESULT_FAILED, "a speed in STABILIZE"
        unrequested = {t for t in station.last if t not in ("HEARTBEAT", "COMMAND_ACK", "STATUSTEXT")}
        assert not unrequested, f"sent without a request: {unrequested}"
        for name, rate in [("GLOBAL_POSITION_INT", 10), ("ATTITUDE", 10), ("EKF_STATUS_REPORT", 2), ("GPS_RAW_INT", 2)]:
            number = getattr(m, f"MAVLINK_MSG_ID_{name}")
            station.order("MAV_CMD_SET_MESSAGE_INTERVAL", number, 1e6 / rate)
        station.until("a good position", lambda l: "EKF_STATUS_REPORT" in l
                      and l["EKF_STATUS_REPORT"].flags & 0x1F == 0x1F
                      and not l["EKF_STATUS_REPORT"].flags & 0x480)
        station.order("MAV_CMD_DO_SET_MODE", m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, 4)
        station.order("MAV_CMD_COMPONENT_ARM_DISARM", 1)
        station.until("its status text", lambda l: "STATUSTEXT" in l and l["STATUSTEXT"].text == "Arming motors")
        assert station.last["STATUSTEXT"].severity == m.MAV_SEVERITY_INFO
        station.order("MAV_CMD_NAV_TAKEOFF", 0, 0, 0, 0, 0, 0, 8)
        station.until("8 m", lambda l: abs(l["GLOBAL_POSITION_INT"].relative_alt - 8000) < 500)
        station.order("MAV_CMD_DO_CHANGE_SPEED", 1, 1, -1)
        here = station.last["GLOBAL_POSITION_INT"]
        # 20 m to the North, the nose to the East.
        lat, lon = here.lat + round(20 / 111_320 * 1e7 * 1.0035), here.lon
        station.link.mav.set_position_target_global_int_send(
            0, 1, 1, m.MAV_FRAME_GLOBAL_RELATIVE_ALT_INT, 0x9F8, lat, lon, 10, 0, 0, 0, 0, 0, 0, math.pi / 2, 0)
        # A speed that was ordered before the first set-point is forgotten with it, as ArduCopter does.
        def speed(l):
            return math.hypot(l["GLOBAL_POSITION_INT"].vx, l["GLOBAL_POSITION_INT"].vy)
        station.until("its own speed", lambda l: speed(l) > 150)
        station.order("MAV_CMD_DO_CHANGE_SPEED", 1, 1, -1)
        station.until("1 m/s", lambda l: abs(speed(l) - 100) < 10)
        station.until("its goal", lambda l: abs(l["GLOBAL_POSITION_INT"].lat - lat) < 40
                      and abs(l["GLOBAL_POSITION_INT"].lon - lon) < 40
                      and abs(l["GLOBAL_POSITION_INT"].relative_alt - 10_000) < 300)
        station.until("East", lambda l: abs(math.degrees(l["ATTITUDE"].yaw) - 90) < 3)
        station.order("MAV_CMD_CONDITION_YAW", 200, 40, 0, 0)
        station.until("200 degrees", lambda l: abs(math.degrees(l["ATTITUDE"].yaw) % 360 - 200) < 3)
        station.order("MAV_CMD_NAV_LAND")
        station.until("the ground", lambda l: not l["HEARTBEAT"].base_mode & m.MAV_MODE_FLAG_SAFETY_ARMED)
        print("pymavlink flew our ArduCopter: armed, 8 m up, 20 m to the North, to 90 and 200 degrees, landed")
    finally:
        emulator.kill()
        emulator.wait()
        station.link.close()


def sign():
    key = bytes(range(32))
    emulator = emulate("--signing-key", key.hex())
    station = Station(key)
    try:
        station.until("a signed heartbeat", lambda l: "HEARTBEAT" in l)
        assert station.last["HEARTBEAT"].get_signed(), "its heartbeat is not signed"
        station.order("MAV_CMD_DO_SET_MODE", m.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, 5)
        assert station.last["COMMAND_ACK"].get_signed()
        station.until("LOITER", lambda l: l["HEARTBEAT"].custom_mode == 5)
        # The same order unsigned, and signed with another key, from the same port.
        for other in (None, bytes(32)):
            stranger = m.MAVLink(None, srcSystem=255)
            if other:
                stranger.signing.secret_key = other
                stranger.signing.sign_outgoing = True
                stranger.signing.timestamp = station.link.mav.signing.timestamp + 1_000_000
            order = stranger.command_long_encode(1, 1, m.MAV_CMD_DO_SET_MODE, 0, 1, 2, 0, 0, 0, 0, 0)
            packed = order.pack(stranger)
            station.last.pop("COMMAND_ACK", None)
            end = time.time() + 4
            while time.time() < end:
                for client in station.link.clients or [station.link.last_address]:
                    station.link.port.sendto(packed, client)
                station.step()
            assert "COMMAND_ACK" not in station.last, "a stranger's order was answered"
            assert station.last["HEARTBEAT"].custom_mode == 5, "a stranger's order was obeyed"
        print("pymavlink and we sign alike; orders without the key are not obeyed")
    finally:
        emulator.kill()
        emulator.wait()
        station.link.close()

fly()
sign()
