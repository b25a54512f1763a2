"""digi-xbee against `foxhunt emulate xbee`: python xbee.py FOXHUNT."""

import os
import subprocess
import sys
import tempfile
import time

from digi.xbee.devices import RemoteXBeeDevice, XBeeDevice
from digi.xbee.exception import XBeeException
from digi.xbee.models.address import XBee64BitAddress
from digi.xbee.models.mode import OperatingMode
from digi.xbee.models.protocol import XBeeProtocol
from digi.xbee.models.status import TransmitStatus

FIRMWARES = {
    "zigbee": (XBeeProtocol.ZIGBEE, "4060"),
    "digimesh": (XBeeProtocol.DIGI_MESH, "9002"),
    "802.15.4": (XBeeProtocol.RAW_802_15_4, "2003"),
}
MODES = {1: OperatingMode.API_MODE, 2: OperatingMode.ESCAPED_API_MODE}
BEACON = "0013A2004B000000"
NOBODY = "0013A2004B00FFFF"


def check(holds, what):
    if not holds:
        sys.exit(f"peer: {what}")


def level(radio):
    return -radio.get_parameter("DB")[0]


def visit(port, firmware, mode):
    protocol, version = FIRMWARES[firmware]
    radio = XBeeDevice(port, 57600)
    radio.set_sync_ops_timeout(3)
    radio.open()
    try:
        check(radio.operating_mode == MODES[mode], f"mode {radio.operating_mode}")
        check(radio.get_protocol() == protocol, f"protocol {radio.get_protocol()}")
        read = radio.get_firmware_version().hex()
        check(read == version, f"firmware {read}")
        check(radio.get_node_id() == "DRONE-0", f"name {radio.get_node_id()}")
        check(level(radio) == 0, "something was received before anything was sent")

        # The emulated beacon sends back what it is sent, escaped bytes included.
        beacon = RemoteXBeeDevice(radio, XBee64BitAddress.from_hex_string(BEACON))
        sent = b"ASK\x7e\x7d\x11\x13"
        status = radio.send_data(beacon, sent)
        check(status.transmit_status == TransmitStatus.SUCCESS, f"sent: {status.transmit_status}")
        echo = radio.read_data(3)
        check(bytes(echo.data) == sent, f"echo {echo.data.hex()}")
        check(str(echo.remote_device.get_64bit_addr()) == BEACON, "another's answer")
        here = level(radio)
        check(-120 < here < -20, f"DB {here}")

        there = level(beacon)
        check(-120 < there < -20, f"remote DB {there}")

        network = radio.get_network()
        network.set_discovery_timeout(3.3)
        network.start_discovery_process()
        while network.is_discovery_running():
            time.sleep(0.05)
        found = sorted(str(device.get_64bit_addr()) for device in network.get_devices())
        check(BEACON in found, f"found {found}")

        try:
            nobody = RemoteXBeeDevice(radio, XBee64BitAddress.from_hex_string(NOBODY))
            radio.send_data(nobody, b"ASK")
            check(False, "nobody answered")
        except XBeeException:
            pass
        return here, there, len(found)
    finally:
        radio.close()


def main():
    foxhunt = sys.argv[1]
    for firmware in FIRMWARES:
        for mode in MODES:
            with tempfile.TemporaryDirectory() as folder:
                port = os.path.join(folder, "xbee")
                command = [foxhunt, "emulate", "xbee", "--link", port, "--api", str(mode)]
                command += ["--firmware", firmware]
                emulator = subprocess.Popen(command, stdout=subprocess.DEVNULL)
                try:
                    for _ in range(100):
                        if os.path.exists(port):
                            break
                        time.sleep(0.1)
                    here, there, found = visit(port, firmware, mode)
                finally:
                    emulator.terminate()
                    emulator.wait(10)
            print(
                f"digi-xbee: {firmware}, AP {mode}: opened, echo at {here} dBm, "
                f"remote DB {there} dBm, {found} found"
            )


main()
