"""Writes the logs of autopilots that the tests read, by the published forms.

ArduPilot: libraries/AP_Logger/LogStructure.h and ardupilot.org/copter/docs/logmessages.html.
PX4: docs.px4.io/main/en/dev_log/ulog_file_format.html.
MAVLink: mavlink.io/en/guide/serialization.html and common.xml.

One flight of 180 s in lanes, and a receiver's log of the levels on it, whose clock is right
(levels.csv) or begins with the receiver (levels-own-clock.csv). numpy alone is needed: python3 make.py
"""

import datetime
import pathlib
import struct

import numpy as np

FOLDER = pathlib.Path(__file__).parent
LAT, LON, ALT = 48.2, 16.37, 200.0
METRES = 111_195.0
# 2026-06-21 14:03:00 UTC, and the time since the autopilot's start.
BEGIN = 1_782_050_580
BOOT_S = 100.0
TRUTH = np.array([60.0, 45.0])
SECONDS = 180
GPS_EPOCH = datetime.datetime(1980, 1, 6, tzinfo=datetime.timezone.utc).timestamp()
LEAP_S = 18


def place(second):
    """East and north in metres: lanes of 120 m, 30 m apart, at 4 m/s."""
    along, lane, way = 4.0 * second, 0, 120.0
    while along > way + 30:
        along -= way + 30
        lane += 1
    east = min(along, way)
    step = max(along - way, 0.0)
    return np.array([east if lane % 2 == 0 else way - east, 30.0 * lane + step])


def degrees(second):
    east, north = place(second)
    lon = LON + east / METRES / np.cos(np.radians(LAT))
    return LAT + north / METRES, lon, ALT + 30.0


# Name, type, format, labels.
DATAFLASH = [
    ("FMT", 128, "BBnNZ", "Type,Length,Name,Format,Columns"),
    ("GPS", 130, "QBBIHBcLLeffffB", "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U"),
    ("POS", 131, "QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt"),
    ("MSG", 132, "QZ", "TimeUS,Message"),
]
CODES = {"B": "B", "n": "4s", "N": "16s", "Z": "64s", "Q": "Q", "I": "I", "H": "H", "c": "h", "L": "i",
         "e": "i", "f": "f"}


def packed(letters):
    return "<" + "".join(CODES[letter] for letter in letters)


def dataflash():
    """Binary and text."""
    binary, text = b"", []
    for name, kind, letters, labels in DATAFLASH:
        length = 3 + struct.calcsize(packed(letters))
        fields = struct.pack("<BB4s16s64s", kind, length, name.encode(), letters.encode(), labels.encode())
        binary += b"\xa3\x95\x80" + fields
        text.append(f"FMT, {kind}, {length}, {name}, {letters}, {labels}")
    formats = {name: (kind, letters) for name, kind, letters, _ in DATAFLASH}

    def add(name, *values, shown):
        nonlocal binary
        kind, letters = formats[name]
        binary += bytes([0xA3, 0x95, kind]) + struct.pack(packed(letters), *values)
        text.append(f"{name}, {shown}")

    add("MSG", 0, "ArduCopter V4.6.0".encode(), shown="0, ArduCopter V4.6.0, café")
    for tick in range(5 * SECONDS + 1):
        second = tick / 5
        micros = int((BOOT_S + second) * 1e6)
        lat, lon, alt = degrees(second)
        raw = (round(lat * 1e7), round(lon * 1e7))
        if tick % 5 == 0:
            gps = BEGIN + second - GPS_EPOCH + LEAP_S
            week, ms = int(gps // 604800), int(round(gps % 604800 * 1000))
            # Another receiver, which is wrong, and times before a fix.
            for instance, off in ((0, 0), (1, 5000)):
                status = 3 if tick >= 10 or instance else 1
                values = (micros, instance, status, ms, week, 14, 80, raw[0] + off, raw[1])
                shown = f"{micros}, {instance}, {status}, {ms}, {week}, 14, 0.80, {lat:.7f}, {lon:.7f}, {alt:.2f}"
                add("GPS", *values, round(alt * 100), 4.0, 90.0, 0.0, 0.0, 1, shown=shown + ", 4, 90, 0, 0, 1")
        add("POS", micros, *raw, alt, 30.0, 30.0, shown=f"{micros}, {lat:.7f}, {lon:.7f}, {alt:.2f}, 30, 30")
        if tick == 400:
            # A gap as an SD card leaves it.
            binary += bytes(range(256)) * 3
    (FOLDER / "flight.bin").write_bytes(binary)
    (FOLDER / "flight.log").write_bytes("\r\n".join(text).encode("latin-1") + b"\r\n")


def ulog():
    """Padding at the end of a topic is described, but not written."""

    def message(kind, payload):
        return struct.pack("<HB", len(payload), ord(kind)) + payload

    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", int(BOOT_S * 1e6))
    data += message("B", bytes(40))
    data += message("I", bytes([14]) + b"char[4] sys_name" + b"PX4 ")
    formats = [
        b"vehicle_global_position:uint64_t timestamp;uint64_t timestamp_sample;double lat;double lon;float alt;"
        b"float[2] eph_epv;bool valid;uint8_t[3] _padding0;",
        b"vehicle_gps_position:uint64_t timestamp;uint64_t time_utc_usec;int32_t lat;int32_t lon;int32_t alt;"
        b"uint8_t fix_type;uint8_t[3] _padding0;",
        b"actuator:uint64_t timestamp;float[4] output;",
    ]
    for text in formats:
        data += message("F", text)
    for number, name in enumerate([b"actuator", b"vehicle_gps_position", b"vehicle_global_position"]):
        data += message("A", struct.pack("<BH", 0, number) + name)
    for tick in range(5 * SECONDS + 1):
        second = tick / 5
        micros = int((BOOT_S + second) * 1e6)
        lat, lon, alt = degrees(second)
        data += message("D", struct.pack("<HQ4f", 0, micros, 0.1, 0.2, 0.3, 0.4))
        if tick % 5 == 0:
            utc = int((BEGIN + second) * 1e6)
            data += message("D", struct.pack("<HQQiiiB", 1, micros, utc, round(lat * 1e7), round(lon * 1e7),
                                             round(alt * 1000), 3))
        data += message("D", struct.pack("<HQQddfffB", 2, micros, micros, lat, lon, alt, 0.5, 0.9, 1))
    # The log ends within a message.
    data += message("D", struct.pack("<HQ", 2, 0) + bytes(30))[:20]
    (FOLDER / "flight.ulg").write_bytes(data)


def checksum(data, seed):
    total = 0xFFFF
    for byte in data + bytes([seed]):
        low = (byte ^ total) & 0xFF
        low = (low ^ (low << 4)) & 0xFF
        total = ((total >> 8) ^ (low << 8) ^ (low << 3) ^ (low >> 4)) & 0xFFFF
    return struct.pack("<H", total)


def tlog():
    data = b""
    sequence = 0

    def add(utc, identity, payload, seed, version):
        nonlocal data, sequence
        sequence = (sequence + 1) % 256
        if version == 1:
            head = struct.pack("<BBBBB", len(payload), sequence, 1, 1, identity)
            frame = b"\xfe" + head + payload + checksum(head + payload, seed)
        else:
            # Zeros at the end are cut off.
            payload = payload.rstrip(b"\0") or b"\0"
            head = struct.pack("<BBBBBB", len(payload), 0, 0, sequence, 1, 1) + identity.to_bytes(3, "little")
            frame = b"\xfd" + head + payload + checksum(head + payload, seed)
        data += struct.pack(">Q", int(utc * 1e6)) + frame

    for tick in range(2 * SECONDS + 1):
        second = tick / 2
        lat, lon, alt = degrees(second)
        millis = int((BOOT_S + second) * 1000)
        version = 1 if tick < 40 else 2
        heartbeat = struct.pack("<IBBBBB", 0, 2, 3, 81, 4, 3)
        add(BEGIN + second, 0, heartbeat, 50, version)
        position = struct.pack("<IiiiihhhH", millis, round(lat * 1e7), round(lon * 1e7), round(alt * 1000),
                               30000, 400, 0, 0, 0)
        add(BEGIN + second, 33, position, 104, version)
        if tick == 100:
            data += b"\xfd\x00\x01noise"
    (FOLDER / "flight.tlog").write_bytes(data)


def levels():
    rng = np.random.default_rng(45)
    utc, own = ["time;rssi"], ["seconds,rssi"]
    # The receiver's clock began 20 s before the path does.
    for second in np.arange(2.5, SECONDS - 1, 1.5):
        distance = np.hypot(np.hypot(*(place(second) - TRUTH)), 30.0)
        level = -30 - 23 * np.log10(distance) + rng.normal(0, 3)
        time = datetime.datetime.fromtimestamp(BEGIN + second, datetime.timezone.utc)
        text = f"{level:.1f}".replace(".", ",")
        utc.append(f"{time:%d.%m.%Y %H:%M:%S},{time.microsecond // 100000};{text}".replace(",", ".", 1))
        own.append(f"{second + 20:.1f},{level:.1f}")
    (FOLDER / "levels.csv").write_text("\n".join(utc) + "\n")
    (FOLDER / "levels-own-clock.csv").write_text("\n".join(own) + "\n")


dataflash()
ulog()
tlog()
levels()
