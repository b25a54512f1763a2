"""Two strict autopilots of another program fly a hunt: our radios and motors go where their telemetry
is, and our `fly` gives the orders. A pilot takes the first drone over on the way, and gives it back."""

import json
import pathlib
import re
import subprocess
import sys
import tempfile
import time

from strict_autopilot import LAT, LON, Autopilot

FOXHUNT = sys.argv[1]
SCENARIO = pathlib.Path(__file__).with_name("follow.toml")
FOX = (28.0, 22.0)
CRUISE = 3.0
STEP = 0.02

folder = pathlib.Path(tempfile.mkdtemp())
drones = [
    Autopilot("ardupilot", 1, (0.0, 0.0), 14671, 14672),
    Autopilot("px4", 2, (8.0, 0.0), 14681, 14682, minor=18, reference=2.5, drift=-0.02),
]
(folder / "foreign.toml").write_text(f"""
site = {{ lat_deg = {LAT}, lon_deg = {LON} }}
[[vehicles]]
flown = "udpin:127.0.0.1:14671"
pose = "udpin:127.0.0.1:14672"
[[vehicles]]
flown = "udpin:127.0.0.1:14681"
pose = "udpin:127.0.0.1:14682"
""")
field = subprocess.Popen(
    [FOXHUNT, "emulate", "field", "--scenario", SCENARIO, "--faults", folder / "foreign.toml",
     "--config", folder / "field.toml"],
    stdout=subprocess.DEVNULL,
)
flight, begun, taken = None, time.monotonic(), None
try:
    while flight is None or flight.poll() is None:
        before = time.monotonic()
        for drone in drones:
            drone.step(STEP)
        written = folder / "field.toml"
        if flight is None and written.exists() and before - begun > 3.0:
            text = written.read_text()
            text, count = re.subn(r"(\[drones\.vehicle\.settings\]\n)", rf"\1cruise_speed_mps = {CRUISE}\n", text)
            assert count == 2, text
            written.write_text(text)
            flight = subprocess.Popen(
                [FOXHUNT, "fly", written, "--yes", "--json", "--out", folder / "out"],
                stdout=open(folder / "result.json", "w"), stderr=open(folder / "messages.txt", "w"),
            )
        first = drones[0]
        if taken is None and first.is_in("GUIDED") and first.airborne() and first.fastest[-1] > 1.0:
            taken = before
            first.pilot("LOITER")
        elif taken and taken > 0 and before - taken > 5.0:
            first.pilot("GUIDED")
            taken = -1.0
        assert field.poll() is None, "there is no field"
        assert before - begun < 420.0, "the flight does not end"
        time.sleep(max(0.0, STEP - (time.monotonic() - before)))
    for _ in range(200):
        for drone in drones:
            drone.step(STEP)
        time.sleep(STEP)
finally:
    field.terminate()
    if flight is not None and flight.poll() is None:
        flight.terminate()

messages = (folder / "messages.txt").read_text()
for drone in drones:
    print(f"{drone.kind}: fastest {drone.fastest}, off in height {drone.worst_up:.2f} m, failsafes {drone.failsafes}, refused {drone.refused}")
assert flight.returncode == 0, messages
result = json.loads((folder / "result.json").read_text())
estimate = result["beacons"][0]["estimate"]
east, north = estimate["east_m"] - FOX[0], estimate["north_m"] - FOX[1]
(a, b), (_, d) = estimate["covariance_m2"]
nees = (d * east**2 - 2 * b * east * north + a * north**2) / (a * d - b * b)
print(f"found {east:.2f} m East and {north:.2f} m North of the truth, NEES {nees:.1f}, in {time.monotonic() - begun:.0f} s")
# One in ten thousand is above, of two degrees of freedom.
assert nees < 18.4, messages
assert taken == -1.0, "the pilot never had it"
for drone in drones:
    assert drone.flown and not drone.armed and not drone.airborne(), f"{drone.kind} is not down:\n{messages}"
    assert not drone.failsafes, f"{drone.kind}: {drone.failsafes}"
    assert drone.worst_up < 0.3, f"{drone.kind} was {drone.worst_up:.2f} m from the height of a goal"
    assert drone.disturbed == 0, f"{drone.disturbed} datagrams came to {drone.kind}'s telemetry"
assert len(drones[0].fastest) >= 2, "it was given back"
assert all(0.5 < fastest < CRUISE * 1.1 for fastest in drones[0].fastest), "the ordered speed"
