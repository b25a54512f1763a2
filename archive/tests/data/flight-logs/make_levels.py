"""Writes short logs with levels of a transmitter among an autopilot's messages.

levels.tlog is written by pymavlink; levels.bin and levels.ulg by the published forms, and read again by
pymavlink and pyulog, which share no code with the reader. Run: python3 make_levels.py
"""

import io
import math
import pathlib
import random
import struct

from pymavlink import DFReader
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pyulog import ULog

FOLDER = pathlib.Path(__file__).parent
LAT, LON, ALT, METRES = 48.2, 16.37, 200.0, 111_195.0
BEGIN, BOOT_S, SECONDS = 1_782_050_580, 100.0, 150
# East and North in metres.
TRUTH = (60.0, 45.0)
GPS_EPOCH, LEAP_S = 315_964_800, 18


def place(second):
    """Lanes of 120 m, 30 m apart, at 4 m/s."""
    along, lane = 4.0 * second, 0
    while along > 150:
        along -= 150
        lane += 1
    east = min(along, 120.0)
    return east if lane % 2 == 0 else 120 - east, 30.0 * lane + max(along - 120, 0.0)


def degrees(second):
    east, north = place(second)
    return LAT + north / METRES, LON + east / METRES / math.cos(math.radians(LAT)), ALT + 30


rng = random.Random(45)


def dbm(second):
    east, north = place(second)
    distance = math.hypot(math.hypot(east - TRUTH[0], north - TRUTH[1]), 30)
    return -40 - 25 * math.log10(distance) + rng.gauss(0, 1.5)


LEVELS = [dbm(second) for second in range(SECONDS)]
SIK = [round((level + 127) * 1.9) for level in LEVELS]


def tlog():
    out = io.BytesIO()

    class Sink:
        def write(self, data):
            out.write(struct.pack(">Q", int(now * 1e6)) + data)

    link = mavlink.MAVLink(Sink(), srcSystem=1, srcComponent=1)
    radio = mavlink.MAVLink(Sink(), srcSystem=51, srcComponent=68)
    for second in range(SECONDS):
        now = BEGIN + second
        lat, lon, alt = degrees(second)
        millis = int((BOOT_S + second) * 1000)
        link.heartbeat_send(2, 3, 81, 4, 3)
        link.global_position_int_send(millis, round(lat * 1e7), round(lon * 1e7), round(alt * 1000), 30000, 0, 0, 0, 0)
        radio.radio_status_send(SIK[second], 150, 100, 40, 35, 0, 0)
        link.named_value_float_send(millis, b"vhf_dbm", LEVELS[second])
    (FOLDER / "levels.tlog").write_bytes(out.getvalue())


def dataflash():
    kinds = {
        "GPS": (130, "QBBIHBcLLe", "<QBBIHBhiii", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt"),
        "RAD": (133, "QBBBBBHH", "<QBBBBBHH", "TimeUS,RSSI,RemRSSI,TxBuf,Noise,RemNoise,RxErrors,Fixed"),
        "RSSI": (134, "Qff", "<Qff", "TimeUS,RXRSSI,RXLQ"),
    }
    data = b""

    def described(kind, name, letters, labels, length):
        values = struct.pack("<BB4s16s64s", kind, length, name.encode(), letters.encode(), labels.encode())
        return b"\xa3\x95\x80" + values

    data += described(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns", 89)
    for name, (kind, letters, packed, labels) in kinds.items():
        data += described(kind, name, letters, labels, 3 + struct.calcsize(packed))

    def message(name, *values):
        kind, _, packed, _ = kinds[name]
        return bytes([0xA3, 0x95, kind]) + struct.pack(packed, *values)

    for second in range(SECONDS):
        micros = int((BOOT_S + second) * 1e6)
        lat, lon, alt = degrees(second)
        gps = BEGIN + second - GPS_EPOCH + LEAP_S
        data += message("GPS", micros, 0, 3, gps % 604800 * 1000, gps // 604800, 14, 80, round(lat * 1e7),
                        round(lon * 1e7), round(alt * 100))
        data += message("RAD", micros, SIK[second], 150, 100, 40, 35, 0, 0)
        data += message("RSSI", micros, 0.5, 1.0)
    (FOLDER / "levels.bin").write_bytes(data)
    log = DFReader.DFReader_binary(str(FOLDER / "levels.bin"))
    read = [m.RSSI for m in iter(lambda: log.recv_match(type="RAD"), None)]
    assert read == SIK, "pymavlink reads other levels"


def ulog():
    def message(kind, payload):
        return struct.pack("<HB", len(payload), ord(kind)) + payload

    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", int(BOOT_S * 1e6)) + message("B", bytes(40))
    for text in (b"sensor_gps:uint64_t timestamp;uint64_t time_utc_usec;double latitude_deg;double longitude_deg;"
                 b"double altitude_msl_m;uint8_t fix_type;uint8_t[7] _padding0;",
                 b"radio_status:uint64_t timestamp;uint16_t rxerrors;uint16_t fix;uint8_t rssi;uint8_t remote_rssi;"
                 b"uint8_t[2] _padding0;"):
        data += message("F", text)
    for number, name in enumerate([b"sensor_gps", b"radio_status"]):
        data += message("A", struct.pack("<BH", 0, number) + name)
    for second in range(SECONDS):
        micros = int((BOOT_S + second) * 1e6)
        lat, lon, alt = degrees(second)
        data += message("D", struct.pack("<HQQdddB", 0, micros, (BEGIN + second) * 1_000_000, lat, lon, alt, 3))
        data += message("D", struct.pack("<HQHHBB", 1, micros, 0, 0, SIK[second], 0))
    (FOLDER / "levels.ulg").write_bytes(data)
    topics = {topic.name: topic.data for topic in ULog(str(FOLDER / "levels.ulg")).data_list}
    assert list(topics["radio_status"]["rssi"]) == SIK, "pyulog reads other levels"


tlog()
dataflash()
ulog()
