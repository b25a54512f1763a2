"""Looks at every kind of page at two sizes, light and dark, with axe, and uses what the map offers.

usage: report_looks.py CHROMIUM FOXHUNT AXE FOLDER

FOLDER gets the pages and their screenshots. Coordinates are compared with those of pyproj and mgrs, QR codes read by
OpenCV.
"""

import math
import os
import re
import subprocess
import sys

import cv2
import mgrs
import pyproj
from playwright.sync_api import sync_playwright

import report_tiles
from report import examined, settle, wait_for
from report_live import Program, new_page, open_page

SIZES = {"desk": (1400, 900), "phone": (390, 844)}
# The whole Earth, and the zones of Norway and Svalbard.
PLACES = [(50.0755, 14.4378), (-33.9, 151.2), (60.4, 5.3), (78.2, 15.6), (0.001, -0.001), (83.9, 179.9), (-79.9, -179.99)]


def look(browser, axe, path, folder):
    name = os.path.splitext(os.path.basename(path))[0]
    for size, (width, height) in SIZES.items():
        for scheme in ("light", "dark"):
            context = browser.new_context(
                viewport={"width": width, "height": height}, color_scheme=scheme, has_touch=size == "phone", offline=True
            )
            page = context.new_page()
            wrong = []
            page.on("console", lambda message: wrong.append(message.text))
            page.on("pageerror", lambda error: wrong.append(str(error)))
            page.goto("file://" + os.path.abspath(path))
            wait_for(page, "window.foxhunt !== undefined && document.documentElement.className.includes('ready')")
            settle(page)
            page.screenshot(path=os.path.join(folder, f"{name}-{size}-{scheme}.png"))
            wide = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
            assert wide <= 0, f"{name}, {size}: {wide} pixels wider than the screen"
            assert page.evaluate("foxhunt.state.dark") == (scheme == "dark")
            for fold in page.locator("details > summary").all():
                fold.click()
            found = examined(page, axe)
            assert not found, f"{name}, {size}, {scheme}: {found}"
            if size == "phone":
                # The fix stands before the map, and no cell is cut off.
                table = page.locator("#fixes").bounding_box()
                assert table is None or table["y"] < page.locator("#map").bounding_box()["y"]
                cut = page.evaluate(
                    "[...document.querySelectorAll('#fixes td, #rows td')].filter((cell) => cell.getBoundingClientRect().right > innerWidth + 0.5).length"
                )
                assert cut == 0, f"{name}: {cut} cells are cut off"
            assert not wrong, f"console: {wrong}"
            context.close()


def check_tools(browser, path):
    context = browser.new_context(viewport={"width": 1400, "height": 900}, offline=True)
    page = context.new_page()
    page.goto("file://" + os.path.abspath(path))
    wait_for(page, "window.foxhunt !== undefined")
    settle(page)
    # Skip links are the first that the keyboard comes to.
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.className") == "skip"

    # Keys move the map; two clicks measure a distance.
    page.locator("#map").focus()
    before = page.evaluate("[foxhunt.view.east, foxhunt.view.north]")
    page.keyboard.press("Shift+ArrowRight")
    page.keyboard.press("Shift+ArrowUp")
    after = page.evaluate("[foxhunt.view.east, foxhunt.view.north]")
    assert after[0] > before[0] and after[1] > before[1], (before, after)
    page.keyboard.press("0")
    settle(page)
    page.keyboard.press("m")
    scale = page.evaluate("foxhunt.view.scale")
    box = page.locator("#map").bounding_box()
    for x, y in ((200, 300), (500, 300)):
        page.mouse.click(box["x"] + x, box["y"] + y)
    said = page.locator("#measured").text_content()
    metres, towards = re.fullmatch(r"([\d.]+) m towards (\d+)°", said).groups()
    assert abs(float(metres) - 300 / scale) <= 0.051 and towards == "090", (said, 300 / scale)
    page.keyboard.press("Escape")
    assert page.locator("#measured").is_hidden()
    page.locator("#layer-rings").check()
    settle(page)

    # Dark, and dark again after the high contrast.
    dark = "[foxhunt.state.dark, foxhunt.state.contrast, document.documentElement.className]"
    for button, expected in (("dark", [True, False, "ready dark"]), ("contrast", [False, True, "ready contrast"]), ("contrast", [True, False, "ready dark"])):
        page.locator(f"#{button}").click()
        assert page.evaluate(dark) == expected, page.evaluate(dark)

    # The picture of the fix by places and rules of others.
    page.locator("#coordinates summary").first.click()
    settle(page)
    uri = page.locator("#coordinates a").first.get_attribute("href")
    assert re.fullmatch(r"geo:-?\d+\.\d{6},-?\d+\.\d{6}(;u=\d+)?", uri), uri
    picture = path + ".png"
    page.locator("#coordinates svg").first.screenshot(path=picture)
    read, *_ = cv2.QRCodeDetector().detectAndDecode(cv2.resize(cv2.imread(picture), None, fx=4, fy=4, interpolation=cv2.INTER_NEAREST))
    assert read == uri, (read, uri)
    for lat, lon in PLACES:
        zone, east, north, text, square = page.evaluate(
            "(at) => { const u = foxhunt.utm(at); return [u.zone, u.east, u.north, foxhunt.utmText(u), foxhunt.mgrsText(u)]; }", [lat, lon]
        )
        there = pyproj.Proj(proj="utm", zone=zone, south=lat < 0, ellps="WGS84")(lon, lat)
        assert abs(there[0] - east) < 1e-3 and abs(there[1] - north) < 1e-3, (lat, lon, there, east, north)
        assert mgrs.MGRS().toMGRS(lat, lon) == square.replace(" ", "").rjust(15, "0"), (lat, lon, square)
        assert text.startswith(f"{zone}"), text
    # All texts that fit are read back.
    for length in (1, 15, 30, 42):
        text = ("geo:50.075906,14.438780;u=9" * 2)[:length]
        rows = page.evaluate("(text) => foxhunt.qr(text)", text)
        image = cv2.copyMakeBorder(255 - 255 * __import__("numpy").array(rows, dtype="uint8"), 4, 4, 4, 4, cv2.BORDER_CONSTANT, value=255)
        read, *_ = cv2.QRCodeDetector().detectAndDecode(cv2.resize(image, None, fx=8, fy=8, interpolation=cv2.INTER_NEAREST))
        assert read == text, (read, text)
    context.close()


def check_not_offered(browser, foxhunt, folder):
    """Recordings with more than 10,000 receptions do not follow what is struck out: the page does not offer it."""
    table, written = os.path.join(folder, "many.csv"), os.path.join(folder, "many.html")
    with open(table, "w", encoding="utf-8") as file:
        file.write("time_s,east_m,north_m,rss_dbm\n")
        for row in range(12_000):
            east, north = row % 600, 20.0 * (row // 600)
            file.write(f"{row},{east},{north},{-30 - 25 * math.log10(math.hypot(east - 300, north - 200) + 1):.1f}\n")
    subprocess.run([foxhunt, "locate", table, "--report", written], check=True, capture_output=True)
    page = browser.new_context(offline=True).new_page()
    page.goto("file://" + os.path.abspath(written))
    wait_for(page, "document.querySelectorAll('#turn-body dl').length > 0")
    assert page.locator("#strike").is_hidden() and page.locator("#strike-key").is_hidden()
    page.evaluate("foxhunt.select(4)")
    page.locator("#map").focus()
    page.keyboard.press("x")
    settle(page)
    assert page.locator("#strike-one").count() == 0
    assert page.evaluate("foxhunt.received.every((one) => !one.struck)")
    page.context.close()


def check_without_script(browser, path, folder):
    context = browser.new_context(viewport={"width": 390, "height": 844}, java_script_enabled=False, offline=True)
    page = context.new_page()
    page.goto("file://" + os.path.abspath(path))
    page.screenshot(path=os.path.join(folder, "without-script.png"))
    assert page.locator("#still td").count() >= 3 and page.locator("#still svg ellipse").count() >= 1
    assert page.locator("main").is_hidden()
    context.close()


def main():
    chromium, foxhunt, axe, folder = sys.argv[1:]
    os.makedirs(folder, exist_ok=True)
    with open(axe, encoding="utf-8") as file:
        axe = file.read()
    tiles = os.path.join(folder, "tiles")
    report_tiles.as_folder(report_tiles.drawn(), tiles)
    origin = ",".join(map(str, report_tiles.ORIGIN))
    run = lambda *arguments: subprocess.run([foxhunt, *arguments], check=True, capture_output=True)
    in_folder = lambda name: os.path.join(folder, name)
    run("hunt", "--out", in_folder("hunt"), "--tiles", tiles, "--origin", origin)
    os.rename(in_folder("hunt/report.html"), in_folder("hunt.html"))
    run("fly", "--emulate", "pritzl-6.1", "--out", in_folder("fly"))
    os.rename(in_folder("fly/fly-1-report.html"), in_folder("fly.html"))
    run("locate", "docs/walk.csv", "--report", in_folder("walk.html"))
    with open(in_folder("silent.csv"), "w", encoding="utf-8") as file:
        file.write("time_s,lat_deg,lon_deg,rss_dbm,floor_dbm\n")
        file.writelines(f"{step},50.08,{14.44 + step / 5000},-110,-105\n" for step in range(40))
    run("locate", in_folder("silent.csv"), "--report", in_folder("silent.html"))
    run("bearing", "archive/tests/data/uavrt-rotation.csv", "--report", in_folder("bearing.html"))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for name in ("hunt", "fly", "walk", "silent", "bearing"):
            look(browser, axe, in_folder(f"{name}.html"), folder)
        check_tools(browser, in_folder("walk.html"))
        check_without_script(browser, in_folder("walk.html"), folder)
        check_not_offered(browser, foxhunt, folder)
        check_embedded(browser, in_folder("hunt.html"))
        with Program(foxhunt, "hunt", "--live=127.0.0.1:0", "--pace", "1000", "--out", in_folder("live")) as program:
            wrong = []
            for size in SIZES.values():
                page = new_page(browser, wrong, size)
                open_page(page, program.address())
                page.locator("#live-status", has_text="the hunt is over").wait_for(timeout=120_000)
                found = examined(page, axe)
                assert not found, f"live: {found}"
            assert not wrong, f"console: {wrong}"
        browser.close()
    print("pages: five kinds and the live view at two sizes, light and dark, without a finding of axe; UTM, MGRS and QR as others have them")


def check_embedded(browser, path):
    """The map that the page brings along lies where pymap3d has it."""
    context = browser.new_context(viewport={"width": 1400, "height": 900}, offline=True)
    page = context.new_page()
    page.goto("file://" + os.path.abspath(path))
    wait_for(page, "window.foxhunt?.tiles !== undefined")
    assert page.locator("#attribution").text_content().endswith("the mapper")
    for box in page.locator("#layers input").all():
        if box.get_attribute("id") != "layer-tiles":
            box.uncheck()
    for mark in report_tiles.MARKS[:4]:
        report_tiles.look(page, (mark[0] + 1.5, mark[1] - 1.5), 2.0)
        disc = page.evaluate(report_tiles.GREY, [mark, 70])
        assert disc[0] < 90 and disc[1] > 180 and disc[2] > 180, (mark, disc)
    context.close()


main()
