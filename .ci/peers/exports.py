"""Reads the exports of a hunt back, each with a reader of others, and compares them with the hunt's own result.

usage: exports.py FOLDER FOXHUNT
"""

import csv
import json
import math
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import fastkml
import gpxpy
import numpy
import pymap3d
import rasterio
import rasterio.warp
import yaml
from lxml import etree
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from shapely.geometry import shape

LAT, LON = 50.0755, 14.4378


def degrees(east, north):
    """Near the origin: metres by WGS84's radii of curvature there."""
    a, e2, lat = 6378137.0, 6.69437999014e-3, math.radians(LAT)
    w = math.sqrt(1 - e2 * math.sin(lat) ** 2)
    north_radius, east_radius = a * (1 - e2) / w**3, a / w
    return LAT + math.degrees(north / north_radius), LON + math.degrees(east / (east_radius * math.cos(lat)))


def near(lat, lon, beacon):
    true_lat, true_lon = degrees(beacon["estimate"]["east_m"], beacon["estimate"]["north_m"])
    # 1e-7 degrees are a centimetre.
    assert abs(lat - true_lat) < 1e-7 and abs(lon - true_lon) < 1e-7, (lat, lon, true_lat, true_lon)


def main():
    out = Path(sys.argv[1])
    beacons = {beacon["name"]: beacon for beacon in json.loads((out / "result.json").read_text())["beacons"]}
    assert beacons

    features = json.loads((out / "hunt.geojson").read_text())["features"]
    shapes = [(feature["properties"], shape(feature["geometry"])) for feature in features]
    assert all(geometry.is_valid for _, geometry in shapes)
    fixes = {own["name"]: geometry for own, geometry in shapes if own["kind"] == "fix"}
    assert fixes.keys() == beacons.keys()
    for name, point in fixes.items():
        near(point.y, point.x, beacons[name])
        ellipse = next(g for own, g in shapes if own["kind"] == "ellipse-95" and own["name"] == name)
        assert ellipse.contains(point) and ellipse.exterior.is_ccw
    bearings = sum(own["kind"] == "bearing" for own, _ in shapes)
    print(f"GeoJSON: {len(shapes)} valid features, {bearings} bearings")

    document = fastkml.KML.parse(out / "hunt.kml").features[0]
    folders = {folder.name: folder.features for folder in document.features}
    assert len(folders["bearing"]) == bearings
    for placemark in folders["fix"]:
        near(placemark.geometry.y, placemark.geometry.x, beacons[placemark.name])
    print(f"KML: {sum(map(len, folders.values()))} placemarks in {len(folders)} folders")

    gpx = gpxpy.parse((out / "hunt.gpx").read_text())
    for waypoint in gpx.waypoints:
        if waypoint.type == "fix":
            near(waypoint.latitude, waypoint.longitude, beacons[waypoint.name])
    segments = [segment for track in gpx.tracks if track.type == "bearing" for segment in track.segments]
    assert len(segments) == bearings and all(len(segment.points) == 2 for segment in segments)
    assert all(point.time for point in segments[0].points)
    print(f"GPX: {len(gpx.waypoints)} waypoints, {len(gpx.tracks)} tracks")

    with open(out / "hunt.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert sum(row["kind"] == "reception" and row["bearing_deg_compass"] != "" for row in rows) == bearings
    last = {row["name"]: row for row in rows if row["kind"] == "estimate"}
    for name, row in last.items():
        near(float(row["lat_deg"]), float(row["lon_deg"]), beacons[name])
    print(f"CSV: {len(rows)} rows")

    events = [etree.fromstring(line) for line in (out / "hunt.cot").read_bytes().splitlines()]
    for event in events:
        assert event.tag == "event" and event.get("version") == "2.0"
        for name in ("uid", "type", "time", "start", "stale", "how"):
            assert event.get(name), name
        point = event.find("point")
        assert all(point.get(name) is not None for name in ("lat", "lon", "hae", "ce", "le"))
        assert event.get("start") < event.get("stale")
        if event.get("type") == "a-u-G":
            near(float(point.get("lat")), float(point.get("lon")), beacons[event.find("detail/contact").get("callsign")])
    assert len({event.get("uid") for event in events}) == len(events)
    print(f"Cursor on Target: {len(events)} events")

    bag = Bag(out / "hunt.mcap")
    numbers = {name: topic.split("/")[2] for topic, name in bag.names.items() if "/beacon_" in topic}
    assert numbers.keys() == beacons.keys()
    for name, beacon in beacons.items():
        fix = bag.messages[f"/foxhunt/{numbers[name]}/fix"][-1]
        near(fix.latitude, fix.longitude, beacon)
        estimate = bag.messages[f"/foxhunt/{numbers[name]}/estimate"][-1].pose
        covariance = beacon["estimate"]["covariance_m2"]
        # Six by six, and three by three.
        for of_pose, of_fix, value in ((0, 0, covariance[0][0]), (1, 1, covariance[0][1]), (7, 4, covariance[1][1])):
            assert abs(estimate.covariance[of_pose] - value) < 1e-9
            assert abs(fix.position_covariance[of_fix] - value) < 1e-9
        assert abs(estimate.pose.position.x - beacon["estimate"]["east_m"]) < 1e-9
    (ground,) = bag.messages["/foxhunt/map"]
    assert len(json.loads(ground.geojson)["features"]) == len(features)
    assert any(message.level == 20 and message.msg for message in bag.messages["/foxhunt/log"])
    antennas = bag.transforms(bearings)
    bag.paths()
    print(f"MCAP: {sum(map(len, bag.messages.values()))} messages, {antennas} antennas that point where a bearing is")
    view(bag)
    rasters(out, beacons)


def rasters(out, beacons):
    """Probabilities of cells, by GDAL."""
    with rasterio.open(out / "hunt.tif") as file:
        pages = file.subdatasets or [str(out / "hunt.tif")]
    names, levels = set(), []
    for page in pages:
        with rasterio.open(page) as file:
            name, (mass, held) = file.tags()["TIFFTAG_IMAGEDESCRIPTION"], file.read()
            if name.startswith("level of "):
                levels.append(name)
                assert file.descriptions == ("level in dBm", "its sigma in dB")
                assert -200 < mass.min() < mass.max() < 50 and 0 < held.min()
                continue
            assert file.descriptions == ("probability of the cell", "probability of the region that holds the cell")
            rows, columns = numpy.indices(mass.shape)
            east, north = rasterio.transform.xy(file.transform, rows.ravel(), columns.ravel())
            lon, lat = rasterio.warp.transform(file.crs, "EPSG:4326", [east[0], east[-1]], [north[0], north[-1]])
            for there in zip(lat, lon, (east[0], east[-1]), (north[0], north[-1])):
                own = pymap3d.enu2geodetic(there[2], there[3], 0.0, LAT, LON, 0.0)
                assert abs(own[0] - there[0]) < 1e-7 and abs(own[1] - there[1]) < 1e-7, (there, own)
            assert abs(mass.sum() - 1) < 1e-4
            assert abs(mass[held <= 0.5].sum() - 0.5) < 0.02 and abs(mass[held <= 0.95].sum() - 0.95) < 0.02
            estimate = beacons[name]["estimate"]
            mean = (mass.ravel() * numpy.array([east, north])).sum(axis=1)
            assert math.dist(mean, (estimate["east_m"], estimate["north_m"])) < 0.1, (mean, estimate)
            names.add(name)
    assert names == beacons.keys()
    assert len(levels) == len(beacons), levels
    print(f"GeoTIFF: {len(pages)} pages, where pymap3d has them, {len(levels)} of the level")
    with rasterio.open(out / "hunt.mbtiles") as file:
        assert file.crs.to_epsg() == 3857 and file.count == 4
        places = [degrees(b["estimate"]["east_m"], b["estimate"]["north_m"]) for b in beacons.values()]
        x, y = rasterio.warp.transform("EPSG:4326", file.crs, [lon for _, lon in places], [lat for lat, _ in places])
        opacities = [int(pixel[3]) for pixel in file.sample(list(zip(x, y)))]
        assert all(opacity >= 100 for opacity in opacities), opacities
        print(f"MBTiles: zoom {file.tags()['minzoom']} to {file.tags()['maxzoom']}, opacity {opacities} at the fixes")
    with zipfile.ZipFile(out / "hunt.kmz") as packed:
        assert packed.testzip() is None
        (out / "doc.kml").write_bytes(packed.read("doc.kml"))
        overlay = fastkml.KML.parse(out / "doc.kml").features[0]
        (out / "belief.png").write_bytes(packed.read(overlay.icon.href))
    box = overlay.lat_lon_box
    for path in ("belief.png", "hunt.png"):
        with rasterio.open(out / path) as file:
            assert file.count == 4 and max(file.shape) == 1000
            opacity = file.read(4)
            if path == "belief.png":
                for lat, lon in places:
                    row = int((box.north - lat) / (box.north - box.south) * file.height)
                    column = int((lon - box.west) / (box.east - box.west) * file.width)
                    assert opacity[row, column] >= 100, (lat, lon)
    print("KMZ and PNG: painted at the fixes")


class Bag:
    """A bag of ROS 2, read by rosbags with the definitions in the bag, which are those of ROS 2 Humble."""

    def __init__(self, path):
        humble = get_typestore(Stores.ROS2_HUMBLE)
        self.messages, self.types = {}, {}
        with AnyReader([path]) as reader:
            for connection in reader.connections:
                self.types[connection.topic] = connection.msgtype
                if connection.msgtype in humble.fielddefs:
                    ours = fields(reader.typestore, connection.msgtype)
                    assert ours == fields(humble, connection.msgtype), connection.msgtype
            for connection, stamp, data in reader.messages():
                message = reader.deserialize(data, connection.msgtype)
                self.messages.setdefault(connection.topic, []).append(message)
                header = getattr(message, "header", None)
                if header:
                    assert header.stamp.sec * 10**9 + header.stamp.nanosec == stamp
        with open(path, "rb") as file:
            self.names = {c.topic: c.metadata["name"] for c in make_reader(file).get_summary().channels.values() if "name" in c.metadata}

    def transforms(self, bearings):
        """Each frame leads to the Earth; the place of the map there is the origin's."""
        (static,) = (transform for message in self.messages["/tf_static"] for transform in message.transforms)
        assert (static.header.frame_id, static.child_frame_id) == ("earth", "map")
        at = static.transform.translation
        assert abs(math.degrees(math.atan2(at.y, at.x)) - LON) < 1e-9
        parents = {"map": "earth"}
        antennas = 0
        for message in self.messages["/tf"]:
            for transform in message.transforms:
                parents[transform.child_frame_id] = transform.header.frame_id
                antennas += transform.child_frame_id.endswith("/antenna")
                q = transform.transform.rotation
                assert abs(math.hypot(q.x, q.y, q.z, q.w) - 1) < 1e-12
        assert antennas == bearings
        for frame in parents:
            while frame != "earth":
                frame = parents[frame]
        self.frames = {*parents, "earth"}
        return antennas

    def paths(self):
        """A drone's path grows to all of its poses."""
        for topic, paths in self.messages.items():
            if topic.endswith("/path"):
                lengths = [len(path.poses) for path in paths]
                assert lengths == sorted(lengths)
                poses = self.messages[topic.replace("/path", "/pose")]
                assert [p.pose.position for p in paths[-1].poses] == [p.pose.position for p in poses]


def fields(store, name, seen=()):
    """The fields of a type with those of the types that it holds, by name and kind."""
    assert name not in seen
    found = []
    for field, kind in store.fielddefs[name][1]:
        text = repr(kind)
        held = [other for other in store.fielddefs if f"'{other}'" in text]
        found.append((field, text, [fields(store, other, (*seen, name)) for other in held]))
    return found


def view(bag):
    """The launch files and the view for rviz2 name what there is."""
    package = Path("hardware/ros/foxhunt_launch")
    kinds = {"Pose": "geometry_msgs/msg/PoseStamped", "Path": "nav_msgs/msg/Path",
             "PoseWithCovariance": "geometry_msgs/msg/PoseWithCovarianceStamped"}
    latched = yaml.safe_load((package / "config/replay_qos.yaml").read_text())
    manager = yaml.safe_load((package / "rviz/foxhunt.rviz").read_text())["Visualization Manager"]
    assert manager["Global Options"]["Fixed Frame"] in bag.frames
    shown = set()
    for display in manager["Displays"]:
        kind = display["Class"].removeprefix("rviz_default_plugins/")
        if kind == "TF":
            assert set(display["Frames"]) - {"All Enabled"} <= bag.frames
        if "Topic" not in display:
            continue
        topic = display["Topic"]["Value"]
        late = display["Topic"]["Durability Policy"] == "Transient Local"
        if topic in bag.types:
            shown.add(topic)
            assert bag.types[topic] == kinds[kind], topic
            # Who asks for the last message gets nothing of a topic that does not keep it.
            assert late == (latched.get(topic, {}).get("durability") == "transient_local"), topic
        else:
            # A goal is sent by the fusion node alone.
            assert topic.endswith("/goal") and kind == "Pose", topic
    wanted = {t for t in bag.types if t.rsplit("/", 1)[1] in ("pose", "path", "estimate")}
    assert shown == wanted, shown ^ wanted
    assert latched.keys() <= bag.types.keys() and latched["/tf_static"]["durability"] == "transient_local"

    share, files = "$(find-pkg-share foxhunt_launch)/", 0
    commands = []
    for launch in sorted((package / "launch").glob("*.launch.xml")):
        root = etree.parse(launch).getroot()
        assert root.tag == "launch"
        declared = {argument.get("name") for argument in root.findall("arg")}
        for element in root.iter(etree.Element):
            for text in element.attrib.values():
                assert set(re.findall(r"\$\(var (\w+)\)", text)) <= declared, text
                for path in re.findall(re.escape(share) + r"([\w./]+)", text):
                    assert (package / path).is_file(), path
                    files += 1
            if element.tag == "include":
                included = etree.parse(package / element.get("file").removeprefix(share)).getroot()
                assert {a.get("name") for a in element.findall("arg")} <= {a.get("name") for a in included.findall("arg")}
            if element.tag == "executable":
                commands.append(element.get("cmd").split())
    for command in commands:
        if command[0] == "foxhunt":
            text = subprocess.run([sys.argv[2], *command[1:3], "--help"], check=True, capture_output=True, text=True).stdout
            assert all(flag in text for flag in command if flag.startswith("--")), command
    print(f"rviz2: {len(shown)} topics of the bag; launch: {len(commands)} commands, {files} files of the package")

main()
