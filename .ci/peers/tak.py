"""Receives hunts in Cursor on Target as a TAK server and as members of a team.

tak.py FOXHUNT: a server of asyncio and OpenSSL that relays events as TAK servers do, over TCP and TLS with
certificates of both sides; pytak as another client of it, and as a listener to the multicast group.
"""

import asyncio
import configparser
import json
import math
import os
import pathlib
import re
import ssl
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

import pytak
from lxml import etree

foxhunt = sys.argv[1]
folder = pathlib.Path(tempfile.mkdtemp(prefix="foxhunt-tak-"))
PASSWORD = "atakatak"
LAT, LON = 50.0755, 14.4378
GROUP = "239.2.3.1"
ENV = os.environ | {"FOXHUNT_COT_PASSWORD": PASSWORD}


def openssl(*words):
    subprocess.run(["openssl", *map(str, words)], check=True, capture_output=True, cwd=folder)


def certificates():
    """An authority, a server, a client of it, and a second authority that nobody trusts."""
    for authority in ("team", "other"):
        openssl("req", "-x509", "-newkey", "rsa:2048", "-nodes", "-keyout", f"{authority}.key", "-out",
                f"{authority}.pem", "-subj", f"/CN={authority}", "-days", "30",
                "-addext", "basicConstraints=critical,CA:TRUE", "-addext", "keyUsage=critical,keyCertSign")
    for name, authority in (("server", "team"), ("client", "team"), ("stranger", "other")):
        (folder / "ext").write_text("subjectAltName=DNS:tak.example,IP:127.0.0.1\n" if name != "client" else
                                    "extendedKeyUsage=clientAuth\n")
        openssl("req", "-newkey", "rsa:2048", "-nodes", "-keyout", f"{name}.key", "-out", f"{name}.csr", "-subj",
                f"/CN={name}")
        openssl("x509", "-req", "-in", f"{name}.csr", "-CA", f"{authority}.pem", "-CAkey", f"{authority}.key",
                "-CAcreateserial", "-out", f"{name}.pem", "-days", "30", "-extfile", "ext")
    # As TAK's scripts make them, with OpenSSL 3 and as of old (RC2 of 40 bits, triple DES, SHA-1).
    for name, how in (("new", []), ("old", ["-legacy"])):
        openssl("pkcs12", "-export", *how, "-in", "client.pem", "-inkey", "client.key", "-certfile", "team.pem",
                "-name", "client", "-out", f"client-{name}.p12", "-passout", f"pass:{PASSWORD}")
        openssl("pkcs12", "-export", *how, "-nokeys", "-in", "team.pem", "-out", f"truststore-{name}.p12",
                "-passout", f"pass:{PASSWORD}")
    openssl("pkcs8", "-topk8", "-in", "client.key", "-out", "client-locked.key", "-passout", f"pass:{PASSWORD}")


class Server:
    """Relays each event to all other clients, and keeps them."""

    def __init__(self):
        self.events, self.writers, self.clients = [], set(), []

    async def serve(self, reader, writer):
        tls = writer.get_extra_info("ssl_object")
        if tls:
            self.clients.append((dict(x[0] for x in tls.getpeercert()["subject"])["commonName"], tls.version()))
        self.writers.add(writer)
        try:
            while True:
                event = await reader.readuntil(b"</event>")
                self.events.append(event)
                for other in self.writers - {writer}:
                    other.write(event)
        except (asyncio.IncompleteReadError, ConnectionError, ssl.SSLError) as error:
            # Nothing of an event may be lost at the end.
            assert not getattr(error, "partial", b"").strip(), error
        finally:
            self.writers.discard(writer)
            writer.close()

    async def start(self, port, tls=None):
        server = await asyncio.start_server(self.serve, "127.0.0.1", port, ssl=tls)
        return server, server.sockets[0].getsockname()[1]


def server_tls(name, authority="team"):
    tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    tls.load_cert_chain(folder / f"{name}.pem", folder / f"{name}.key")
    tls.load_verify_locations(folder / f"{authority}.pem")
    tls.verify_mode = ssl.CERT_REQUIRED
    return tls


async def run(*words, fails=False):
    process = await asyncio.create_subprocess_exec(foxhunt, "--json", *map(str, words), stdout=subprocess.PIPE,
                                                   stderr=subprocess.PIPE, env=ENV)
    out, err = await process.communicate()
    assert (process.returncode != 0) == fails, (words, err.decode())
    return out.decode(), err.decode()


def degrees(east, north):
    """Near the origin: metres by WGS84's radii of curvature there."""
    a, e2, lat = 6378137.0, 6.69437999014e-3, math.radians(LAT)
    w = math.sqrt(1 - e2 * math.sin(lat) ** 2)
    return (LAT + math.degrees(north / (a * (1 - e2) / w**3)),
            LON + math.degrees(east / (a / w * math.cos(lat))))


def metres(lat, lon):
    one = degrees(1.0, 1.0)
    return (lon - LON) / (one[1] - LON), (lat - LAT) / (one[0] - LAT)


def seconds(text):
    whole, _, fraction = text.rstrip("Z").partition(".")
    parsed = time.strptime(whole, "%Y-%m-%dT%H:%M:%S")
    import calendar
    return calendar.timegm(parsed) + float(f"0.{fraction or 0}")


def read(events):
    """The last event of each thing, and how often each came."""
    last, counts = {}, {}
    for event in events:
        event = etree.fromstring(event.strip())
        assert event.tag == "event" and event.get("version") == "2.0"
        now = time.time()
        at, start, stale = (seconds(event.get(name)) for name in ("time", "start", "stale"))
        assert start <= at < now + 1 < stale + 700 and at < stale, (event.get("uid"), at, start, stale)
        point = event.find("point")
        assert all(float(point.get(name)) is not None for name in ("lat", "lon", "hae", "ce", "le"))
        last[event.get("uid")] = event
        counts[event.get("uid")] = counts.get(event.get("uid"), 0) + 1
    return last, counts


def judge(name, events, hunt):
    last, counts = read(events)
    title = "three-beacons"
    for beacon in hunt["beacons"]:
        fix = last[f"foxhunt.{title}.fix.{beacon['name']}"]
        assert fix.get("type") == "a-u-G" and fix.get("how") == "m-s"
        assert seconds(fix.get("stale")) - seconds(fix.get("time")) > 86_000, "a fix is of use after the hunt"
        east, north = metres(float(fix.find("point").get("lat")), float(fix.find("point").get("lon")))
        own = beacon["estimate"]
        assert math.hypot(east - own["east_m"], north - own["north_m"]) < 0.02, (beacon["name"], east, north, own)
        corners = [tuple(map(float, link.get("point").split(",")))
                   for link in last[f"foxhunt.{title}.ellipse-95.{beacon['name']}"].iterfind("detail/link")]
        assert corners[0] == corners[-1] and len(corners) == 25
        local = [metres(*corner) for corner in corners]
        distances = [math.hypot(e - east, n - north) for e, n in local]
        major, minor = (beacon["ellipse_95"][key] for key in ("semi_major", "semi_minor"))
        assert abs(max(distances) / major - 1) < 0.02 and abs(min(distances) / minor - 1) < 0.05, (distances, major)
        assert abs(float(fix.find("point").get("ce")) - major) < 0.06
        assert counts[fix.get("uid")] > 2, "a fix that moves"
    fixes = [uid for uid in last if ".fix." in uid]
    assert len(fixes) == len(hunt["beacons"]), fixes
    bearings = [event for uid, event in last.items() if ".bearing." in uid]
    assert bearings
    for event in bearings:
        assert 0 <= float(event.find("detail/bearing").get("value")) < 360
        assert float(event.find("detail/range").get("value")) > 0
    receivers = [uid for uid in last if ".receiver." in uid]
    print(f"{name}: {len(events)} events of {len(last)} things: {len(fixes)} fixes, {len(bearings)} bearings, "
          f"{len(receivers)} receivers; the fixes as in the result")


async def pytak_reader(**settings):
    config = configparser.ConfigParser()
    config["tak"] = settings
    return await pytak.protocol_factory(config["tak"])


async def pytak_events(reader, into):
    class Receiver(pytak.RXWorker):
        async def handle_data(self, data):
            pass

    queue = asyncio.Queue()
    worker = Receiver(queue, {}, reader)
    worker.use_protobuf = False
    while True:
        await worker.run_once()
        while not queue.empty():
            into.append(queue.get_nowait())
        await asyncio.sleep(0)


async def transports():
    plain, secure = Server(), Server()
    plain_server, tcp = await plain.start(0)
    _, tls = await secure.start(0, server_tls("server"))
    heard, relayed = [], []
    group, _ = await pytak_reader(COT_URL=f"udp://{GROUP}:6969", PYTAK_MULTICAST_LOCAL_ADDR="127.0.0.1")
    member, _ = await pytak_reader(
        COT_URL=f"tls://127.0.0.1:{tls}", PYTAK_TLS_CLIENT_CERT=str(folder / "client.pem"),
        PYTAK_TLS_CLIENT_KEY=str(folder / "client.key"), PYTAK_TLS_CLIENT_CAFILE=str(folder / "team.pem"))
    tasks = [asyncio.create_task(pytak_events(group, heard)), asyncio.create_task(pytak_events(member, relayed))]

    async def restart():
        await asyncio.sleep(4)
        before = len(plain.events)
        assert before, "nothing in four seconds"
        plain_server.close()
        for writer in list(plain.writers):
            writer.transport.abort()
        await asyncio.sleep(0.5)
        await plain.start(tcp)
        return before

    hunting = run("hunt", "three-beacons", "--origin", f"{LAT},{LON}", "--pace", 40, "--out", folder / "out",
                  "--cot", f"tcp://127.0.0.1:{tcp}", "--cot", f"tls://127.0.0.1:{tls}",
                  "--cot", f"udp://{GROUP}:6969", "--cot-from", "127.0.0.1",
                  "--cot-ca", folder / "truststore-old.p12", "--cot-cert", folder / "client-new.p12")
    (out, err), before = await asyncio.gather(hunting, restart())
    await asyncio.sleep(1)
    hunt = json.loads(out)
    for task in tasks:
        task.cancel()
    assert "it is tried again" in err, err
    assert "nothing is encrypted" in err and f"tls://127.0.0.1:{tls}: nothing" not in err, err
    assert {client for client, _ in secure.clients} == {"client"}
    judge(f"TCP, restarted after {before} events", plain.events[before:], hunt)
    judge(f"TLS ({secure.clients[-1][1]})", secure.events, hunt)
    judge("UDP multicast, by pytak", heard, hunt)
    judge("relayed over TLS, by pytak", relayed, hunt)
    return hunt


async def refusals():
    """Nothing is sent to a server that is not the team's, and no flag sends it anyway."""
    found = ["locate", "docs/walk.csv", "--cot-ca", folder / "team.pem"]
    own = ["--cot-cert", folder / "client.pem", "--cot-key", folder / "client.key"]
    for what, tls, host, more, why in [
        ("another authority", server_tls("stranger"), "127.0.0.1", own, "certificate is refused"),
        ("another name", server_tls("server"), "127.0.0.1",
         [*own, "--cot-server-name", "tak.other"], "certificate is refused"),
        ("no certificate of one's own", server_tls("server"), "127.0.0.1", [], "refuses"),
    ]:
        server = Server()
        _, port = await server.start(0, tls)
        _, err = await run(*found, *more, "--cot", f"tls://{host}:{port}", fails=True)
        assert why in err and not server.events, (what, err)
    server = Server()
    _, port = await server.start(0, server_tls("server"))
    for ca, cert, key in (("team.pem", "client.pem", "client.key"), ("team.pem", "client.pem", "client-locked.key"),
                          ("truststore-new.p12", "client-old.p12", None), ("truststore-old.p12", "client-new.p12", None)):
        key = ["--cot-key", folder / key] if key else []
        await run("locate", "docs/walk.csv", "--cot", f"tls://127.0.0.1:{port}", "--cot-ca", folder / ca, "--cot-cert",
                  folder / cert, "--cot-server-name", "tak.example", *key)
    last, counts = read(server.events)
    (fix,) = [uid for uid in last if ".fix." in uid]
    assert counts[fix] == 4 and not [uid for uid in last if ".receiver." in uid], counts
    _, err = await run("locate", "docs/walk.csv", "--cot", f"tls://127.0.0.1:{port}", fails=True)
    assert "--cot-ca" in err
    print("TLS: another authority, another name and a client without a certificate are refused; PEM, locked PEM and "
          "PKCS#12 of OpenSSL 3 and of old are taken")


async def flight():
    """An emulated flight: its drones move, once a second."""
    server = Server()
    _, port = await server.start(0)
    await run("fly", "--emulate", "pritzl-6.1", "--pace", 10, "--out", folder / "fly", "--cot", f"tcp://127.0.0.1:{port}")
    tracks = {}
    for event in server.events:
        event = etree.fromstring(event.strip())
        if ".receiver." in event.get("uid"):
            point = event.find("point")
            tracks.setdefault(event.get("uid"), set()).add((point.get("lat"), point.get("lon")))
    assert len(tracks) == 3 and all(len(track) > 5 for track in tracks.values()), tracks
    print(f"fly: {[len(track) for track in tracks.values()]} places of three drones")


def fetch(url, **headers):
    with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=10) as answer:
        return answer.read(), answer.headers.get_content_type()


async def served():
    """The hunt for programs that fetch it, behind its token."""
    token = "correct-horse"
    process = await asyncio.create_subprocess_exec(
        foxhunt, "hunt", "--live=127.0.0.1:0", "--live-token", token, "--origin", f"{LAT},{LON}", "--pace", "60",
        "--out", str(folder / "served"), stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
    try:
        address = None
        while not address:
            address = re.search(rb"http://([^/]+)/", await process.stderr.readline())
        at = f"http://{address[1].decode()}"
        await asyncio.sleep(3)
        of = {}
        for path in ("fixes.geojson", "fixes.czml", "fixes.kml", "link.kml"):
            try:
                fetch(f"{at}/{path}")
                raise AssertionError(f"{path} without a token")
            except urllib.error.HTTPError as error:
                assert error.code == 401
            bearer = fetch(f"{at}/{path}", Authorization=f"Bearer {token}")[0]
            of[path], kind = fetch(f"{at}/{path}?token={token}")
            print(f"{path}: {len(of[path])} bytes, {kind}; {len(bearer)} by the header")
        features = json.loads(of["fixes.geojson"])["features"]
        assert {"fix", "ellipse-95", "bearing"} <= {feature["properties"]["kind"] for feature in features}
        packets = json.loads(of["fixes.czml"])
        assert packets[0]["id"] == "document" and packets[0]["version"] == "1.0"
        assert len({packet["id"] for packet in packets}) == len(packets) == len(features) + 1
        kml = etree.fromstring(of["link.kml"])
        (href,) = kml.iter("{*}href")
        inner = etree.fromstring(fetch(href.text)[0])
        assert len(list(inner.iter("{*}Placemark"))) >= len(features)
    finally:
        process.kill()
        await process.wait()


async def main():
    certificates()
    await transports()
    await refusals()
    await flight()
    await served()


asyncio.run(main())
