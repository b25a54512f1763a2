"""What pynmeagps, pyubx2 and gpsd make of our emulated GNSS receivers, and receivers made of the
first two for our decoders. Fails with the reason."""
import datetime, json, math, os, socket, sys, time

PLACE = (-33.85678, 151.21529, 64.5)  # what is served: degrees North, degrees East, m above the ellipsoid


def metres(origin, lat, lon):
    east = (lon - origin[1]) * 111320 * math.cos(math.radians(origin[0]))
    return math.hypot(east, (lat - origin[0]) * 111320)


def opened(path):
    """A reader and a writer of a serial port."""
    port = os.open(path, os.O_RDWR | os.O_NOCTTY)
    return os.fdopen(os.dup(port), "rb"), lambda data: os.write(port, data)


def read_nmea(path, origin):
    from pynmeagps import NMEAReader, VALCKSUM

    stream, _ = opened(path)
    received = {}
    for _, message in NMEAReader(stream, validate=VALCKSUM, quitonerror=2):
        if message is None:
            continue
        received.setdefault(message.msgID, []).append(message)
        if len(received.get("GST", [])) >= 10:
            break
    for wanted in ("GGA", "RMC", "GSA", "GST"):
        assert len(received.get(wanted, [])) >= 8, f"{wanted} of {({k: len(v) for k, v in received.items()})}"
    for gga in received["GGA"]:
        assert gga.quality == 4 and gga.numSV == 14, gga
        assert metres(origin, gga.lat, gga.lon) < 100, gga
        assert abs(gga.alt + gga.sep - origin[2]) < 60, gga
    for gst in received["GST"]:
        assert abs(gst.stdLat - 0.012) < 1e-3 and abs(gst.stdAlt - 0.02) < 1e-3, gst
    assert all(rmc.status == "A" and rmc.posMode == "R" for rmc in received["RMC"])
    assert all(gsa.navMode == 3 for gsa in received["GSA"])
    print("  10 epochs of GGA, RMC, GSA and GST, every checksum right:", received["GGA"][-1])


def read_ublox(path, origin):
    from pyubx2 import ERR_RAISE, GET, UBXMessage, UBXReader

    stream, write = opened(path)
    reader = UBXReader(stream, protfilter=3, quitonerror=ERR_RAISE)
    write(UBXMessage("MON", "MON-VER", 2).serialize())
    write(UBXMessage.config_set(1, 0, [("CFG_MSGOUT_UBX_NAV_PVT_USB", 1)]).serialize())
    received = {}
    for _, message in reader:
        received.setdefault(message.identity, []).append(message)
        if len(received.get("NAV-PVT", [])) >= 10:
            break
    assert "ACK-ACK" in received and "MON-VER" in received, received.keys()
    for pvt in received["NAV-PVT"]:
        assert pvt.fixType == 3 and pvt.gnssFixOk == 1 and pvt.carrSoln == 1, pvt
        assert metres(origin, pvt.lat, pvt.lon) < 100, pvt
        assert abs(pvt.hAcc - 283) <= 2 and abs(pvt.vAcc - 400) <= 1, pvt
        then = time.mktime((pvt.year, pvt.month, pvt.day, pvt.hour, pvt.min, pvt.second, 0, 0, 0))
        assert abs(then - time.timezone - time.time()) < 7200, pvt
    print("  MON-VER, ACK-ACK and 10 NAV-PVT:", received["NAV-PVT"][-1])


def serve(port_file, messages):
    """Sends messages five times a second to the first client, until it is ended."""
    server = socket.create_server(("127.0.0.1", 0))
    with open(port_file + ".new", "w") as out:
        out.write(str(server.getsockname()[1]))
    os.rename(port_file + ".new", port_file)
    client, _ = server.accept()
    try:
        while True:
            client.sendall(messages())
            time.sleep(0.2)
    except OSError:
        pass


def nmea_messages():
    from pynmeagps import GET, NMEAMessage

    now = datetime.datetime.now(datetime.timezone.utc)
    clock = now.time().replace(microsecond=0)
    lat, lon, alt = PLACE
    gga = NMEAMessage("GN", "GGA", GET, time=clock, lat=lat, NS="S", lon=lon, EW="E", quality=4, numSV=21,
                      HDOP=0.6, alt=alt - 22.5, altUnit="M", sep=22.5, sepUnit="M", diffAge=1, diffStation=0)
    rmc = NMEAMessage("GN", "RMC", GET, time=clock, status="A", lat=lat, NS="S", lon=lon, EW="E", spd=0.1,
                      cog=0, date=now.date(), mv=12.5, mvEW="E", posMode="R", navStatus="V")
    gst = NMEAMessage("GN", "GST", GET, time=clock, rangeRms=1.1, stdMajor=0.02, stdMinor=0.01, orient=10,
                      stdLat=0.014, stdLong=0.011, stdAlt=0.03)
    return rmc.serialize() + gga.serialize() + gst.serialize()


def ublox_messages():
    from pyubx2 import GET, UBXMessage

    now = time.gmtime()
    lat, lon, alt = PLACE
    pvt = UBXMessage("NAV", "NAV-PVT", GET, iTOW=1000, year=now.tm_year, month=now.tm_mon, day=now.tm_mday,
                     hour=now.tm_hour, min=now.tm_min, second=now.tm_sec, validDate=1, validTime=1,
                     fullyResolved=1, tAcc=20, fixType=3, gnssFixOk=1, diffSoln=1, carrSoln=2, numSV=21,
                     lon=lon, lat=lat, height=round(alt * 1e3), hMSL=round((alt - 22.5) * 1e3), hAcc=14, vAcc=20)
    other = UBXMessage("NAV", "NAV-EOE", GET, iTOW=1000)
    return pvt.serialize() + other.serialize()


def turn_pvt_on(path):
    from pyubx2 import UBXMessage

    _, write = opened(path)
    write(UBXMessage("CFG", "CFG-MSG", 1, msgClass=1, msgID=7, rateUSB=1).serialize())


def query_gpsd(port, origin, wanted):
    """Reads gpsd until it has a fix by the wanted driver, and a GST."""
    for _ in range(100):
        try:
            client = socket.create_connection(("127.0.0.1", port))
            break
        except OSError:
            time.sleep(0.1)
    client.sendall(b'?WATCH={"enable":true,"json":true};\n')
    client.settimeout(40)
    driver, gst, begun = None, None, time.time()
    for line in client.makefile():
        report = json.loads(line)
        gst = report if report["class"] == "GST" else gst
        for device in report.get("devices", [report]):
            driver = device.get("driver", driver)
        assert time.time() - begun < 40, f"driver {driver}, last {line}"
        if driver == wanted and gst and report["class"] == "TPV" and report.get("mode") == 3:
            assert metres(origin, report["lat"], report["lon"]) < 100, report
            assert report.get("status") == 2, report
            assert abs(gst["lat"] - 0.9) < 1e-3 and abs(gst["alt"] - 1.8) < 1e-3, gst
            print(f"  gpsd (driver {driver}):", line.strip(), gst)
            return
    raise SystemExit("gpsd went without a fix")


command, target = sys.argv[1:3]
origin = [float(part) for part in sys.argv[3].split(",")] if len(sys.argv) > 3 else None
{
    "read-nmea": lambda: read_nmea(target, origin),
    "read-ublox": lambda: read_ublox(target, origin),
    "serve-nmea": lambda: serve(target, nmea_messages),
    "serve-ublox": lambda: serve(target, ublox_messages),
    "turn-pvt-on": lambda: turn_pvt_on(target),
    "query-gpsd": lambda: query_gpsd(int(target), origin, sys.argv[4]),
}[command]()
