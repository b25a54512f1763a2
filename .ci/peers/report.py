"""Opens report pages in Chromium and uses them as a person does.

usage: report.py CHROMIUM PAGE...
"""

import json
import os
import re
import sys

from playwright.sync_api import sync_playwright

SIZES = {"desk": (1280, 800), "phone": (390, 844)}


def frames_per_second(page):
    """Plays for two seconds and counts the frames."""
    return page.evaluate(
        """() => new Promise((done) => {
            document.getElementById("play").click();
            let frames = 0;
            const begun = performance.now();
            const count = (now) => {
                frames += 1;
                if (now - begun < 2000) requestAnimationFrame(count);
                else { document.getElementById("play").click(); done(frames / 2); }
            };
            requestAnimationFrame(count);
        })"""
    )


def examined(page, axe):
    """The rules of axe that a page breaks. The page's policy forbids scripts of others, but not those of its own tools."""
    session = page.context.new_cdp_session(page)
    session.send("Runtime.evaluate", {"expression": axe})
    run = "axe.run(document, { resultTypes: ['violations'] }).then((all) => JSON.stringify(all.violations.map((one) => [one.id, one.nodes[0].html])))"
    answer = session.send("Runtime.evaluate", {"expression": run, "awaitPromise": True, "returnByValue": True})
    return json.loads(answer["result"]["value"])


def settle(page):
    """Waits until what was asked of the page is drawn, however busy the machine is."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def wait_for(page, expression, seconds=60):
    """Waits without `eval`, which the page forbids."""
    for _ in range(seconds * 5):
        if page.evaluate(expression):
            return
        page.wait_for_timeout(200)
    raise AssertionError(f"{expression} in {seconds} s")


def check(browser, path, name, size):
    context = browser.new_context(
        viewport={"width": size[0], "height": size[1]}, has_touch=name == "phone", offline=True
    )
    page = context.new_page()
    wrong = []
    page.on("console", lambda message: wrong.append(message.text))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    requests = []
    page.on("request", lambda request: requests.append(request.url))
    page.goto("file://" + os.path.abspath(path))
    page.wait_for_function("window.foxhunt !== undefined")
    data = json.loads(page.locator("#data").text_content())

    def time():
        return page.evaluate("foxhunt.state.time")

    begin, end = data["span"]
    assert abs(time() - end) < 0.1, "it opens at the end"
    # Nothing is wider than the screen, but what scrolls by itself.
    wide = page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
    assert wide <= 0, f"the page is {wide} pixels wider than the screen"

    # The table has the last estimates.
    for search in data["searches"]:
        row = page.locator("#fixes tr", has_text=search["name"]).text_content()
        east, north = search["beliefs"][-1]["place"]
        words = f"{abs(east):.1f} m {'W' if east < 0 else 'E'}, {abs(north):.1f} m {'S' if north < 0 else 'N'}"
        assert words in row, (words, row)

    # The slider moves time, the map and the table.
    picture = page.locator("#map").screenshot()
    page.locator("#time").fill("250")
    settle(page)
    assert abs(time() - (begin + 0.25 * (end - begin))) < 0.01 * (end - begin)
    assert page.locator("#map").screenshot() != picture, "the map follows the slider"

    # Keys: next reception, the one before, begin, end, play.
    page.locator("#map").focus()
    page.keyboard.press("Home")
    settle(page)
    assert abs(time() - begin) < 0.01
    page.keyboard.press("ArrowRight")
    settle(page)
    assert abs(time() - data["received"][0]["time"]) < 0.01
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowLeft")
    settle(page)
    assert "chosen" in page.locator("#turn-head").text_content()
    page.keyboard.press("Space")
    wait_for(page, "foxhunt.state.time > foxhunt.received[0].time")
    page.keyboard.press("Space")
    playing = time()
    settle(page)
    page.wait_for_timeout(200)
    assert time() == playing, "space pauses"
    page.keyboard.press("End")
    settle(page)

    # A click on a bearing shows its turn.
    page.evaluate("foxhunt.setTime(foxhunt.received.find((one) => one.bearing).time)")
    settle(page)
    one = page.evaluate("foxhunt.received.find((one) => one.bearing)")
    x, y = page.evaluate(
        """(one) => {
            const away = 30 / foxhunt.view.scale;
            return foxhunt.at([one.place[0] + away * Math.cos(one.bearing[0]), one.place[1] + away * Math.sin(one.bearing[0])]);
        }""",
        one,
    )
    page.locator("#map").scroll_into_view_if_needed()
    if name == "phone":
        box = page.locator("#map").bounding_box()
        page.touchscreen.tap(box["x"] + x, box["y"] + y)
    else:
        page.locator("#map").click(position={"x": x, "y": y})
    settle(page)
    assert "chosen" in page.locator("#turn-head").text_content(), "the bearing was clicked"
    polar = page.locator("#turn-body svg")
    assert polar.locator(".bearing").count() == 1
    if "turn" in one:
        assert len(polar.locator(".samples").get_attribute("d")) > 100
        assert len(polar.locator(".smoothed").get_attribute("d")) > 100

    # An event takes to its time; a plot, too.
    page.locator("#event-list button").last.click()
    settle(page)
    assert abs(time() - max(notice[0] for notice in data["notices"] if notice[2])) < 0.01
    plot = page.locator(".chart .u-over").first
    plot.click(position={"x": 40, "y": 40})
    settle(page)
    assert begin <= time() < end

    # A layer goes and comes back.
    page.locator("#map").scroll_into_view_if_needed()
    with_paths = page.locator("#map").screenshot()
    page.locator("#layer-paths").uncheck()
    settle(page)
    assert page.locator("#map").screenshot() != with_paths, "paths are switched off"
    page.locator("#layer-paths").check()

    rate = frames_per_second(page)
    outside = [url for url in requests if not re.match(r"(file|data):", url)]
    assert not outside, f"requests: {outside}"
    assert not wrong, f"console: {wrong}"
    context.close()
    return rate


def main():
    chromium, *paths = sys.argv[1:]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        for path in paths:
            size_mb = os.path.getsize(path) / 1e6
            assert size_mb < 5.0, f"{path}: {size_mb:.1f} MB"
            for name, size in SIZES.items():
                rate = check(browser, path, name, size)
                print(f"{path}: {size_mb:.2f} MB, {name}: {rate:.0f} frames a second")
        browser.close()


if __name__ == "__main__":
    main()
