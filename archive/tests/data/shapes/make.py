"""Writes the files of this folder: one walk as a spreadsheet of Excel and of OpenDocument, as a log of Kismet and as
a KMZ track, and bearings as a database of df-aggregator.

Needs openpyxl and odfpy. The transmitter is at 48.2009 N, 16.3715 E; the walk goes around it at 1 Hz.
"""

import datetime
import math
import sqlite3
import zipfile
from pathlib import Path

import openpyxl
from odf.opendocument import OpenDocumentSpreadsheet
from odf.table import Table, TableCell, TableRow
from odf.text import P

FOLDER = Path(__file__).parent
BEGIN = datetime.datetime(2026, 6, 21, 14, 3, 0)
HEADER = ["Date", "Time", "Latitude", "Longitude", "RSSI [dBm]"]
NORTH_M = 111_200.0
EAST_M = NORTH_M * math.cos(math.radians(48.2))


def walk():
    """Time, latitude, longitude and level in dBm of each second."""
    for second in range(200):
        along = 4.0 * (second % 100)
        north, east = (0.0, along) if second < 100 else (150.0, 400.0 - along)
        away = math.hypot(north - 100.0, east - 111.0)
        level = -40.0 - 25.0 * math.log10(max(away, 1.0)) + 3.0 * math.sin(1.7 * second)
        yield BEGIN + datetime.timedelta(seconds=second), 48.2 + north / NORTH_M, 16.37 + east / EAST_M, level


def excel():
    book = openpyxl.Workbook()
    book.active.title = "Notes"
    book.active.append(["a walk with a receiver"])
    sheet = book.create_sheet("Walk")
    sheet.append([])
    sheet.append(HEADER)
    for time, lat, lon, level in walk():
        sheet.append([time.date(), time.time(), lat, lon, level])
    book.save(FOLDER / "walk.xlsx")


def opendocument():
    book = OpenDocumentSpreadsheet()
    sheet = Table(name="Walk")
    row = TableRow()
    for name in HEADER:
        cell = TableCell(valuetype="string")
        cell.addElement(P(text=name))
        row.addElement(cell)
    sheet.addElement(row)
    for time, lat, lon, level in walk():
        row = TableRow()
        row.addElement(TableCell(valuetype="date", datevalue=time.date().isoformat()))
        row.addElement(TableCell(valuetype="time", timevalue=time.strftime("PT%HH%MM%SS")))
        for number in (lat, lon, level):
            row.addElement(TableCell(valuetype="float", value=repr(number)))
        sheet.addElement(row)
    book.spreadsheet.addElement(sheet)
    book.save(FOLDER / "walk.ods")


def kismet():
    """As Kismet's logs of db_version 8 are (kismetwireless.net, "KismetDB logs")."""
    path = FOLDER / "walk.kismet"
    path.unlink(missing_ok=True)
    with sqlite3.connect(path) as log:
        log.execute("CREATE TABLE KISMET (kismet_version TEXT, db_version INT, db_module TEXT)")
        log.execute("INSERT INTO KISMET VALUES ('2023.07', 8, 'kismetlog')")
        log.execute(
            "CREATE TABLE packets (ts_sec INT, ts_usec INT, phyname TEXT, sourcemac TEXT, destmac TEXT, "
            "transmac TEXT, frequency REAL, devkey TEXT, lat REAL, lon REAL, alt REAL, speed REAL, heading REAL, "
            "packet_len INT, packet_full_len INT, signal INT, datasource TEXT, dlt INT, packet BLOB, error INT, "
            "tags TEXT, datarate REAL, hash INT, packetid INT)"
        )
        for number, (time, lat, lon, level) in enumerate(walk()):
            seconds = int(time.replace(tzinfo=datetime.timezone.utc).timestamp())
            # Every tenth packet came without a place, as before the receiver's first fix.
            place = (0.0, 0.0) if number % 10 == 3 else (lat, lon)
            log.execute(
                "INSERT INTO packets (ts_sec, ts_usec, phyname, sourcemac, lat, lon, alt, signal, datasource) "
                "VALUES (?, ?, 'IEEE802.11', '02:00:00:00:00:01', ?, ?, 180.0, ?, '5FE308BD')",
                (seconds, 250_000, *place, round(level)),
            )


def kmz():
    """A track of Google's extension beside a picture, which stands first."""
    track = "".join(f"<when>{time.isoformat()}Z</when>\n" for time, *_ in walk())
    track += "".join(f"<gx:coord>{lon!r} {lat!r} {180 + 0.1 * n}</gx:coord>\n" for n, (_, lat, lon, _) in enumerate(walk()))
    document = (
        '<?xml version="1.0" encoding="UTF-8"?>\n<kml xmlns="http://www.opengis.net/kml/2.2" '
        'xmlns:gx="http://www.google.com/kml/ext/2.2">\n<Document><Placemark><gx:Track>\n'
        f"{track}</gx:Track></Placemark></Document></kml>\n"
    )
    with zipfile.ZipFile(FOLDER / "walk.kmz", "w") as archive:
        archive.writestr(zipfile.ZipInfo("files/a.png"), b"\x89PNG\r\n\x1a\n")
        archive.writestr(zipfile.ZipInfo("doc.kml"), document, zipfile.ZIP_DEFLATED)


def df_aggregator():
    """As df-aggregator has its database (ckoval7/df-aggregator, database.py), which it writes ahead."""
    path = FOLDER / "bearings.db"
    path.unlink(missing_ok=True)
    with sqlite3.connect(path) as log:
        log.execute("PRAGMA page_size = 512")
        log.execute("PRAGMA journal_mode = WAL")
        log.execute(
            "CREATE TABLE intersects (id INTEGER PRIMARY KEY AUTOINCREMENT, time INTEGER, latitude REAL, "
            "longitude REAL, num_parents INTEGER, confidence INTEGER, aoi_id INTEGER)"
        )
        log.execute(
            "CREATE TABLE lobs (id INTEGER PRIMARY KEY AUTOINCREMENT, time INTEGER, station_id TEXT, latitude REAL, "
            "longitude REAL, confidence INTEGER, power REAL, frequency REAL, lob REAL)"
        )
        begin = int(BEGIN.replace(tzinfo=datetime.timezone.utc).timestamp())
        stations = [("hill", 48.198, 16.37), ("mast", 48.204, 16.369), ("car", 48.199, 16.376), ("no fix", 0.0, 0.0)]
        for number in range(24):
            name, lat, lon = stations[number % 4]
            east, north = (16.3715 - lon) * EAST_M, (48.2009 - lat) * NORTH_M
            lob = (math.degrees(math.atan2(east, north)) + 2.0 * math.sin(2.3 * number)) % 360.0
            log.execute(
                "INSERT INTO lobs VALUES (NULL, ?, ?, ?, ?, 90, -31.5, 433.92, ?)",
                (1000 * (begin + number), name, lat, lon, round(lob, 1)),
            )
    log.close()


if __name__ == "__main__":
    excel()
    opendocument()
    kismet()
    kmz()
    df_aggregator()
