"""Two strict PX4s that our driver flies, one after the other: 1.18 and 1.15, with the zero of their
estimators 2.5 m above and below home and drifting. In OFFBOARD the link of each is down for 2.5 s."""

import time

from strict_autopilot import Autopilot

STEP = 0.02
drones = [
    Autopilot("px4", 1, (0.0, 0.0), 14664, 14674, minor=18, reference=2.5, drift=-0.02),
    Autopilot("px4", 2, (5.0, 0.0), 14665, 14675, minor=15, reference=-2.5, drift=0.02),
]
offboard, down = {}, None
begun = time.monotonic()
# They tell that they are down.
while down is None or time.monotonic() - down < 3.0:
    before = time.monotonic()
    if down is None and all(drone.flown and not drone.armed for drone in drones):
        down = before
    assert before - begun < 280.0, "the flights do not end"
    for drone in drones:
        drone.step(STEP)
        if drone.is_in("GUIDED"):
            since = before - offboard.setdefault(drone.system, before)
            drone.deaf = drone.unheard = 4.0 < since < 6.5
        elif not drone.armed:
            drone.deaf = drone.unheard = False
    time.sleep(max(0.0, STEP - (time.monotonic() - before)))
for drone in drones:
    print(
        f"PX4 1.{drone.minor}, zero {drone.reference:+.1f} m above home: off in height {drone.worst_up:.2f} m, "
        f"failsafes {drone.failsafes}, refused {drone.refused}"
    )
    assert drone.worst_up < 0.3 and not drone.failsafes
