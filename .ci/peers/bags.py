"""Writes bags with rosbags (MCAP and SQLite), has foxhunt convert them, and compares row by row.

usage: bags.py FOLDER FOXHUNT
"""

import csv
import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

BEGIN_S = 1_790_000_000
FOX = (30.0, 80.0)
LAT, LON = 50.0755, 14.4378


def typestore():
    store = get_typestore(Stores.ROS2_HUMBLE)
    text = Path("hardware/ros/foxhunt_msgs/msg/Reception.msg").read_text()
    store.register(get_types_from_msg(text, "foxhunt_msgs/msg/Reception"))
    return store


def header(store, time_ns):
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](sec=time_ns // 10**9, nanosec=time_ns % 10**9)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id="map")


def way(t):
    """A square of 100 m, flown in 80 s."""
    side, along = divmod(t % 80, 20)
    along *= 5
    return [(along, 0), (100, along), (100 - along, 100), (0, 100 - along)][int(side)]


def pose(store, time_ns, t):
    types = store.types
    east, north = way(t)
    yaw = 0.1 * t
    return types["geometry_msgs/msg/PoseStamped"](
        header=header(store, time_ns),
        pose=types["geometry_msgs/msg/Pose"](
            position=types["geometry_msgs/msg/Point"](x=float(east), y=float(north), z=20.0),
            orientation=types["geometry_msgs/msg/Quaternion"](
                x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2)
            ),
        ),
    )


def fix(store, time_ns, t):
    types = store.types
    east, north = way(t)
    return types["sensor_msgs/msg/NavSatFix"](
        header=header(store, time_ns),
        # The fix is lost for the first two seconds.
        status=types["sensor_msgs/msg/NavSatStatus"](status=-1 if t < 2 else 0, service=1),
        latitude=LAT + north / 111_227.0,
        longitude=LON + east / (111_412.0 * math.cos(math.radians(LAT))),
        altitude=300.0,
        position_covariance=np.zeros(9),
        position_covariance_type=0,
    )


def level(t):
    east, north = way(t)
    return -30.0 - 27.0 * math.log10(math.dist((east, north, 20.0), (*FOX, 0.0)))


def reception(store, time_ns, t):
    east, north = way(t)
    message = dict(
        header=header(store, time_ns), beacon=1, heard=t != 5, reason="",
        position=store.types["geometry_msgs/msg/Point"](x=float(east), y=float(north), z=20.0),
        heading=0.5, pitch=0.0, roll=0.0, position_sigma=np.array([1.0, 1.0, 2.0]),
        rss_dbm=level(t), rss_sigma_db=4.0, has_bearing=t % 2 == 0,
        bearing=math.atan2(FOX[1] - north, FOX[0] - east), bearing_sigma=0.2, bearing_confidence=0.8,
        covariance=0.0, mode_weights=np.array([]), mode_bearings=np.array([]), mode_sigmas=np.array([]),
        velocity=np.array([]), quantity_names=[], quantity_values=np.array([]),
        quantity_sigmas=np.array([]),
    )
    return store.types["foxhunt_msgs/msg/Reception"](**message)


def bag(folder, plugin, topics):
    """A bag of topics: name, type, period in seconds, message of a time."""
    store = typestore()
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        for name, of, period, message in topics:
            connection = writer.add_connection(name, of, typestore=store)
            for step in range(int(80 / period)):
                t = step * period
                time_ns = BEGIN_S * 10**9 + round(t * 1e9)
                data = store.serialize_cdr(message(store, time_ns, t), of)
                writer.write(connection, time_ns, data)
    [file] = [file for file in folder.iterdir() if file.suffix in (".mcap", ".db3")]
    return file


def run(foxhunt, *args, code=0):
    ran = subprocess.run([foxhunt, "--json", *map(str, args)], capture_output=True, text=True)
    assert ran.returncode == code, (args, ran)
    return json.loads(ran.stdout) if code == 0 else ran.stderr


def rows(file):
    with open(file, newline="") as text:
        return list(csv.DictReader(text))


def main():
    out, foxhunt = Path(sys.argv[1]), sys.argv[2]
    float32 = lambda store, time_ns, t: store.types["std_msgs/msg/Float32"](data=level(t))
    text = lambda store, time_ns, t: store.types["std_msgs/msg/String"](data="not read")
    chatter = ("/chatter", "std_msgs/msg/String", 10, text)
    rssi = ("/rssi", "std_msgs/msg/Float32", 0.3, float32)
    poses = ("/uav/pose", "geometry_msgs/msg/PoseStamped", 0.5, pose)
    fixes = ("/uav/fix", "sensor_msgs/msg/NavSatFix", 0.5, fix)

    for plugin in (StoragePlugin.MCAP, StoragePlugin.SQLITE3):
        name = plugin.name.lower()
        csv_file = out / f"{name}.csv"
        # Poses and levels.
        file = bag(out / f"{name}-poses", plugin, [chatter, rssi, poses])
        report = run(foxhunt, "convert", file, csv_file, "--rssi-topic", "/rssi=fox")
        read = rows(csv_file)
        assert report["rows"] == len(read) > 260, report
        for row in read:
            t = float(row["time_utc"]) - BEGIN_S
            # Corners lie on poses, so that straight lines between poses are the way.
            east, north = way(t)
            assert math.dist((east, north), (float(row["east_m"]), float(row["north_m"]))) < 1e-3, row
            assert abs(float(row["rss_dbm"]) - level(t)) < 1e-5, row
            nose = 90 - math.degrees(0.1 * t)
            off = (float(row["heading_deg_compass"]) - nose + 180) % 360 - 180
            assert abs(off) < 1e-3, row
            assert row["beacon"] == "fox"
        found = run(foxhunt, "locate", csv_file)["estimate"]
        assert math.dist((found["east_m"], found["north_m"]), FOX) < 15, found

        # Fixes: those without one are left out, and what has none near it.
        file = bag(out / f"{name}-fixes", plugin, [rssi, fixes, poses])
        error = run(foxhunt, "convert", file, csv_file, code=2)
        assert "--pose-topic" in error and "/uav/fix, /uav/pose" in error, error
        report = run(foxhunt, "convert", file, csv_file, "--pose-topic", "/uav/fix")
        assert report["without_place"] >= 7, report
        for row in rows(csv_file):
            t = float(row["time_utc"]) - BEGIN_S
            east, north = way(t)
            assert abs(float(row["lat_deg"]) - LAT - north / 111_227.0) < 1e-8, row
            assert t >= 2 and float(row["alt_m"]) == 300.0, row
        error = run(foxhunt, "convert", file, csv_file, "--pose-topic", "/rssi", code=2)
        assert "/rssi" in error and "sensor_msgs/msg/NavSatFix" in error, error

        # foxhunt's own receptions.
        own = ("/uav1/reception", "foxhunt_msgs/msg/Reception", 1, reception)
        file = bag(out / f"{name}-own", plugin, [own])
        report = run(foxhunt, "convert", file, csv_file)
        read = rows(csv_file)
        # One of them read nothing.
        assert report["rows"] == len(read) == 79, report
        for row in read:
            t = round(float(row["time_utc"]) - BEGIN_S)
            assert row["drone"] == "uav1/reception" and row["beacon"] == "beacon 2", row
            assert abs(float(row["rss_dbm"]) - level(t)) < 1e-9, row
            assert bool(row["bearing_deg_compass"]) == (t % 2 == 0), row
            if row["bearing_deg_compass"]:
                east, north = way(t)
                true = math.degrees(math.atan2(FOX[0] - east, FOX[1] - north)) % 360
                assert abs((float(row["bearing_deg_compass"]) - true + 180) % 360 - 180) < 1e-6, row
        found = run(foxhunt, "locate", csv_file, "--estimator", "bearing-grid")["estimate"]
        assert math.dist((found["east_m"], found["north_m"]), FOX) < 5, found
        print(f"{name}: poses, fixes and receptions read as they were written")

        # A bag that is cut off is refused, not half read.
        cut = out / f"cut{file.suffix}"
        cut.write_bytes(file.read_bytes()[:-file.stat().st_size // 2])
        assert "cut" in run(foxhunt, "convert", cut, csv_file, code=2)


if __name__ == "__main__":
    main()
