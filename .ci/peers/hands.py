"""Two strict autopilots of another program, each alone: foxhunt stops hearing them while its orders
still arrive, is broken off, and the pilot takes them. Nothing is ordered any more, the heartbeats of
the station end, and the flight ends with the pilot's name when it is heard again."""

import pathlib
import signal
import subprocess
import sys
import tempfile
import time

from strict_autopilot import LAT, LON, Autopilot, m

FOXHUNT = sys.argv[1]
STEP = 0.02
LINK_TIMEOUT = 3.5
# Modes and motors.
ORDERS = {m.MAV_CMD_DO_SET_MODE, m.MAV_CMD_COMPONENT_ARM_DISARM, m.MAV_CMD_NAV_TAKEOFF,
          m.MAV_CMD_NAV_LAND, m.MAV_CMD_NAV_RETURN_TO_LAUNCH}


class OneWay(Autopilot):
    """An autopilot whose own messages may be lost, and whose orders are counted."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.mute, self.orders, self.beats = False, [], []

    def send(self, message):
        if not self.mute:
            super().send(message)

    def take(self, message):
        kind = message.get_type()
        if kind == "HEARTBEAT":
            self.beats.append(self.now)
        if kind == "COMMAND_LONG" and message.command in ORDERS:
            self.orders.append((self.now, m.enums["MAV_CMD"][message.command].name, message.param2))
        super().take(message)

    def failsafe(self):
        # FS_OPTIONS is 16, and PX4 has none for a lost station: the pilot's modes go on.
        if not self.is_in("LOITER"):
            super().failsafe()


def fly(kind, port):
    folder = pathlib.Path(tempfile.mkdtemp())
    drone = OneWay(kind, 1, (0.0, 0.0), port, port + 1)
    (folder / "foreign.toml").write_text(f"""
site = {{ lat_deg = {LAT}, lon_deg = {LON} }}
[[vehicles]]
flown = "udpin:127.0.0.1:{port}"
pose = "udpin:127.0.0.1:{port + 1}"
""")
    field = subprocess.Popen(
        [FOXHUNT, "emulate", "field", "--scenario", "one-drone", "--faults", folder / "foreign.toml",
         "--config", folder / "field.toml"],
        stdout=subprocess.DEVNULL,
    )
    flight, begun, muted, broken, taken = None, time.monotonic(), None, None, None
    messages = folder / "messages.txt"
    try:
        while flight is None or flight.poll() is None:
            before = time.monotonic()
            drone.step(STEP)
            if flight is None and (folder / "field.toml").exists() and before - begun > 3.0:
                flight = subprocess.Popen(
                    [FOXHUNT, "fly", folder / "field.toml", "--yes", "--out", folder / "out"],
                    stdout=subprocess.DEVNULL, stderr=open(messages, "w"),
                )
            if muted is None and drone.is_in("GUIDED") and drone.positioned and before - drone.positioned > 5.0:
                muted, drone.mute = before, True
            if muted and broken is None and before - muted > 1.0:
                broken = before
                flight.send_signal(signal.SIGINT)
            if broken and taken is None and before - broken > 1.0:
                taken = before
                drone.pilot("LOITER")
            if muted and before - muted > 25.0:
                drone.mute = False
            assert before - begun < 150.0, f"{kind}: the flight does not end\n{messages.read_text()}"
            time.sleep(max(0.0, STEP - (time.monotonic() - before)))
    finally:
        field.terminate()
        if flight is not None and flight.poll() is None:
            flight.kill()
    words = messages.read_text()
    late = [order for order in drone.orders if order[0] > taken]
    blind = [order for order in drone.orders if muted + 0.7 < order[0] <= taken]
    beats = [at - muted for at in drone.beats if muted + LINK_TIMEOUT + 1.2 < at < muted + 25.0]
    print(f"{kind}: {len(late)} orders after the pilot took it, {len(blind)} unheard before, "
          f"{len(beats)} heartbeats after the limit, over {time.monotonic() - muted:.0f} s after the silence began")
    assert not late and not blind, f"{kind}: {late} {blind}\n{words}"
    assert not beats, f"{kind}: {beats}\n{words}"
    assert drone.is_in("LOITER") and drone.airborne(), words
    assert "is left to its pilot" in words, words


for kind, port in (("ardupilot", 14771), ("px4", 14781)):
    fly(kind, port)
