"""Reads the exports of a hunt back, each with a reader of others, and compares them with the hunt's own result.

usage: exports.py FOLDER
"""

import csv
import json
import math
import sys
from pathlib import Path

import fastkml
import gpxpy
from lxml import etree
from mcap.reader import make_reader
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

    with open(out / "hunt.mcap", "rb") as file:
        messages = [(s.name, c.topic, json.loads(m.data)) for s, c, m in make_reader(file).iter_messages()]
    for name, beacon in beacons.items():
        found = [data for schema, topic, data in messages if topic == f"/beacons/{name}"]
        near(found[-1]["latitude"], found[-1]["longitude"], beacon)
        covariance = beacon["estimate"]["covariance_m2"]
        assert abs(found[-1]["position_covariance"][0] - covariance[0][0]) < 1e-9
    (ground,) = [data for schema, _, data in messages if schema == "foxglove.GeoJSON"]
    assert len(json.loads(ground["geojson"])["features"]) == len(features)
    print(f"MCAP: {len(messages)} messages")


main()
