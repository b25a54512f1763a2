"""Puts maps below a live view, out of a folder, MBTiles and PMTiles, and looks where their marks are.

usage: report_tiles.py CHROMIUM FOXHUNT FOLDER

The tiles are drawn here, the marks are placed by pymap3d, and PMTiles are written by its own library.
"""

import math
import os
import shutil
import sqlite3
import struct
import subprocess
import sys
import zlib

import pymap3d
from playwright.sync_api import sync_playwright
from pmtiles.tile import Compression, TileType, zxy_to_tileid
from pmtiles.writer import Writer

from report import settle, wait_for
from report_live import Program, new_page, open_page

ORIGIN = (50.08, 14.44)
# East and North in metres of dark discs on light ground, off the lines of the grid; the last is where
# the ground curves.
MARKS = [(8.0, -9.0), (83.0, 46.0), (-71.0, 31.0), (46.0, -63.0), (9013.0, -7009.0)]
NEAR = 150.0
ZOOMS = (13, 18)
DISC_PX = 7


def pixel(lat, lon, zoom):
    """Where a place is, in pixels of a zoom level, from the North-West."""
    size = 256 * 2**zoom
    east = (lon + 180.0) / 360.0 * size
    north = (0.5 - math.asinh(math.tan(math.radians(lat))) / (2.0 * math.pi)) * size
    return east, north


def on_earth(east, north):
    lat, lon, _ = pymap3d.enu2geodetic(east, north, 0.0, *ORIGIN, 0.0)
    return lat, lon


def png(rows):
    """A grey image."""
    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    head = struct.pack(">IIBBBBB", len(rows[0]), len(rows), 8, 0, 0, 0, 0)
    data = zlib.compress(b"".join(b"\0" + bytes(row) for row in rows))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def tile(zoom, column, row):
    marks = [pixel(*on_earth(*mark), zoom) for mark in MARKS]
    marks = [(x - 256 * column, y - 256 * row) for x, y in marks]
    near = [(x, y) for x, y in marks if -20 < x < 276 and -20 < y < 276]
    rows = [bytearray([215]) * 256 for _ in range(256)]
    for x, y in near:
        for py in range(max(int(y) - 9, 0), min(int(y) + 10, 256)):
            for px in range(max(int(x) - 9, 0), min(int(x) + 10, 256)):
                if math.hypot(px + 0.5 - x, py + 0.5 - y) <= DISC_PX:
                    rows[py][px] = 0
    return png(rows)


def drawn():
    """All tiles about the marks; one of the finest level is missing, and one is no image."""
    tiles = {}
    for zoom in range(ZOOMS[0], ZOOMS[1] + 1):
        for east, north in MARKS:
            corners = [pixel(*on_earth(east + dx, north + dy), zoom) for dx, dy in ((-NEAR, NEAR), (NEAR, -NEAR))]
            (west, top), (right, bottom) = [(int(x // 256), int(y // 256)) for x, y in corners]
            for column in range(west, right + 1):
                for row in range(top, bottom + 1):
                    if (zoom, column, row) not in tiles:
                        tiles[zoom, column, row] = tile(zoom, column, row)
    return tiles


def key_of(mark, zoom):
    x, y = pixel(*on_earth(*mark), zoom)
    return zoom, int(x // 256), int(y // 256)


def as_folder(tiles, path):
    for (zoom, column, row), image in tiles.items():
        os.makedirs(os.path.join(path, str(zoom), str(column)), exist_ok=True)
        with open(os.path.join(path, str(zoom), str(column), f"{row}.png"), "wb") as file:
            file.write(image)
    with open(os.path.join(path, "metadata.json"), "w", encoding="utf-8") as file:
        file.write('{"attribution": "© <a href=\'https://example.org\'>the mapper</a>"}')


def as_mbtiles(tiles, path):
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE metadata (name TEXT, value TEXT)")
        database.execute("CREATE TABLE tiles (zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, tile_data BLOB)")
        database.execute("CREATE UNIQUE INDEX tile ON tiles (zoom_level, tile_column, tile_row)")
        database.executemany("INSERT INTO metadata VALUES (?, ?)", [("format", "png"), ("attribution", "the mapper")])
        rows = [(zoom, column, 2**zoom - 1 - row, image) for (zoom, column, row), image in tiles.items()]
        database.executemany("INSERT INTO tiles VALUES (?, ?, ?, ?)", rows)
    database.close()


def as_pmtiles(tiles, path):
    with open(path, "wb") as file:
        writer = Writer(file)
        for identity, image in sorted((zxy_to_tileid(*key), image) for key, image in tiles.items()):
            writer.write_tile(identity, image)
        e7 = lambda value: int(value * 1e7)
        writer.finalize(
            {
                "tile_type": TileType.PNG, "tile_compression": Compression.NONE, "min_zoom": ZOOMS[0], "max_zoom": ZOOMS[1],
                "min_lon_e7": e7(14.0), "min_lat_e7": e7(50.0), "max_lon_e7": e7(15.0), "max_lat_e7": e7(50.2),
                "center_zoom": 15, "center_lon_e7": e7(ORIGIN[1]), "center_lat_e7": e7(ORIGIN[0]),
            },
            {"attribution": "the mapper"},
        )


GREY = """([at, off]) => {
    const map = document.getElementById("map"), ratio = window.devicePixelRatio || 1;
    const [px, py] = foxhunt.at(at);
    return [[0, 0], [off, 0], [0, off]].map(([dx, dy]) =>
        map.getContext("2d").getImageData(Math.round((px + dx) * ratio), Math.round((py + dy) * ratio), 1, 1).data[0]);
}"""


def look(page, centre, scale):
    """Shows a place at so many pixels a metre, and waits until all tiles have come."""
    page.evaluate(
        "([east, north, scale]) => { Object.assign(foxhunt.view, { east, north, scale, moved: true }); foxhunt.setTime(0); }",
        [*centre, scale],
    )
    for _ in range(100):
        page.wait_for_timeout(100)
        if page.evaluate("[...foxhunt.tiles.values()].every((tile) => tile.came)"):
            settle(page)
            return
    raise AssertionError("tiles are on their way for ten seconds")


def check(browser, foxhunt, folder, name, source, size, picture):
    wrong = []
    command = ["hunt", "--live=127.0.0.1:0", "--pace", "1000", "--tiles", source, "--origin", f"{ORIGIN[0]},{ORIGIN[1]}"]
    with Program(foxhunt, *command, "--out", os.path.join(folder, name)) as program:
        page = new_page(browser, wrong, size)
        open_page(page, program.address())
        page.locator("#live-status", has_text="the hunt is over").wait_for(timeout=120_000)
        wait_for(page, "foxhunt.received.length > 10")
        look(page, (0.0, 0.0), 2.0)
        page.screenshot(path=picture)
        assert "the mapper" == page.locator("#attribution").text_content().removeprefix("Map: ").removeprefix("© ")
        for box in page.locator("#layers input").all():
            if box.get_attribute("id") != "layer-tiles":
                box.uncheck()
        # At the resolution of each level, coarser than all and finer than all; and far away.
        for scale in (0.35, 0.7, 1.4, 2.8, 8.0):
            for mark in MARKS:
                look(page, (mark[0] + 3.0 / scale, mark[1] - 3.0 / scale), scale)
                disc = page.evaluate(GREY, [mark, 70])
                assert disc[0] < 90 and disc[1] > 180 and disc[2] > 180, (name, scale, mark, disc)
        page.locator("#layer-tiles").uncheck()
        settle(page)
        assert page.evaluate(GREY, [MARKS[-1], 70])[0] > 220, "the map is switched off"
        # The page's degrees are those of pymap3d.
        for mark in [*MARKS, (-12_000.0, 9_000.0)]:
            shown = page.evaluate("(at) => foxhunt.onEarth(at)", list(mark)).split(", ")
            lat, lon, _ = pymap3d.enu2geodetic(*mark, 0.0, *ORIGIN, 0.0)
            worst = max(abs(float(shown[0]) - lat), abs(float(shown[1]) - lon))
            assert worst < 1e-6, (mark, shown, lat, lon)
    # The browser's own advice about reading pixels, which this test alone does.
    wrong = [line for line in wrong if "willReadFrequently" not in line]
    assert not wrong, f"console: {wrong}"


def main():
    chromium, foxhunt, folder = sys.argv[1:]
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    tiles = drawn()
    # A coarser level stands in for what is missing or no image.
    del tiles[key_of(MARKS[1], 18)]
    tiles[key_of(MARKS[2], 18)] = b"<html>not found</html>"
    sources = {name: os.path.join(folder, name) for name in ("tiles", "map.mbtiles", "map.pmtiles")}
    as_folder(tiles, sources["tiles"])
    as_mbtiles(tiles, sources["map.mbtiles"])
    as_pmtiles(tiles, sources["map.pmtiles"])
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for (name, source), size in zip(sources.items(), ((1280, 800), (1280, 800), (390, 844))):
            check(browser, foxhunt, folder, f"of-{name}", source, size, os.path.join(folder, f"{name}.png"))
        browser.close()
    print(f"tiles: {len(tiles)} of a folder, MBTiles and PMTiles where pymap3d has them")

    # What is broken is named before anything flies.
    cut = os.path.join(folder, "cut.pmtiles")
    with open(sources["map.pmtiles"], "rb") as whole, open(cut, "wb") as file:
        file.write(whole.read()[:-100])
    torn = os.path.join(folder, "torn.mbtiles")
    with open(sources["map.mbtiles"], "rb") as whole, open(torn, "wb") as file:
        file.write(whole.read()[:5000])
    for path, why in ((cut, "cut short"), (torn, "damaged"), (os.path.join(folder, "none"), "cannot be read"), (chromium, "neither")):
        refused = subprocess.run(
            [foxhunt, "hunt", "--live=127.0.0.1:0", "--tiles", path, "--origin", "50,14"], capture_output=True, text=True, timeout=60,
        )
        assert refused.returncode == 2 and path in refused.stderr and why in refused.stderr, refused
    refused = subprocess.run(
        [foxhunt, "hunt", "--live=127.0.0.1:0", "--tiles", sources["tiles"]], capture_output=True, text=True, timeout=60,
    )
    assert refused.returncode == 2 and "--origin" in refused.stderr, refused


if __name__ == "__main__":
    main()
