"""What pynmeagps, pyubx2 and gpsd make of our emulated GNSS receivers, and receivers made of the
first two for our decoders; pygnssutils and pyrtcm for corrections. Fails with the reason."""
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


def watch_gpsd(port):
    """A connection to gpsd, which may still be starting, that is sent its reports."""
    for _ in range(100):
        try:
            client = socket.create_connection(("127.0.0.1", port))
            break
        except OSError:
            time.sleep(0.1)
    client.sendall(b'?WATCH={"enable":true,"json":true};\n')
    return client


def query_gpsd(port, origin, wanted):
    """Reads gpsd until it has a fix by the wanted driver, and a GST."""
    client = watch_gpsd(port)
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


def nmea(body):
    total = 0
    for character in body:
        total ^= ord(character)
    return f"${body}*{total:02X}\r\n".encode()


def ubx(number, payload):
    body = bytes([1, number, len(payload), 0]) + payload
    a = b = 0
    for byte in body:
        a = (a + byte) % 256
        b = (b + a) % 256
    return b"\xb5\x62" + body + bytes([a, b])


def old_ublox(now):
    """NAV-POSLLH, NAV-SOL, NAV-VELNED and NAV-TIMEUTC, as generations 4 to 6 send them."""
    import struct

    lat, lon, alt = PLACE
    seconds = now.timestamp() - 315964800 + 18  # GPS time since 1980-01-06
    week, itow = int(seconds // 604800), round(seconds % 604800 * 1000)
    a, e2 = 6378137.0, 6.69437999014e-3
    sin, cos = math.sin(math.radians(lat)), math.cos(math.radians(lat))
    n = a / math.sqrt(1 - e2 * sin * sin)
    ecef = ((n + alt) * cos * math.cos(math.radians(lon)), (n + alt) * cos * math.sin(math.radians(lon)),
            (n * (1 - e2) + alt) * sin)
    posllh = struct.pack("<IiiiiII", itow, round(lon * 1e7), round(lat * 1e7), round(alt * 1e3),
                         round((alt - 22.5) * 1e3), 3000, 5000)
    status = struct.pack("<IBBBBII", itow, 3, 0x0D, 0, 0, 30000, 900000)
    sol = struct.pack("<IihBBiiiIiiiIHBB4x", itow, 0, week, 3, 0x0D, *(round(x * 100) for x in ecef), 580, 0, 0, 0, 10,
                      180, 0, 9)
    velned = struct.pack("<IiiiIIiII", itow, 0, 0, 0, 0, 0, 0, 50, 18000000)
    utc = struct.pack("<IIiHBBBBBB", itow, 20, now.microsecond * 1000, now.year, now.month, now.day, now.hour,
                      now.minute, now.second, 7)
    return ubx(2, posllh) + ubx(3, status) + ubx(6, sol) + ubx(0x12, velned) + ubx(0x21, utc)


def epoch(name, now):
    """An epoch of a stream that a receiver which people have sends, without what others send."""
    if name == "ublox-6":
        return old_ublox(now)
    time_of_day, date = now.strftime("%H%M%S.00"), now.strftime("%d%m%y")
    lat, lon, alt = PLACE
    spot = "3351.4068,S,15112.9174,E"
    gga = lambda quality, height, geoid: nmea(f"GPGGA,{time_of_day},{spot},{quality},09,0.9,{height},M,{geoid},M,,")
    rmc = nmea(f"GPRMC,{time_of_day},A,{spot},0.0,0.0,{date},,,A")
    gsa = lambda mode: nmea(f"GPGSA,A,{mode},01,04,07,08,11,13,17,20,28,,,,1.8,0.9,1.5")
    gll = nmea(f"IIGLL,{spot},{time_of_day},A,A")
    zda = nmea(f"GPZDA,{time_of_day},{now:%d},{now:%m},{now:%Y},00,00")
    return {
        "rmc": rmc,
        "gll": gll,
        "gll-zda": gll + zda,
        "gga-without-height": gga(1, "", "") + rmc,
        "gga-without-geoid": gsa(3) + gga(1, f"{alt - 22.5:.1f}", "") + rmc,
        "gga-without-quality": gsa(2) + gga("", "", "") + rmc,
        "gga-zda": gsa(3) + gga(1, f"{alt - 22.5:.1f}", "22.5") + zda,
    }[name]


def serve_stream(port_file, name):
    """Sends a stream to a pseudo-terminal, whose name is in port_file.pty, and to each client of a TCP port."""
    import pty, select, tty

    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    os.symlink(os.ttyname(theirs), port_file + ".pty")
    server = socket.create_server(("127.0.0.1", 0))
    with open(port_file + ".new", "w") as out:
        out.write(str(server.getsockname()[1]))
    os.rename(port_file + ".new", port_file)
    clients = []
    while True:
        for _ in range(10):
            while select.select([server], [], [], 0)[0]:
                clients.append(server.accept()[0])
            if select.select([ours], [], [], 0)[0]:
                os.read(ours, 4096)  # what gpsd asks it
            time.sleep(0.05)
        # A whole second: times of the day have no others here.
        data = epoch(name, datetime.datetime.now(datetime.timezone.utc).replace(microsecond=0))
        os.write(ours, data)
        for client in clients[:]:
            try:
                client.sendall(data)
            except OSError:
                clients.remove(client)


def judge(port):
    """Prints gpsd's place, with its height above the ellipsoid if it has one."""
    client = watch_gpsd(port)
    client.settimeout(30)
    fixes = 0
    for line in client.makefile():
        report = json.loads(line)
        fixes += report["class"] == "TPV" and "lat" in report
        # The first ones may lack what comes later in their epoch.
        if report["class"] == "TPV" and fixes >= 4 and "lat" in report:
            place = [report["lat"], report["lon"]] + ([report["altHAE"]] if "altHAE" in report else [])
            return print(",".join(map(str, place)))
    raise SystemExit("gpsd went without a place")


# The example of RTCM 10403: 1005 of station 2003.
STATION = bytes.fromhex("d300133ed7d30202980edeef34b4bd62ac0941986f33360b98")


def serve_caster(port, version):
    """pygnssutils' caster of the mountpoint `pygnssutils`, with a damaged frame before each whole one."""
    import queue, threading
    from pygnssutils.socket_server import runserver

    frames = queue.Queue()
    damaged = STATION[:9] + bytes([STATION[9] ^ 4]) + STATION[10:]

    def feed():
        while True:
            frames.put(damaged + STATION)
            time.sleep(0.2)

    threading.Thread(target=feed, daemon=True).start()
    runserver("127.0.0.1", port, frames, ntripmode=1, ntripversion=version, ntripuser="hunter",
              ntrippassword="tally-ho")


def read_caster(port, origin):
    """pygnssutils' client at our caster; pyrtcm reads what it gets."""
    import queue, threading
    from pygnssutils import GNSSNTRIPClient
    from pyrtcm import RTCMReader

    for version in ("1.0", "2.0"):
        for password, is_right in (("tally-ho", True), ("yoicks", False)):
            got, stop = queue.Queue(), threading.Event()
            with GNSSNTRIPClient(None) as client:
                client.run(server="127.0.0.1", port=port, mountpoint="FOX", version=version, ntripuser="hunter",
                           ntrippassword=password, output=got, stopevent=stop)
                end = time.time() + (15 if is_right else 3)
                messages = {}
                while time.time() < end and len(messages) < 2:
                    try:
                        raw, _ = got.get(timeout=0.5)
                    except queue.Empty:
                        continue
                    message = RTCMReader.parse(raw)
                    messages[message.identity] = message
                stop.set()
            assert bool(messages) == is_right, f"NTRIP {version}, password {password}: {messages}"
            if not is_right:
                continue
            assert set(messages) == {"1005", "1230"}, messages
            station = messages["1005"]
            east, north = (math.atan2(station.DF026, station.DF025), math.asin(station.DF027 / math.dist(
                (0, 0, 0), (station.DF025, station.DF026, station.DF027))))
            # The geocentric latitude is up to 0.2 degrees off the geodetic one.
            assert abs(math.degrees(east) - origin[1]) < 1e-6 and abs(math.degrees(north) - origin[0]) < 0.2, station
            print(f"  NTRIP {version}:", station)


command, target = sys.argv[1:3]
if command == "serve-caster":
    sys.exit(serve_caster(int(target), sys.argv[3]))
if command == "serve-stream":
    serve_stream(target, sys.argv[3])
if command == "judge":
    sys.exit(judge(int(target)))
origin = [float(part) for part in sys.argv[3].split(",")] if len(sys.argv) > 3 else None
{
    "read-nmea": lambda: read_nmea(target, origin),
    "read-caster": lambda: read_caster(int(target), origin),
    "read-ublox": lambda: read_ublox(target, origin),
    "serve-nmea": lambda: serve(target, nmea_messages),
    "serve-ublox": lambda: serve(target, ublox_messages),
    "turn-pvt-on": lambda: turn_pvt_on(target),
    "query-gpsd": lambda: query_gpsd(int(target), origin, sys.argv[4]),
}[command]()
