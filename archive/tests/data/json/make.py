"""Writes the files of JSON that the tests read, by the messages' published forms.

Fields are those of the documents that the mappings in archive/formats name; numpy alone is needed:
python3 make.py
"""

import datetime
import json
import pathlib

import numpy as np

FOLDER = pathlib.Path(__file__).parent
LAT, LON = 48.2, 16.37
METRES = 111_195.0
BEGIN = datetime.datetime(2026, 6, 21, 14, 3, tzinfo=datetime.timezone.utc)
# The device, east and north of the origin in metres.
TRUTH = np.array([210.0, -140.0])
GATEWAYS = np.array(
    [[-600, -500], [0, -700], [650, -450], [800, 100], [500, 600], [-100, 750], [-700, 400], [100, 50]],
    float,
)


def degrees(place):
    east = place[0] / METRES / np.cos(np.radians(LAT))
    return round(LAT + place[1] / METRES, 7), round(LON + east, 7)


def level(rng, place, truth=TRUTH):
    distance = np.hypot(*(np.asarray(place) - truth))
    return float(np.round(-40 - 27 * np.log10(max(distance, 1.0)) + rng.normal(0, 3)))


def write(name, rows):
    text = "\n".join(row if isinstance(row, str) else json.dumps(row) for row in rows) + "\n"
    (FOLDER / name).write_text(text)


def chirpstack(rng, minute):
    time = BEGIN + datetime.timedelta(minutes=minute, microseconds=775023)
    receivers = []
    for number, place in enumerate(GATEWAYS):
        lat, lon = degrees(place)
        receivers.append(
            {
                "gatewayId": f"016c001ff10a235{number}",
                "uplinkId": int(rng.integers(2**32)),
                "rssi": int(level(rng, place)),
                "snr": float(np.round(rng.normal(5, 2), 1)),
                "channel": 2,
                "rfChain": 1,
                "location": {"latitude": lat, "longitude": lon, "altitude": 150.0},
                "context": "RFHgkQ==",
                "crcStatus": "CRC_OK",
            }
        )
    return {
        "deduplicationId": f"3ac7e3c4-4401-4b8d-9386-a5c902f9{minute:04d}",
        "time": time.isoformat(),
        "deviceInfo": {
            "tenantId": "52f14cd4-c6f1-4fbd-8f87-4025e1d49242",
            "deviceName": "fox",
            "devEui": "0101010101010101",
            "tags": {"kind": "collar"},
        },
        "devAddr": "00189440",
        "fCnt": minute,
        "fPort": 1,
        "data": "qg==",
        "rxInfo": receivers,
        "txInfo": {
            "frequency": 868100000,
            "modulation": {"lora": {"bandwidth": 125000, "spreadingFactor": 11}},
        },
    }


def chirpstack3(uplink):
    receivers = [
        {
            "gatewayID": of["gatewayId"],
            "name": "roof",
            "rssi": of["rssi"],
            "loRaSNR": of["snr"],
            "location": of["location"],
        }
        for of in uplink["rxInfo"]
    ]
    return {
        "applicationID": "4",
        "deviceName": "fox",
        "devEUI": "02aaaa010000318d",
        "rxInfo": receivers,
        "txInfo": {"frequency": 868500000, "dr": 0},
        "fCnt": uplink["fCnt"],
        "data": "YgASAACBBAAAAAk=",
        "publishedAt": uplink["time"].replace("+00:00", "Z"),
    }


def ttn(uplink):
    receivers = []
    for number, of in enumerate(uplink["rxInfo"]):
        receiver = {
            "gateway_ids": {"gateway_id": f"gateway-{number}", "eui": of["gatewayId"].upper()},
            "time": uplink["time"].replace("+00:00", "Z"),
            "timestamp": 1522298865,
            "rssi": of["rssi"],
            "channel_rssi": of["rssi"],
            "snr": of["snr"],
            "location": {**of["location"], "source": "SOURCE_REGISTRY"},
        }
        if number < 2:
            # Two gateways of another network, which the broker names alike.
            receiver["gateway_ids"] = {"gateway_id": "packetbroker"}
            receiver["packet_broker"] = {"forwarder_gateway_id": f"gateway-{number}"}
        receivers.append(receiver)
    return {
        "end_device_ids": {
            "device_id": "fox",
            "application_ids": {"application_id": "app1"},
            "dev_eui": "0004A30B001C0530",
        },
        "correlation_ids": ["as:up:01"],
        "received_at": uplink["time"].replace("+00:00", "Z"),
        "uplink_message": {
            "f_cnt": uplink["fCnt"],
            "frm_payload": "gkHe",
            "rx_metadata": receivers,
            "settings": {"frequency": "867500000"},
        },
    }


def chasemapper(rng):
    time = BEGIN.isoformat()
    rows = [{"log_type": "CAR POSITION", "log_time": time, "time": time, "lat": LAT, "lon": LON}]
    for number, place in enumerate([[-600, -500], [700, -300], [0, 800], [900, 500]]):
        lat, lon = degrees(place)
        east, north = TRUTH - place
        bearing = (np.degrees(np.arctan2(east, north)) + rng.normal(0, 2)) % 360
        rows.append(
            {
                "type": "BEARING",
                "bearing_type": "absolute",
                "source": f"yagi-{number}",
                "latitude": lat,
                "longitude": lon,
                "bearing": float(np.round(bearing, 1)),
                "log_type": "BEARING",
                "log_time": (BEGIN + datetime.timedelta(minutes=number)).isoformat(),
            }
        )
    return rows


def krakensdr(rng):
    rows = []
    for number in range(24):
        angle = 2 * np.pi * number / 24
        place = np.array([500 * np.cos(angle), 500 * np.sin(angle)])
        heading = (-np.degrees(angle)) % 360
        east, north = TRUTH - place
        bearing = np.degrees(np.arctan2(east, north)) - heading + rng.normal(0, 4)
        lat, lon = degrees(place)
        rows.append(
            {
                "station_id": "rover",
                "tStamp": int(BEGIN.timestamp() * 1000) + 20000 * number,
                "latitude": str(lat),
                "longitude": str(lon),
                "gpsBearing": str(round(heading, 1)),
                "radioBearing": str(int(bearing % 360)),
                "conf": "5.20",
                "power": f"{level(rng, place):.1f}",
                "freq": 433920000,
                "antType": "UCA",
                "latency": 100,
                "doaArray": ",".join(["0.50"] * 360),
            }
        )
    return rows


def meshtastic(rng):
    rows = []
    for number in range(80):
        place = [-400 + 100 * (number % 10), -400 + 110 * (number // 10)]
        lat, lon = degrees(place)
        stamp = int(BEGIN.timestamp()) + 60 * number
        row = {
            "channel": 0,
            "from": 2130636288,
            "hops_away": 0,
            "id": 452664778 + number,
            "payload": {
                "altitude": 170,
                "latitude_i": round(lat * 1e7),
                "longitude_i": round(lon * 1e7),
                "time": stamp,
            },
            "rssi": int(level(rng, place)),
            "sender": "!7efeee00",
            "snr": 6.5,
            "timestamp": stamp,
            "to": -1,
            "type": "position",
        }
        rows.append(row)
        if number % 20 == 0:
            rows.append({**row, "hops_away": 2, "rssi": -20, "timestamp": stamp + 5})
            rows.append({"from": 2130636288, "type": "text", "payload": {"text": "hello"}})
    return rows


def espresense(rng):
    rows = []
    nodes = {"office": [0, 0], "kitchen": [8, 0], "hall": [0, 6], "bath": [8, 6], "attic": [4, 10]}
    for _ in range(10):
        for node, place in nodes.items():
            message = {
                "id": "tag:keys",
                "mac": "dd8800003777",
                "rssi@1m": -59,
                "rssi": level(rng, np.array(place) + 0.01, np.array([5.0, 4.0])) - 20,
                "distance": 6.58,
            }
            rows.append(f"espresense/devices/tag:keys/{node} {json.dumps(message)}")
    lines = [f"{node},{east},{north},2" for node, (east, north) in nodes.items()]
    (FOLDER / "nodes.csv").write_text("node,east_m,north_m,up_m\n" + "\n".join(lines) + "\n")
    return rows


def main():
    rng = np.random.default_rng(45)
    uplinks = [chirpstack(rng, minute) for minute in range(12)]
    write("chirpstack.jsonl", uplinks)
    write("chirpstack3.jsonl", [chirpstack3(uplink) for uplink in uplinks])
    write("ttn.jsonl", [{"result": ttn(uplink)} for uplink in uplinks])
    write("chasemapper.log", chasemapper(rng))
    (FOLDER / "krakensdr.json").write_text(json.dumps(krakensdr(rng), indent=1) + "\n")
    write("meshtastic.jsonl", meshtastic(rng))
    write("espresense.txt", espresense(rng))


main()
