"""MAVSDK reads our mission and flies our emulated PX4."""

import math
import subprocess
import sys
import time

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action
from mavsdk.plugins.mission_raw import MissionRaw
from mavsdk.plugins.offboard import Offboard, PositionNedYaw
from mavsdk.plugins.telemetry import Telemetry

PORT = 14662


def until(what, holds, limit=60.0):
    end = time.time() + limit
    while not holds():
        if time.time() > end:
            sys.exit(f"MAVSDK: {what} did not come")
        time.sleep(0.1)


emulator = subprocess.Popen(
    [sys.argv[1], "emulate", "vehicle", "--px4", "--port", str(PORT), "--speed", "2"], stdout=subprocess.DEVNULL
)
try:
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    result = mavsdk.add_any_connection(f"udpin://127.0.0.1:{PORT}")
    if result != 0:
        sys.exit(f"MAVSDK: no connection: {result!r}")
    system = mavsdk.first_autopilot(timeout_s=20.0)
    if system is None:
        sys.exit("MAVSDK: found no autopilot")
    items = MissionRaw(system).import_qgroundcontrol_mission(sys.argv[2]).mission_items
    orders = [item.command for item in items]
    if orders != [22, 178, 16, 16, 20]:
        sys.exit(f"MAVSDK: the items of the mission are {orders}")
    if [item.param1 for item in items[2:4]] != [40.0, 40.0] or items[2].z != 6.0:
        sys.exit(f"MAVSDK: another place or time: {items[2]}")
    telemetry, action, offboard = Telemetry(system), Action(system), Offboard(system)
    until("a good position", lambda: telemetry.health().is_global_position_ok and telemetry.health().is_home_position_ok)
    action.set_takeoff_altitude(6.0)
    action.arm()
    until("armed", telemetry.armed)
    action.takeoff()
    until("6 m", lambda: abs(telemetry.position().relative_altitude_m - 6.0) < 0.4)
    until("in the air", telemetry.in_air)
    until("hold", lambda: telemetry.flight_mode().name == "HOLD")
    home = telemetry.home()
    lat, lon = home.latitude_deg + 15 / 111_320, home.longitude_deg
    action.goto_location(lat, lon, home.absolute_altitude_m + 9.0, 90.0)
    until("its goal", lambda: abs(telemetry.position().latitude_deg - lat) < 4e-6
          and abs(telemetry.position().relative_altitude_m - 9.0) < 0.4)
    until("East", lambda: abs(telemetry.attitude_euler().yaw_deg - 90.0) < 4)

    # OFFBOARD is refused without set-points, and taken with them.
    try:
        offboard.start()
        sys.exit("MAVSDK: OFFBOARD without a set-point")
    except Exception:  # noqa: BLE001
        pass
    offboard.set_position_ned(PositionNedYaw(15.0, 10.0, -7.0, -120.0))
    # The first order may come before enough of them have.
    for attempt in range(5):
        try:
            offboard.start()
            break
        except Exception as error:  # noqa: BLE001
            refused = error
            time.sleep(0.5)
    else:
        sys.exit(f"MAVSDK: OFFBOARD was refused: {refused!r}")
    until("the set-point", lambda: math.hypot(telemetry.position_velocity_ned().position.north_m - 15.0,
                                              telemetry.position_velocity_ned().position.east_m - 10.0) < 0.5)
    until("-120 degrees", lambda: abs(telemetry.attitude_euler().yaw_deg + 120.0) < 4)
    offboard.stop()
    action.land()
    until("the ground", lambda: not telemetry.armed() and not telemetry.in_air())
    print("MAVSDK flew our PX4: armed, 6 m up, 15 m to the North, OFFBOARD, to 90 and -120 degrees, landed")
finally:
    emulator.kill()
    emulator.wait()
