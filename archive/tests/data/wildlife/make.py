"""Writes the files of this folder: Lotek's receivers beside the walk of ../shapes, and bearings as sigloc has them.

The tag is at 48.2009 N, 16.3715 E; the receiver goes around it at 4 m/s. Lotek's power is a quarter of a decibel a
unit. Bearings are in UTM metres.
"""

import csv
import datetime
import math
from pathlib import Path

FOLDER = Path(__file__).parent
BEGIN = datetime.datetime(2026, 6, 21, 14, 3, 0)
NORTH_M = 111_200.0
EAST_M = NORTH_M * math.cos(math.radians(48.2))


def walk():
    """Second, latitude, longitude and level in dB of every fifth second."""
    for second in range(0, 200, 5):
        along = 4.0 * (second % 100)
        north, east = (0.0, along) if second < 100 else (150.0, 400.0 - along)
        away = math.hypot(north - 100.0, east - 111.0)
        level = 100.0 - 25.0 * math.log10(max(away, 1.0)) + 1.5 * math.sin(1.7 * second)
        yield second, 48.2 + north / NORTH_M, 16.37 + east / EAST_M, level


def srx800():
    lines = [
        "SRX800 Receiver Information:",
        "Receiver S/N: 2345",
        "Code Set: Lotek4",
        "",
        "Environment History:",
        "changed: 06/21/26 14:00:00",
        "",
        "Active scan_table:",
        "CHANNEL  FREQUENCY  STATUS  TYPE",
        "0        166.380    ON      CODED",
        "",
        "Antenna   Gain",
        "A1        80",
        "",
        "** Data Segment **",
        "",
        "ID Only Records:",
        "",
        "  Date      Time            Channel  Tag ID  Antenna     Power",
    ]
    for second, _, _, level in walk():
        time = BEGIN + datetime.timedelta(seconds=second, milliseconds=489)
        stamp = time.strftime("%m/%d/%y  %H:%M:%S.%f")[:-2]
        lines.append(f"{stamp}         0     393    A1          {round(4 * level):5}")
        if second % 50 == 0:
            lines.append(f"{stamp}         0     999    A1            180")
    (FOLDER / "srx800.DTA").write_text("\r\n".join(lines) + "\r\n")


def srx1200():
    lines = ["SRX1200 Data Export", "Firmware 2.1", ""]
    lines.append("Index,Date,Time,[uSec],TagID/BPM,Freq [MHz],Codeset,Antenna,Gain,RSSI,Latitude,Longitude")
    for index, (second, lat, lon, level) in enumerate(walk()):
        time = BEGIN + datetime.timedelta(seconds=second)
        tag = 999 if index == 3 else 393
        stamp = time.strftime("%m/%d/%Y,%H:%M:%S")
        lines.append(f"{index},{stamp},489000,{tag},166.380,Lotek4,A1,80,{level - 160:.1f},{lat:.7f},{lon:.7f}")
    lines += ["", "Battery Report", "06/21/2026 14:10:00,12.6 V"]
    (FOLDER / "srx1200.csv").write_text("\n".join(lines) + "\n")


def sigloc():
    """Two groups of three bearings, a place of the animal each."""
    places = {1: (602_040.0, 5_340_110.0), 2: (602_410.0, 5_339_870.0)}
    stations = [(601_500.0, 5_339_400.0), (602_900.0, 5_339_500.0), (602_300.0, 5_340_900.0)]
    errors = iter([1.5, -2.0, 0.5, -1.0, 2.5, -0.5])
    with (FOLDER / "bear.csv").open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["Date", "Observers", "GID", "Time", "Easting", "Northing", "Azimuth"])
        for group, (east, north) in places.items():
            for number, (x, y) in enumerate(stations):
                azimuth = math.degrees(math.atan2(east - x, north - y)) + next(errors)
                clock = f"{8 + group}:{10 * number:02}"
                rows.writerow([f"6/{group}/2011", "SB and JS", group, clock, x, y, f"{azimuth % 360:.1f}"])


if __name__ == "__main__":
    srx800()
    srx1200()
    sigloc()
