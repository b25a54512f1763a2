"""Writes tiles of one landscape in several ways, and compares heights of `foxhunt fly --dry-run`."""

import json
import subprocess
import sys
from pathlib import Path

import numpy
import pymap3d
import rasterio
import rasterio.shutil
from rasterio.transform import from_origin

out, foxhunt = Path(sys.argv[1]), sys.argv[2]
LAT, LON, SIDE = 50.37, 14.61, 1201
# East and North of the site, in metres.
PLACES = [(0.0, 0.0), (411.0, -620.0), (-733.0, 95.5), (12.0, 880.0), (-250.0, -333.0)]

DRONE = """
[[drones]]
name = "d{number}"
launch_m = [{east}, {north}]
vehicle = {{ kind = "mavlink", endpoint = "udpin:127.0.0.1:{port}" }}
radio = {{ kind = "xbee", endpoint = "serial:/dev/none{number}:57600" }}
rotator = {{ kind = "firmata", endpoint = "serial:/dev/nothing{number}:57600" }}
source = {{ kind = "stepper", position_timeout = 1.0, first_timeout = 10.0 }}
"""
FLIGHT = f"""
name = "hills"
site = {{ lat_deg = {LAT}, lon_deg = {LON} }}
beacons = [{{ name = "fox", address = "0013A20041234567" }}]
model = {{ reference_dbm = -29.06, exponent = 2.765, antenna = "dipole" }}
extractor = {{ kind = "maximum-likelihood", antenna = "dipole" }}
planner = {{ kind = "follow-estimate" }}
terrain = {{ folder = "tiles" }}
""" + "".join(
    DRONE.format(number=n, east=e, north=u, port=14550 + n) for n, (e, u) in enumerate(PLACES)
)

rows, columns = numpy.mgrid[0:SIDE, 0:SIDE]
heights = numpy.round(300 + 90 * numpy.sin(rows / 7.0) + 60 * numpy.cos(columns / 5.0))
STEP = 1.0 / (SIDE - 1)
# Samples on whole degrees, as SRTM has them: cells begin half a step before.
WHOLE = from_origin(14 - STEP / 2, 51 + STEP / 2, STEP, STEP)
WAYS = {
    "float cells, tiled, deflate, predictor 3": dict(
        dtype="float32", tiled=True, blockxsize=256, blockysize=256, compress="deflate",
        predictor=3, nodata=-9999.0),
    "int16 points, strips, lzw, predictor 2": dict(
        dtype="int16", compress="lzw", predictor=2, nodata=-32768, points=True),
    "plain, cells on degrees": dict(
        dtype="float32", transform=from_origin(14, 51, 1.0 / SIDE, 1.0 / SIDE)),
    "hgt": dict(dtype="int16", hgt=True),
}


def judge(path):
    """The heights of the places as GDAL has them, bilinear between the middles of cells."""
    found = []
    with rasterio.open(path) as tile:
        data = tile.read(1).astype(float)
        for east, north in PLACES:
            lat, lon, _ = pymap3d.enu2geodetic(east, north, 0.0, LAT, LON, 0.0)
            column, row = (x - 0.5 for x in ~tile.transform * (lon, lat))
            top, left = int(row), int(column)
            down, along = row - top, column - left
            cell = data[top:top + 2, left:left + 2]
            found.append(numpy.array([1 - down, down]) @ cell @ numpy.array([1 - along, along]))
    return numpy.array(found)


flight = out / "hills.toml"
flight.write_text(FLIGHT)
tiles = out / "tiles"
tiles.mkdir()
for name, way in WAYS.items():
    for old in tiles.iterdir():
        old.unlink()
    way = dict(way)
    hgt, points = way.pop("hgt", False), way.pop("points", False)
    way = dict(driver="GTiff", width=SIDE, height=SIDE, count=1, crs="EPSG:4326", transform=WHOLE) | way
    path = tiles / "dem.tif"
    with rasterio.open(path, "w", **way) as tile:
        if points:
            tile.update_tags(AREA_OR_POINT="Point")
        tile.write(heights.astype(way["dtype"]), 1)
    if hgt:
        rasterio.shutil.copy(path, tiles / "N50E014.hgt", driver="SRTMHGT")
        path.unlink()
        path = tiles / "N50E014.hgt"
    ran = subprocess.run(
        [foxhunt, "fly", flight, "--dry-run", "--json"], capture_output=True, text=True)
    if ran.returncode:
        sys.exit(f"{name}: {ran.stderr}")
    found = numpy.array([drone["ground_m"] for drone in json.loads(ran.stdout)["drones"]])
    worst = numpy.abs(found - judge(path)).max()
    print(f"{name}: {worst:.6f} m off at most")
    # Floats of 32 bits, and two programs' East-North-Up.
    if not worst < 1e-3:
        sys.exit(f"{name}: {found} where GDAL has {judge(path)}")
