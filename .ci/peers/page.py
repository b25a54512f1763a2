"""Drops recordings on the page of `foxhunt page` and holds its answers against the program's.

usage: page.py CHROMIUM FOXHUNT AXE FOLDER FILE...

FOLDER holds foxhunt.html, and gets screenshots.
"""

import csv
import functools
import http.server
import json
import math
import os
import re
import subprocess
import sys
import threading
import time

from playwright.sync_api import sync_playwright

from report import examined, wait_for

# What the page has to keep: seconds to the first fix of docs/walk.csv and of 100,000 rows, and bytes.
FIRST_S, MANY_S, MOST_BYTES = 2.0, 10.0, 6_000_000
# Relative to a number's size. Answers are the program's to the bit, but for the p of residuals: the distributions' library
# calls functions that the C library and WebAssembly round differently in the last bit.
TOLERANCE = 1e-15
SIZES = {"desk": (1400, 900), "phone": (390, 844)}
# Where the phone is at first.
HERE = {"latitude": 50.0755, "longitude": 14.4378, "accuracy": 6}
SENSORS = ["geolocation", "accelerometer", "gyroscope", "magnetometer"]


def open_page(browser, folder, size="desk", scheme="light", permissions=SENSORS, before=None):
    width, height = SIZES[size]
    context = browser.new_context(
        viewport={"width": width, "height": height}, color_scheme=scheme, has_touch=size == "phone", offline=True, accept_downloads=True,
        geolocation=HERE, permissions=permissions,
    )
    page = context.new_page()
    if before:
        page.add_init_script(before)
    page.wrong, page.requests = [], []
    page.on("console", lambda message: page.wrong.append(message.text))
    page.on("pageerror", lambda error: page.wrong.append(str(error)))
    page.on("request", lambda request: page.requests.append(request.url))
    page.goto("file://" + os.path.abspath(os.path.join(folder, "foxhunt.html")))
    wait_for(page, "foxhunt.ready")
    return page


def drop(page, paths, seconds=120):
    """Drops files as a person does; returns what came of them."""
    before = page.evaluate("foxhunt.done")
    handle = page.evaluate_handle("new DataTransfer()")
    for path in paths:
        with open(path, "rb") as file:
            text = file.read().decode("latin-1")
        page.evaluate(
            """([handle, name, text]) => {
                const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
                handle.items.add(new File([bytes], name));
            }""",
            [handle, os.path.basename(path), text],
        )
    page.dispatch_event("body", "drop", {"dataTransfer": handle})
    for _ in range(seconds * 20):
        if page.evaluate("foxhunt.done") > before:
            break
        page.wait_for_timeout(50)
    else:
        raise AssertionError(f"{paths}: no end in {seconds} s")
    return page.evaluate(
        "foxhunt.runs.map(({ work, args, text, errors, notes, code, report, firstMs }) => ({ work, args, text, errors, notes, code, report: report?.length, firstMs }))"
    )


def answer(foxhunt, arguments, folder):
    """The program's own answer in the folder of the files: its JSON as text, its errors, its code."""
    arguments = [word for word in arguments if word not in ("--report", "report.html")]
    run = subprocess.run([foxhunt, *arguments, "--json=lines"], capture_output=True, text=True, cwd=folder)
    lines = [line for line in run.stdout.splitlines() if line.startswith('{"kind":"result"')]
    text = lines[-1][len('{"kind":"result","value":') : -1] if lines else None
    errors = [line[len("error: ") :] for line in run.stderr.splitlines() if line.startswith("error: ")]
    return text, errors, run.returncode


def busy(foxhunt):
    """How much longer than its own time a program takes here and now, for want of a processor."""
    before, begun = os.times(), time.monotonic()
    subprocess.run([foxhunt, "locate", "docs/walk.csv", "--json"], check=True, capture_output=True)
    after = os.times()
    own = after.children_user + after.children_system - before.children_user - before.children_system
    return max(1.0, (time.monotonic() - begun) / own)


def check_time(page, foxhunt, path, limit):
    """The fix comes in time, where a processor has time for it."""
    factor = busy(foxhunt)
    [run] = drop(page, [path], 300)
    assert run["code"] == 0, run["errors"]
    seconds, factor = run["firstMs"] / 1e3, max(factor, busy(foxhunt))
    print(f"{os.path.basename(path)}: the fix {seconds:.2f} s after the drop, on processors shared by {factor:.1f}")
    assert seconds <= limit * factor, f"{path}: {seconds} s"


def difference(here, there):
    """The largest difference of two answers' numbers, relative to their size; infinite where their shapes differ."""
    if isinstance(here, bool) or isinstance(there, bool) or here is None or there is None or isinstance(here, str):
        return 0.0 if here == there else math.inf
    if isinstance(here, (int, float)) and isinstance(there, (int, float)):
        return abs(here - there) / max(1.0, abs(here), abs(there))
    if isinstance(here, list) and isinstance(there, list) and len(here) == len(there):
        return max((difference(a, b) for a, b in zip(here, there)), default=0.0)
    if isinstance(here, dict) and isinstance(there, dict) and here.keys() == there.keys():
        return max((difference(value, there[key]) for key, value in here.items()), default=0.0)
    return math.inf


def check_answers(page, foxhunt, paths):
    """Each file by itself; returns the number that are the program's to the bit, and the others."""
    same, others = 0, {}
    for path in paths:
        [run] = drop(page, [path])
        text, errors, code = answer(foxhunt, run["args"], os.path.dirname(os.path.abspath(path)))
        name = os.path.basename(path)
        if run["text"] == text and run["errors"] == errors and run["code"] == code:
            same += 1
        elif text and run["text"]:
            others[name] = difference(json.loads(run["text"]), json.loads(text))
        else:
            others[name] = f"{run['errors']} {run['code']} instead of {errors} {code}"
        if run["text"] and run["work"] in ("locate", "replay"):
            assert run["report"], f"{name} has no report page"
            assert page.locator("#fixes tbody tr").count() >= 1
    return same, others


def check_works(page, foxhunt, folder):
    """Other commands than that of the kind of file."""
    known = os.path.join(folder, "known.csv")
    many(known, 400, "truth_east_m,truth_north_m", "300,200")
    for work, path, table in (("judge", known, "Each estimator"), ("bearing", "archive/tests/data/uavrt-rotation.csv", "Bearings of the turns")):
        page.locator("#work").select_option(work)
        [run] = drop(page, [path])
        text, errors, code = answer(foxhunt, run["args"], os.path.dirname(os.path.abspath(path)))
        assert (run["errors"], run["code"]) == (errors, code) == ([], 0), run["errors"]
        by = difference(json.loads(run["text"]), json.loads(text))
        print(f"{work} {os.path.basename(path)} differs by {by:.1e} of its size")
        assert by <= TOLERANCE
        assert page.get_by_role("region", name=table).locator("tbody tr").count() >= 1
    page.locator("#work").select_option("")
    # A located recording with a truth offers to be judged.
    drop(page, [known])
    before = page.evaluate("foxhunt.done")
    page.get_by_role("button", name="Judge against the recorded truth").click()
    wait_for(page, f"foxhunt.done > {before}")
    assert page.evaluate("foxhunt.runs[0].work") == "judge" and page.evaluate("foxhunt.runs[0].code") == 0


def check_replay(page, foxhunt, folder):
    """A hunt's log replays to the bit, whichever processor flew it."""
    subprocess.run([foxhunt, "hunt", "--out", os.path.join(folder, "hunt")], check=True, capture_output=True)
    [run] = drop(page, [os.path.join(folder, "hunt", "hunt.jsonl")])
    result = json.loads(run["text"])
    assert (run["work"], run["errors"]) == ("replay", []), run["errors"]
    assert result["identical"] == result["compared"] > 0, result
    assert page.locator("#fixes tbody tr").count() == len(result["beacons"])


def check_simulation(page, foxhunt, folder):
    """A simulated hunt in the page finds what the program's does, and its report page is there."""
    page.locator("#tab-simulation").click()
    page.locator("#scenario").select_option("one-drone")
    page.locator("#seed").fill("3")
    before = page.evaluate("foxhunt.done")
    page.locator("#simulate").click()
    wait_for(page, f"foxhunt.done > {before}", 300)
    text, errors, log = page.evaluate("[foxhunt.runs[0].text, foxhunt.runs[0].errors, foxhunt.runs[0].log]")
    assert not errors, errors
    there, _, _ = answer(foxhunt, ["hunt", "one-drone", "--seed", "3", "--out", os.path.join(folder, "simulated")], folder)
    # Sines of another C library, through a hunt.
    by = difference(json.loads(text), json.loads(there))
    print(f"the simulated hunt differs by {by:.1e} of its size")
    assert by <= 1e-6 and log.startswith('{"foxhunt_log"')
    assert page.locator("#fixes tbody tr").count() == len(json.loads(text)["beacons"]) and report_frame(page)
    page.locator("#tab-simulation").press("ArrowLeft")
    assert page.locator("#drop").is_visible() and page.locator("#simulated").is_hidden()


def drag(page, mark, by):
    """Drags a mark of the map by so many pixels, as a hand does."""
    page.locator(mark).scroll_into_view_if_needed()
    box = page.locator(f"{mark} .grip").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + by[0], y + by[1], steps=4)
    page.mouse.up()


def download(page, button, path):
    """Presses a button that saves a file, and keeps the file."""
    with page.expect_download() as saved:
        page.locator(button).click()
    saved.value.save_as(path)
    return path


def check_edited(page, foxhunt, folder):
    """A scenario with dragged places, another antenna, noise, estimator and planner: its hunt and its many hunts are the program's."""
    page.locator("#tab-simulation").click()
    page.locator("#scenario").select_option("one-drone")
    label = page.locator("#beacon-0").get_attribute("aria-label")
    drag(page, "#beacon-0", (-40, 30))
    page.locator("#drone-0").press("Shift+ArrowRight")
    assert page.locator("#beacon-0").get_attribute("aria-label") != label
    assert page.evaluate("document.activeElement.id") == "drone-0"
    page.locator("#antenna").select_option("patch")
    page.locator("#simulated-estimator").select_option("ukf")
    page.locator("#planner").select_option("orbit")
    page.locator("#pattern-sigma").fill("3")
    page.locator("#shadowing-sigma").fill("2.5")
    page.locator("#seed").fill("3")
    saved = download(page, "#scenario-save", os.path.join(folder, "one-drone-edited.toml"))
    with open(saved, encoding="utf-8") as file:
        text = file.read()
    assert 'antenna = "patch"' in text and "sigma_db = 2.5" in text and "east_m = 16.17" in text, text
    before = page.evaluate("foxhunt.done")
    page.locator("#simulate").click()
    wait_for(page, f"foxhunt.done > {before}", 300)
    here, errors, args = page.evaluate("[foxhunt.runs[0].text, foxhunt.runs[0].errors, foxhunt.runs[0].args]")
    assert not errors, errors
    # The command line is the first line of the file.
    flags = ["--seed", "3", "--planner", "orbit"]
    assert args[:6] == ["hunt", "one-drone-edited.toml", *flags] and text.startswith(f"# foxhunt hunt one-drone-edited.toml {' '.join(flags)}\n"), (args, text)
    there, _, _ = answer(foxhunt, ["hunt", saved, *flags, "--out", os.path.join(folder, "edited")], folder)
    by = difference(json.loads(here), json.loads(there))
    print(f"the hunt of an edited scenario differs by {by:.1e} of its size")
    assert by <= 1e-6, (here, there)

    page.locator("#hunts").fill("8")
    page.locator("#many").click()
    wait_for(page, "!document.getElementById('many').disabled", 300)
    status = page.locator("#many-status").text_content()
    assert status.startswith("one-drone-edited.toml: 8 of 8 hunts in "), status
    [row] = page.evaluate("foxhunt.many.rows")
    there, _, _ = answer(foxhunt, ["campaign", saved, "--runs", "8", "--jobs", "1", *flags], folder)
    [[beacon]] = [one["beacons"] for one in json.loads(there)["estimators"]]
    mine = [*row["error"], *row["steps"], *row["path"], int(row["inside"].split()[0]) / row["hunts"]]
    theirs = [beacon[key][p] for key in ("error_m", "steps", "path_m") for p in ("p50", "p90")] + [beacon["coverage_95"]]
    by = difference(mine, theirs)
    print(f"the distributions of its 8 hunts differ by {by:.1e} of the campaign's size")
    assert by <= 1e-6, (mine, theirs)
    assert page.locator("#distributions svg").count() == 2
    with open(download(page, "#many-save", os.path.join(folder, "hunts.csv")), encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["seed"]) for row in rows] == list(range(3, 11)), rows

    # A hunt that cannot be flown says so, and the rest is not tried; the others can be stopped.
    page.locator("#simulated-flags").fill("--extractor nothing")
    page.locator("#hunts").fill("200")
    page.locator("#many").click()
    wait_for(page, "!document.getElementById('many').disabled", 60)
    assert page.evaluate("foxhunt.many.failures.length") < 20
    assert "could not go on" in page.locator("#distributions .error").text_content()
    page.locator("#simulated-flags").fill("")
    page.locator("#many").click()
    wait_for(page, "foxhunt.many.hunts.length > 1")
    page.locator("#many-stop").click()
    wait_for(page, "!document.getElementById('many').disabled", 10)
    assert 2 <= page.evaluate("foxhunt.many.hunts.length") < 200 and page.evaluate("foxhunt.many.failures.length") == 0
    page.locator("#scenario-reset").click()
    assert page.locator("#beacon-0").get_attribute("aria-label") == label
    page.locator("#tab-recordings").click()


# A receiver behind Web Serial and one behind Web Bluetooth, which send these pieces.
RECEIVERS = """(() => {
    const pieces = ["RSSI: -7", "1 dBm\\n", "12345 -64.5\\r\\n"].map((piece) => new TextEncoder().encode(piece));
    const port = {
        open: async () => {}, close: async () => {},
        readable: { getReader: () => { let at = 0; return { read: () => (at < pieces.length ? Promise.resolve({ value: pieces[at++], done: false }) : new Promise(() => {})), cancel: async () => {}, releaseLock() {} }; } },
    };
    Object.defineProperty(navigator, "serial", { value: { requestPort: async () => port } });
    const channel = Object.assign(new EventTarget(), { properties: { notify: true }, startNotifications: async () => setTimeout(() => { channel.value = new TextEncoder().encode("level -80"); channel.dispatchEvent(new Event("characteristicvaluechanged")); }, 100) });
    const server = { getPrimaryService: async () => ({ getCharacteristics: async () => [channel] }), disconnect() {} };
    const device = Object.assign(new EventTarget(), { gatt: { connect: async () => server } });
    Object.defineProperty(navigator, "bluetooth", { value: { requestDevice: async () => device } });
})()"""


def turn_phone(page, heading, beta=0):
    """Turns the phone's upper edge to a magnetic heading."""
    page.evaluate(
        "([alpha, beta]) => { dispatchEvent(new DeviceOrientationEvent('deviceorientationabsolute', { alpha, beta, gamma: 0, absolute: true })); }",
        [(360 - heading) % 360, beta],
    )


def go(page, latitude, longitude):
    page.context.set_geolocation({"latitude": latitude, "longitude": longitude, "accuracy": 6})
    wait_for(page, f"foxhunt.field.place.lat === {latitude} && foxhunt.field.place.lon === {longitude}")


def take_bearings(page):
    """Starts the sensors and takes two bearings by the compass, one of them held."""
    page.locator("#tab-field").click()
    page.locator("#watch").click()
    wait_for(page, "foxhunt.field.declination !== null")
    turn_phone(page, 45)
    assert page.locator("#compass").text_content().startswith("45°, "), page.locator("#compass").text_content()
    page.locator("#bearing-here").click()
    wait_for(page, "foxhunt.field.located === 1")
    go(page, 50.0755, 14.4398)
    turn_phone(page, 315)
    page.locator("#hold").click()
    turn_phone(page, 100)
    page.locator("#bearing-here").click()
    wait_for(page, "foxhunt.field.located === 2")


def check_field(browser, foxhunt, folder):
    """A list that is taken with a phone is located as the program locates it, and stays in the browser."""
    page = open_page(browser, folder, "phone", before=RECEIVERS)
    entries = page.locator("#entries li")
    turn_phone(page, 0)
    assert page.locator("#compass").text_content() == "not known", "the sensors start by a press"
    take_bearings(page)
    assert [entry["magnetic"] for entry in page.evaluate("foxhunt.field.entries")] == [45, 315]
    # A phone that stands upright has no heading; a typed bearing is from the North that is chosen.
    turn_phone(page, 10, beta=80)
    page.locator("#bearing-here").click()
    assert "Hold the phone flat" in page.locator("#field-status").text_content() and entries.count() == 2
    go(page, 50.0775, 14.4390)
    page.locator("#bearing").fill("181")
    page.locator("#north").select_option("true")
    page.locator("#bearing-sigma-deg").fill("8")
    page.locator("#bearing-here").click()
    wait_for(page, "foxhunt.field.located === 3")
    # Levels, typed and of receivers that send lines.
    go(page, 50.0765, 14.4388)
    page.locator("#level").fill("-55")
    page.locator("#level-here").click()
    wait_for(page, "foxhunt.field.located === 4")
    page.locator("#each").check()
    page.locator("#serial").click()
    wait_for(page, "foxhunt.field.entries.length === 5 && document.getElementById('level').value === '-64.5'")
    page.locator("#disconnect").click()
    page.locator("#bluetooth").click()
    wait_for(page, "document.getElementById('received').textContent.includes('level -80')")
    wait_for(page, "foxhunt.field.located >= 5")
    assert page.evaluate("foxhunt.field.entries[4].level") == -71
    lines = {"-71": -71, "RSSI=-92.5dBm snr 3": -92.5, "t 1200 ms, -70": -70, "2026-11-28 61 dB": 61, "nothing": None, "−63 dBm": -63}
    assert page.evaluate("(lines) => lines.map(foxhunt.field.levelIn)", list(lines)) == list(lines.values())
    page.locator("#each").uncheck()

    # One is struck out, one deleted and put back.
    located = page.evaluate("foxhunt.field.located")
    entries.nth(3).get_by_role("button", name="Strike out").click()
    wait_for(page, f"foxhunt.field.located > {located}")
    count = entries.count()
    entries.nth(0).get_by_role("button", name="Delete").click()
    assert entries.count() == count - 1
    page.locator("#entries-undo").click()
    assert entries.count() == count
    wait_for(page, "document.getElementById('status').textContent.startsWith('Done')")
    page.wait_for_timeout(1500)
    wait_for(page, "document.getElementById('status').textContent.startsWith('Done')")
    saved = download(page, "#entries-save", os.path.join(folder, "field.csv"))
    here, args = page.evaluate("[foxhunt.runs[0].text, foxhunt.runs[0].args]")
    there, errors, code = answer(foxhunt, args, folder)
    assert (errors, code) == ([], 0), errors
    assert here == there, (here, there)
    [fix] = json.loads(here)
    print(f"in the field: the fix of {count} entries is the program's to the bit")
    assert fix["observations"] == count - 1, fix
    # Distance and direction, beside the program's own frame: the origin is the first entry.
    go(page, 50.0795, 14.4350)
    text = page.locator("#field-fix").text_content()
    metres, degrees, by_compass = map(float, re.match(r"(\d+) m from here, (\d+)° from true North, (\d+)° by the compass", text).groups())
    me = page.evaluate("foxhunt.field.place")
    east = fix["estimate"]["east_m"] - math.radians(me["lon"] - HERE["longitude"]) * 6.3781e6 * math.cos(math.radians(HERE["latitude"]))
    north = fix["estimate"]["north_m"] - math.radians(me["lat"] - HERE["latitude"]) * 6.37e6
    assert abs(metres - math.hypot(east, north)) <= 1 + 0.01 * metres, (metres, east, north)
    assert abs((degrees - math.degrees(math.atan2(east, north)) + 180) % 360 - 180) <= 3, (degrees, east, north)
    declination = page.evaluate("foxhunt.field.declination")
    assert abs((degrees - by_compass - declination + 180) % 360 - 180) <= 1.01 and 4.5 < declination < 6, declination
    assert report_frame(page)

    # The list is there again in a page that is opened again, and gone when it is cleared.
    page.reload()
    wait_for(page, "foxhunt.ready")
    assert entries.count() == count
    page.locator("#tab-field").click()
    wait_for(page, "foxhunt.field.located === 1")
    assert page.evaluate("foxhunt.runs[0].text") == here
    page.once("dialog", lambda dialog: dialog.dismiss())
    page.locator("#entries-clear").click()
    assert entries.count() == count
    page.once("dialog", lambda dialog: dialog.accept())
    page.locator("#entries-clear").click()
    assert entries.count() == 0
    assert not page.wrong, page.wrong
    page.context.close()

    # A browser that allows no place and keeps nothing says so; the place is then entered.
    page = open_page(browser, folder, "phone", permissions=[], before="Storage.prototype.setItem = () => { throw new Error('no'); };")
    page.locator("#tab-field").click()
    page.locator("#watch").click()
    wait_for(page, "document.getElementById('field-status').textContent.includes('may not use the place')")
    page.get_by_text("Place by hand", exact=True).click()
    page.locator("#hand-lat").fill("50.0755")
    page.locator("#hand-lon").fill("14.4378")
    # The compass of an iPhone.
    page.evaluate("dispatchEvent(Object.assign(new Event('deviceorientation'), { webkitCompassHeading: 90, beta: 5 }))")
    page.locator("#bearing-here").click()
    wait_for(page, "foxhunt.field.entries.length === 1")
    entry = page.evaluate("foxhunt.field.entries[0]")
    assert entry["sigma"] is None and entry["magnetic"] == 90 and 94 < entry["bearing"] < 96, entry
    assert "refuses to keep the list" in page.locator("#kept").text_content()
    assert not page.wrong, page.wrong
    page.context.close()


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def check_installable(playwright, chromium, foxhunt, folder):
    """A page from a server may be installed, and opens and locates when the server is gone."""
    site = os.path.join(folder, "site")
    os.mkdir(site)
    subprocess.run([foxhunt, "page", "--out", os.path.join(site, "index.html"), "--installable"], check=True, capture_output=True)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=site))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    # Chromium installs nothing in its private mode, which a new context is.
    context = playwright.chromium.launch_persistent_context(os.path.join(folder, "profile"), executable_path=chromium, args=["--no-sandbox"])
    page = context.new_page()
    wrong = []
    page.on("console", lambda message: wrong.append(message.text))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    address = f"http://127.0.0.1:{server.server_address[1]}/"
    page.goto(address)
    wait_for(page, "foxhunt.ready")
    session = context.new_cdp_session(page)
    assert session.send("Page.getAppManifest")["errors"] == []
    assert session.send("Page.getInstallabilityErrors")["installabilityErrors"] == []
    page.evaluate("navigator.serviceWorker.ready.then(() => true)")
    server.shutdown()
    server.server_close()
    for where in (address, f"{address}index.html"):
        page.goto(where)
        wait_for(page, "foxhunt.ready")
    [run] = drop(page, ["docs/walk.csv"])
    assert run["code"] == 0, run["errors"]
    assert not wrong, wrong
    print("from a server it is installable, and works when the server is gone")
    context.close()


def many(path, rows, more_names="", more_cells=""):
    """Levels along a path over a field, of a transmitter at (300, 200)."""
    state = 1
    with open(path, "w", encoding="utf-8") as file:
        names, cells = f",{more_names}".rstrip(","), f",{more_cells}".rstrip(",")
        file.write(f"time_s,east_m,north_m,rss_dbm{names}\n")
        for row in range(rows):
            # To and fro along lanes that are 20 m apart, at 1.2 m/s.
            lane, along = divmod(row, rows // 20)
            east, north = 600.0 * along / (rows // 20), 20.0 * lane
            east = 600.0 - east if lane % 2 else east
            state = (1103515245 * state + 12345) % 2**31
            noise = 8.0 * (state / 2**31 - 0.5)
            level = -30 - 25 * math.log10(math.hypot(east - 300.0, north - 200.0) + 1.0) + noise
            file.write(f"{row / 10 + 10 * lane:.1f},{east:.2f},{north:.2f},{level:.2f}{cells}\n")


def check_mapping(page, folder):
    """A table that nobody knows, mapped by hand."""
    table, saved = os.path.join(folder, "strange.csv"), os.path.join(folder, "by-hand.toml")
    with open("docs/walk.csv", encoding="utf-8") as file:
        rows = [line.strip().split(",") for line in file if not line.startswith("#")][1:]
    with open(table, "w", encoding="utf-8") as file:
        file.write("a walk\nq1;q2;q3;q4;q5\n")
        file.writelines(";".join([t, lat, lon, height, f"{-float(level):.1f}"]) + "\n" for t, lat, lon, height, level in rows)
    [refused] = drop(page, [table])
    assert refused["code"] == 2 and "no known format" in refused["errors"][0], refused
    assert page.locator("#mapping").is_visible()
    assert page.locator("#preview tbody tr").count() == 10
    for name, ours in (("q1", "time_s"), ("q2", "lat_deg"), ("q3", "lon_deg"), ("q4", "alt_agl_m"), ("q5", "rss_db")):
        page.get_by_label(f"{name} holds").select_option(ours)
    page.get_by_label("Factor of q5").fill("-1")
    with page.expect_download() as download:
        page.locator("#mapping-save").click()
    download.value.save_as(saved)
    before = page.evaluate("foxhunt.done")
    page.locator("#mapping-use").click()
    wait_for(page, f"foxhunt.done > {before}")
    return table, saved, page.evaluate("foxhunt.runs[0].text")


def names_of_controls(page):
    """Controls without an accessible name."""
    return page.evaluate(
        """() => [...document.querySelectorAll("button, input, select, iframe, progress, [role=region]")].filter((one) => {
            const labels = one.labels ? [...one.labels] : [];
            const text = one.tagName === "BUTTON" ? one.textContent : "";
            return !(text + labels.map((label) => label.textContent).join("") + (one.getAttribute("aria-label") || "") + (one.title || "")).trim();
        }).map((one) => one.outerHTML.slice(0, 80))"""
    )


def contrasts(page):
    """Pairs of text and ground below 4.5 to 1."""
    return page.evaluate(
        """() => {
            const parse = (text) => text.match(/[\\d.]+/g).map(Number);
            const light = ([r, g, b]) => [r, g, b].map((c) => { c /= 255; return c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4; })
                .reduce((sum, c, i) => sum + c * [0.2126, 0.7152, 0.0722][i], 0);
            const ground = (one) => { for (; one; one = one.parentElement) { const c = parse(getComputedStyle(one).backgroundColor); if (c.length < 4 || c[3] > 0.99) return c; } return [255, 255, 255]; };
            return [...document.querySelectorAll("body *")].filter((one) => one.offsetParent && !one.disabled && [...one.childNodes].some((node) => node.nodeType === 3 && node.data.trim()))
                .map((one) => { const [a, b] = [light(parse(getComputedStyle(one).color)), light(ground(one))].sort((x, y) => y - x); return [(a + 0.05) / (b + 0.05), one.outerHTML.slice(0, 80)]; })
                .filter(([ratio]) => ratio < 4.5);
        }"""
    )


def check_width_and_names(page, size, scheme):
    wide = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    assert wide <= 0, f"{size}: {wide} pixels wider than the screen"
    assert not names_of_controls(page), names_of_controls(page)
    assert not contrasts(page), (scheme, contrasts(page))


def use_tabs(page):
    """Uses the other tabs, and stops at each for a look."""
    take_bearings(page)
    yield "field"
    page.locator("#tab-simulation").click()
    page.locator("#scenario").select_option("one-drone")
    page.locator("#hunts").fill("4")
    page.locator("#many").click()
    wait_for(page, "foxhunt.many.hunts.length === 4 && !document.getElementById('many').disabled", 120)
    yield "simulation"


def check_look(browser, folder):
    """No size scrolls sideways; every control has a name; text can be read in light and dark."""
    for size in SIZES:
        for scheme in ("light", "dark"):
            page = open_page(browser, folder, size, scheme)
            page.screenshot(path=os.path.join(folder, f"{size}-{scheme}-empty.png"), full_page=True)
            drop(page, ["docs/walk.csv"])
            # It runs under the page's own policy.
            report_frame(page)
            # What is far below is not painted.
            page.locator("iframe").scroll_into_view_if_needed()
            page.wait_for_timeout(1000)
            page.screenshot(path=os.path.join(folder, f"{size}-{scheme}.png"), full_page=True)
            page.evaluate("document.getElementById('map-columns').click()")
            page.screenshot(path=os.path.join(folder, f"{size}-{scheme}-mapping.png"), full_page=True)
            check_width_and_names(page, size, scheme)
            for tab in use_tabs(page):
                page.screenshot(path=os.path.join(folder, f"{size}-{scheme}-{tab}.png"), full_page=True)
                check_width_and_names(page, size, scheme)
            assert not page.wrong, page.wrong
            page.context.close()


def check_keys(browser, folder):
    """By the keyboard alone: what has the focus, from the top to the run."""
    page = open_page(browser, folder)
    page.locator("#choose").set_input_files("docs/walk.csv")
    wait_for(page, "foxhunt.done > 0")
    seen = []
    page.evaluate("document.activeElement.blur()")
    for _ in range(16):
        page.keyboard.press("Tab")
        seen.append(page.evaluate("document.activeElement.id || document.activeElement.textContent"))
    for control in ("choose", "work", "several", "estimator", "margin", "beacon", "flags", "run"):
        assert control in seen, (control, seen)
    # From the frame of the report, where the focus may be by now.
    page.locator("#run").press("Enter")
    wait_for(page, "foxhunt.done > 1")
    assert page.locator("#status").get_attribute("role") == "status"
    assert page.locator("#status").text_content().startswith("Done in"), page.locator("#status").text_content()
    page.context.close()


def report_frame(page):
    """The frame of the report page, when it is ready."""
    for _ in range(100):
        if len(page.frames) > 1 and page.frames[1].evaluate("window.foxhunt !== undefined"):
            return page.frames[1]
        page.wait_for_timeout(100)
    raise AssertionError("no report page")


def check_strike(page):
    """A reception is struck out in the report page in its frame, with its own estimators."""
    drop(page, ["docs/walk.csv"])
    frame = report_frame(page)
    frame.evaluate("foxhunt.select(4)")
    frame.locator("#strike-one").click()
    frame.locator("#strike-status", has_text="1 reception struck out: ").wait_for(timeout=60_000)


def check_axe(browser, folder, axe):
    """axe finds nothing, before and after an answer, at both sizes, light and dark."""
    with open(axe, encoding="utf-8") as file:
        axe = file.read()
    for size in SIZES:
        for scheme in ("light", "dark"):
            page = open_page(browser, folder, size, scheme)
            found = examined(page, axe)
            drop(page, ["docs/walk.csv"])
            found += examined(page, axe)
            for _ in use_tabs(page):
                found += examined(page, axe)
            assert not found, f"{size}, {scheme}: {found}"
            page.context.close()


def main():
    chromium, foxhunt, axe, folder, *paths = sys.argv[1:]
    foxhunt = os.path.abspath(foxhunt)
    size = os.path.getsize(os.path.join(folder, "foxhunt.html"))
    assert size <= MOST_BYTES, f"{size} bytes"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        begun = time.monotonic()
        page = open_page(browser, folder)
        ready = time.monotonic() - begun
        print(f"{size} bytes, ready in {ready:.1f} s")
        check_time(page, foxhunt, "docs/walk.csv", FIRST_S)

        same, others = check_answers(page, foxhunt, paths)
        print(f"{same} of {len(paths)} answers are the program's to the bit")
        for name, by in others.items():
            print(f"  {name} differs by {by if isinstance(by, str) else format(by, '.1e')} of its size")
        assert all(not isinstance(by, str) and by <= TOLERANCE for by in others.values()), "stale: .ci/replayer --renew"

        table, saved, text = check_mapping(page, folder)
        arguments = ["locate", os.path.basename(table), "--every-beacon", "--format", os.path.basename(saved)]
        there, _, _ = answer(foxhunt, arguments, folder)
        assert difference(json.loads(text), json.loads(there)) <= TOLERANCE, "the mapping by hand"
        check_strike(page)
        check_works(page, foxhunt, folder)
        check_replay(page, foxhunt, folder)
        check_simulation(page, foxhunt, folder)
        check_edited(page, foxhunt, folder)
        check_field(browser, foxhunt, folder)
        check_installable(playwright, chromium, foxhunt, folder)

        path = os.path.join(folder, "many.csv")
        many(path, 100_000)
        check_time(page, foxhunt, path, MANY_S)

        assert not page.wrong, page.wrong
        outside = [url for url in page.requests if not url.startswith(("file://", "blob:", "data:", "about:"))]
        assert not outside, outside
        check_keys(browser, folder)
        check_look(browser, folder)
        check_axe(browser, folder, axe)
        browser.close()


main()
