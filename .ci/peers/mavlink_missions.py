"""pymavlink reads the missions that `fly --mission-to` writes."""

import math
import pathlib
import subprocess
import sys

from pymavlink.mavwp import MAVWPLoader

foxhunt, folder = sys.argv[1], pathlib.Path(sys.argv[2])
flight = folder / "meadow.toml"
flight.write_text("""
name = "meadow"
site = { lat_deg = 50.0, lon_deg = 14.0 }
beacons = [{ name = "fox", address = "0013A20041234567" }]
model = { reference_dbm = -29.06, exponent = 2.765, antenna = "dipole" }
extractor = { kind = "maximum-likelihood", antenna = "dipole" }
planner = { kind = "waypoints", places_m = [[100.0, 0.0], [0.0, -200.0]], up_m = 6.0 }

[[drones]]
name = "alpha"
launch_m = [0.0, 0.0]
vehicle = { kind = "mavlink", endpoint = "udpin:127.0.0.1:14550", settings = { cruise_speed_mps = 3.0 } }
radio = { kind = "xbee", endpoint = "serial:/dev/ttyUSB0:57600" }
rotator = { kind = "firmata", endpoint = "serial:/dev/ttyUSB1:57600" }
source = { kind = "stepper", position_timeout = 1.0, first_timeout = 10.0 }
""")
for name in ["meadow.plan", "meadow.waypoints"]:
    mission = ["fly", str(flight), "--mission-to", str(folder / name), "--hold-s", "40"]
    subprocess.run([foxhunt, *mission], check=True, stdin=subprocess.DEVNULL)

loader = MAVWPLoader()
count = loader.load(str(folder / "meadow.waypoints"))
items = [loader.wp(index) for index in range(count)]
orders = [item.command for item in items]
if orders != [16, 22, 178, 16, 16, 20]:
    sys.exit(f"pymavlink: the items are {orders}")
first, second = items[3], items[4]
# Metres of an arc on WGS84 at 50 degrees North: 71 696 a degree of longitude, 111 229 of latitude.
east, north = (first.y - 14.0) * 71_696, (second.x - 50.0) * 111_229
if math.hypot(east - 100.0, north + 200.0) > 0.1:
    sys.exit(f"pymavlink: the places are {east:.2f} m East and {north:.2f} m North")
if (first.param1, first.z, first.frame) != (40.0, 6.0, 3) or items[2].param2 != 3.0:
    sys.exit(f"pymavlink: another time, height or speed: {first}")
print("pymavlink read our mission: take-off, speed, two places, return")
