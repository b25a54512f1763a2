"""An autopilot that MAVSDK serves: it answers arming, modes, take-off and landing, and reports
where it is. What flies is a point. Ends after a flight, or when it is killed."""

import json
import math
import time

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action_server import ActionServer, AllowableFlightModes, FlightMode
from mavsdk.plugins.mavlink_direct_server import MavlinkDirectServer
from mavsdk.plugins import telemetry_server as t

LAT, LON, ALT = 47.397742, 8.545594, 488.0
PORT = 14663

mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.AUTOPILOT))
result = mavsdk.add_any_connection(f"udpout://127.0.0.1:{PORT}")
assert result == 0, f"no connection: {result!r}"
server = mavsdk.server_component()
telemetry, action, direct = t.TelemetryServer(server), ActionServer(server), MavlinkDirectServer(server)
action.set_allow_takeoff(True)
action.set_armable(True, True)
action.set_disarmable(True, True)
action.set_allowable_flight_modes(AllowableFlightModes(*[True] * 7))

north, east, up, yaw = 0.0, 0.0, 0.0, 0.5
goal = [0.0, 0.0, 0.0, 0.5]
armed, mode = False, None


def on_arm(result, command, *_):
    global armed
    armed = bool(command.arm)


def on_takeoff(result, take_off, *_):
    # The callback has no altitude.
    goal[2] = 6.0
    action.set_flight_mode_internal(FlightMode.HOLD)


def on_mode(result, new, *_):
    global mode
    mode = new
    if new == FlightMode.LAND:
        goal[2] = 0.0


def on_target(message, *_):
    fields = json.loads(message.fields_json)
    if mode != FlightMode.OFFBOARD:
        return
    goal[0] = (fields["lat_int"] * 1e-7 - LAT) * 111_320
    goal[1] = (fields["lon_int"] * 1e-7 - LON) * 111_320 * math.cos(math.radians(LAT))
    # MAV_FRAME_GLOBAL_INT is above sea level.
    goal[2] = fields["alt"] - (ALT if fields["coordinate_frame"] == 5 else 0.0)
    if not int(fields["type_mask"]) & 0x400:
        goal[3] = fields["yaw"]


action.subscribe_arm_disarm(on_arm)
action.subscribe_takeoff(on_takeoff)
action.subscribe_flight_mode_change(on_mode)
direct.subscribe_message("SET_POSITION_TARGET_GLOBAL_INT", on_target)
action.set_flight_mode_internal(FlightMode.HOLD)


def towards(value, target, most):
    return value + max(-most, min(most, target - value))


STEP = 0.05
begun = time.time()
while time.time() - begun < 280:
    if armed:
        north, east = towards(north, goal[0], 4 * STEP), towards(east, goal[1], 4 * STEP)
        up, yaw = towards(up, goal[2], 2 * STEP), towards(yaw, goal[3], 1.0 * STEP)
        if mode == FlightMode.LAND and up == 0.0:
            armed = False
            action.set_armed_state(False)
    lat = LAT + north / 111_320
    lon = LON + east / (111_320 * math.cos(math.radians(LAT)))
    still = t.VelocityNed(0.0, 0.0, 0.0)
    telemetry.publish_position(t.Position(lat, lon, ALT + up, up), still, t.Heading(math.degrees(yaw) % 360))
    telemetry.publish_attitude(t.EulerAngle(0.0, 0.0, math.degrees(yaw), 0), t.AngularVelocityBody(0.0, 0.0, 0.0))
    telemetry.publish_raw_gps(
        t.RawGps(0, lat, lon, ALT + up, 0.7, 1.2, 0.0, 0.0, ALT + up, 0.4, 0.6, 0.1, 1.0, 0.0),
        t.GpsInfo(12, t.FixType.FIX_3D))
    telemetry.publish_home(t.Position(LAT, LON, ALT, 0.0))
    telemetry.publish_sys_status(t.Battery(11.8, 0.9), True, True, True, True, True)
    landed = t.LandedState.IN_AIR if up > 0.3 else t.LandedState.ON_GROUND
    telemetry.publish_extended_sys_state(t.VtolState.UNDEFINED, landed)
    time.sleep(STEP)
