"""Strikes receptions out in report pages, and holds the fixes against `foxhunt replay --ignore` and
`foxhunt locate --ignore`.

usage: report_strike.py CHROMIUM FOXHUNT REPLAYER FOLDER...

REPLAYER is the replayer as it is now, compressed and as text: it takes the place of the committed one, whose
numbers may be older (.ci/replayer holds those). Each folder holds hunt.jsonl and report.html of a hunt.
"""

import json
import math
import os
import subprocess
import sys

from playwright.sync_api import sync_playwright

from report import settle

# Metres and square metres. The functions of the C library and of WebAssembly round differently in
# the last bit; a cloud carries that through a resampling.
TOLERANCE = 1e-9


def numbers(estimate):
    (a, b), (c, d) = estimate["covariance_m2"]
    return [estimate["east_m"], estimate["north_m"], a, b, c, d]


def replayed(foxhunt, log, struck, *more):
    """The fixes of the program without what is struck."""
    run = [foxhunt, "--json", "replay", log, "--ignore", struck, *more]
    return json.loads(subprocess.run(run, check=True, capture_output=True, text=True).stdout)


def opened(page, path, replayer):
    """Opens a report with the replayer of now."""
    with open("show/src/page/replayer.wasm.gz.base64", encoding="ascii") as file:
        committed = file.read().strip()
    with open(path, encoding="utf-8") as file:
        report = file.read()
    assert report.count(committed) == 1, f"{path}: where is its replayer?"
    with open(path, "w", encoding="utf-8") as file:
        file.write(report.replace(committed, replayer))
    page.goto("file://" + os.path.abspath(path))
    page.wait_for_function("window.foxhunt !== undefined")


def check(browser, foxhunt, replayer, folder):
    log, struck = os.path.join(folder, "hunt.jsonl"), os.path.join(folder, "struck.jsonl")
    context = browser.new_context(viewport={"width": 1280, "height": 800}, accept_downloads=True, offline=True)
    page = context.new_page()
    wrong = []
    page.on("console", lambda message: wrong.append(message.text))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    opened(page, os.path.join(folder, "report.html"), replayer)
    status = page.locator("#strike-status")

    def wait_for(text):
        status.filter(has_text=text).wait_for(timeout=120_000)
        settle(page)

    before = page.locator("#fixes").text_content()

    # By the key, by the button, and taken back again.
    page.evaluate("foxhunt.select(4)")
    page.locator("#map").focus()
    page.keyboard.press("x")
    wait_for("1 reception struck out: ")
    assert page.locator("#fixes").text_content() != before, "the fix follows"
    page.keyboard.press("ArrowRight")
    settle(page)
    page.locator("#strike-one", has_text="Strike it out").click()
    wait_for("2 receptions struck out: ")
    page.locator("#strike-one", has_text="Take it back").click()
    wait_for("1 reception struck out: ")
    page.keyboard.press("End")
    for index in (0, 9, 17, 30):
        page.evaluate(f"foxhunt.select({index})")
        settle(page)
        page.locator("#strike-one").click()
    wait_for("5 receptions struck out: ")

    # The page does not wait for the estimator: it can be used while that runs.
    page.locator("#time").fill("500")
    page.keyboard.press("End")

    # The saved list gives the program the same fixes.
    with page.expect_download() as download:
        page.locator("#strike-save").click()
    download.value.save_as(struck)
    fixes = page.evaluate("foxhunt.fixes")
    report = replayed(foxhunt, log, struck)
    assert report["ignored"] == 5, report["ignored"]
    assert len(fixes) == len(report["beacons"]) > 0
    worst = 0.0
    for here, there in zip(fixes, report["beacons"]):
        assert (here["name"], here["steps"]) == (there["name"], there["steps"])
        pairs = zip(numbers(here["estimate"]), numbers(there["estimate"]))
        worst = max(worst, max(abs(a - b) for a, b in pairs))
    assert worst <= TOLERANCE, f"{folder}: the page's fix is {worst} off"
    after = page.locator("#fixes").text_content()

    # All taken back is what the page came with; the list brings the other back.
    page.locator("#strike-none").click()
    page.locator("#strike-list:not(:has(li))").wait_for(state="attached")
    settle(page)
    assert page.locator("#fixes").text_content() == before
    page.locator("#strike-open").set_input_files(struck)
    wait_for("5 receptions struck out: ")
    assert page.locator("#fixes").text_content() == after

    # A list of another hunt changes nothing.
    other = os.path.join(folder, "other.jsonl")
    with open(other, "w", encoding="utf-8") as file:
        file.write('{"foxhunt_struck":1}\n{"drone":0,"beacon":0,"time":0.125}\n')
    page.locator("#strike-open").set_input_files(other)
    wait_for("line 2: no reception of this hunt")
    assert page.locator("#fixes").text_content() == after
    refused = subprocess.run([foxhunt, "replay", log, "--ignore", other], capture_output=True, text=True)
    assert refused.returncode == 2 and "other.jsonl, line 2" in refused.stderr, refused

    # A page that was written without them shows them struck, and has the same table.
    written = os.path.join(folder, "without.html")
    replayed(foxhunt, log, struck, "--report", written)
    opened(page, written, replayer)
    assert page.evaluate("foxhunt.received.filter((one) => one.struck).length") == 5
    assert page.locator("#fixes").text_content() == after
    page.locator("#strike-none").click()
    wait_for("0 receptions struck out: ")
    assert page.locator("#fixes").text_content() == before

    assert not wrong, f"console: {wrong}"
    context.close()
    return worst


def bearings(path, beacons):
    """A table of bearings to beacons, with σ, one of which a reflection has turned."""
    places = [(0, 0), (60, 0), (0, 60), (60, 60), (30, -20), (-20, 30), (80, 30), (30, 80)]
    with open(path, "w", encoding="utf-8") as file:
        file.write("drone,beacon,time_s,east_m,north_m,bearing_deg_compass,bearing_sigma_deg\n")
        for number, (east, north) in enumerate(places):
            for name, x, y in beacons:
                off = 70 if number == 3 else (number * 7 % 5) - 2
                compass = (math.degrees(math.atan2(x - east, y - north)) + off) % 360
                file.write(f"d{number % 2},{name},{number},{east},{north},{compass:.3f},4\n")


def passing(path):
    """Levels and bearings of three stations, of a transmitter that goes East at 1 m/s."""
    with open(path, "w", encoding="utf-8") as file:
        file.write("drone,time_s,east_m,north_m,bearing_deg_compass,bearing_sigma_deg,rss_dbm\n")
        for time in range(0, 600, 30):
            for number, (east, north) in enumerate([(0, 0), (800, 0), (400, 700)]):
                x, y = 100 + time - east, 300 - north
                off = 60 if (number, time) == (1, 300) else (time // 30 + number) % 5 - 2
                compass = (math.degrees(math.atan2(x, y)) + off) % 360
                level = -30 - 25 * math.log10(math.hypot(x, y))
                file.write(f"d{number},{time},{east},{north},{compass:.3f},4,{level:.2f}\n")


def located(foxhunt, *arguments):
    run = subprocess.run([foxhunt, "--json", "locate", *arguments], check=True, capture_output=True, text=True)
    found = json.loads(run.stdout)
    if "places" in found:
        # A track, whose last place the page has as its fix.
        return [{**found["places"][-1], "ignored": found["ignored"]}]
    return found if isinstance(found, list) else [found]


def check_recording(browser, foxhunt, replayer, folder, arguments, strikes):
    """The page of `locate`: what is struck out in it, and what the program makes of its list."""
    written, struck = os.path.join(folder, "located.html"), os.path.join(folder, "rows.jsonl")
    located(foxhunt, *arguments, "--report", written)
    context = browser.new_context(viewport={"width": 1280, "height": 800}, accept_downloads=True, offline=True)
    page = context.new_page()
    wrong = []
    page.on("console", lambda message: wrong.append(message.text))
    page.on("pageerror", lambda error: wrong.append(str(error)))

    opened(page, written, replayer)
    before = page.locator("#fixes").text_content()
    for index in strikes:
        page.evaluate(f"foxhunt.select({index})")
        settle(page)
        page.locator("#strike-one", has_text="Strike it out").click()
    count = f"{len(strikes)} reception{'s' if len(strikes) > 1 else ''} struck out: "
    page.locator("#strike-status", has_text=count).wait_for(timeout=120_000)
    settle(page)
    after = page.locator("#fixes").text_content()
    assert after != before, "the fix follows"
    with page.expect_download() as download:
        page.locator("#strike-save").click()
    download.value.save_as(struck)

    # The saved list gives the program the same fixes.
    reports = located(foxhunt, *arguments, "--ignore", struck, "--report", os.path.join(folder, "without.html"))
    assert sum(report["ignored"] for report in reports) == len(strikes)
    fixes = page.evaluate("foxhunt.fixes")
    assert len(fixes) == len(reports)
    worst = 0.0
    for here, there in zip(fixes, reports):
        assert here["steps"] == there["observations"], (here, there)
        pairs = zip(numbers(here["estimate"]), numbers(there["estimate"]))
        worst = max(worst, max(abs(a - b) for a, b in pairs))
    assert worst <= TOLERANCE, f"{arguments}: the page's fix is {worst} off"

    # All taken back is what the page came with. A page written without them has the other table.
    page.locator("#strike-none").click()
    page.locator("#strike-list:not(:has(li))").wait_for(state="attached")
    settle(page)
    assert page.locator("#fixes").text_content() == before
    opened(page, os.path.join(folder, "without.html"), replayer)
    assert page.evaluate("foxhunt.received.filter((one) => one.struck).length") == len(strikes)
    assert page.locator("#fixes").text_content() == after
    page.locator("#strike-none").click()
    page.locator("#strike-status", has_text="0 receptions struck out: ").wait_for(timeout=120_000)
    settle(page)
    assert page.locator("#fixes").text_content() == before

    # What is no reception of the recordings is named.
    other = os.path.join(folder, "other.jsonl")
    with open(other, "w", encoding="utf-8") as file:
        file.write('{"foxhunt_struck":1}\n{"file":"other.csv","line":2}\n')
    page.locator("#strike-open").set_input_files(other)
    page.locator("#strike-status", has_text="line 2: no reception of this hunt").wait_for(timeout=10_000)
    refused = subprocess.run([foxhunt, "locate", *arguments, "--ignore", other], capture_output=True, text=True)
    assert refused.returncode == 2 and "other.jsonl, line 2" in refused.stderr, refused
    assert not wrong, f"console: {wrong}"
    context.close()
    return worst


def main():
    chromium, foxhunt, replayer, *folders = sys.argv[1:]
    with open(replayer, encoding="ascii") as file:
        replayer = file.read().strip()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for folder in folders:
            worst = check(browser, foxhunt, replayer, folder)
            print(f"{os.path.basename(folder)}: the page's fix is at most {worst:.1e} m or m² off")
        folder = folders[0]
        one, several = os.path.join(folder, "one.csv"), os.path.join(folder, "several.csv")
        bearings(one, [("fox", 40, 30)])
        bearings(several, [("fox", 40, 30), ("owl", 10, 45)])
        track = os.path.join(folder, "track.csv")
        passing(track)
        for arguments, strikes in (
            ([one], [2]),
            ([one, "--estimator", "particle"], [3, 0]),
            ([several, "--every-beacon"], [2]),
            (["docs/walk.csv"], [0, 17, 60]),
            (["docs/walk.csv", "--receiver-antenna", "dipole"], [0, 17, 60]),
            ([track, "--track"], [31, 58]),
        ):
            worst = check_recording(browser, foxhunt, replayer, folder, arguments, strikes)
            print(f"locate {' '.join(arguments)}: the page's fix is at most {worst:.1e} m or m² off")
        browser.close()


main()
