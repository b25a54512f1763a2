"""Pulses that were heard through SoapySDR, held against those that were played."""

import csv
import json
import sys

import numpy as np

LOST, SILENT = (8.0, 8.6), 15.0

heard = json.load(open(sys.argv[1]))
played = [row for row in csv.DictReader(open(sys.argv[2])) if row["tag"] != "weak"]
times = np.array([pulse["time_s"] for pulse in heard["pulses"]])
hertz = np.array([pulse["frequency_hz"] for pulse in heard["pulses"]])
levels = np.array([pulse["power_dbm"] for pulse in heard["pulses"]])
rows = [(float(row["time_s"]), float(row["frequency_hz"]), float(row["power_dbm"])) for row in played]

# The first samples are left out while the receiver settles: what is heard first is found by the gaps.
# A pulse near the first sample may be without its beginning.
first = [t for t, f, _ in rows if t > 1.0]
best = max((t - u for t in first for u in times[1:5]),
           key=lambda d: sum(np.any(np.abs(times + d - t) < 2e-3) for t, _, _ in rows if t < LOST[0]))
rows = [row for row in rows if row[0] > best + 0.02]
off = {"before": [], "after a loss": [], "after a silence": []}
missed, resumed = [], None
for time, frequency, power in rows:
    near = (np.abs(times + best - time) < 0.1) & (np.abs(hertz - frequency) < 100.0)
    part = "before" if time < LOST[0] else "after a loss" if time < SILENT else "after a silence"
    if near.any():
        at = np.argmin(np.where(near, np.abs(times + best - time), np.inf))
        off[part].append(times[at] + best - time)
        assert abs(levels[at] - power) < 0.5, (time, levels[at], power)
        if part == "after a silence" and resumed is None:
            resumed = time
    else:
        missed.append(time)
lost = heard["lost"]
known = [t for t in missed if 1.0 < t < LOST[0] - 0.1 or LOST[1] + 0.3 < t < SILENT - 0.1 or (resumed and resumed < t < 22.0)]
assert not known, f"missed: {known}"
assert all(len(part) >= 3 for part in off.values()), {name: len(part) for name, part in off.items()}
assert resumed < SILENT + 3.5, f"resumed at {resumed} s"
assert lost["stalls"] == 1 and lost["gaps"] == 2, lost
worst = {name: 1e3 * max(abs(o) for o in part) for name, part in off.items()}
assert worst["before"] < 1.0, worst
# A timestamp places what follows a loss; elsewhere it is placed by the computer's clock.
assert worst["after a loss"] < (1.0 if "/with." in sys.argv[1] else 60.0), worst
assert worst["after a silence"] < 60.0, worst
# One pulse is one.
assert len(times) <= len(rows) + 20, (len(times), len(rows))
print({name: f"{len(part)} pulses within {worst[name]:.2f} ms" for name, part in off.items()}, lost)
