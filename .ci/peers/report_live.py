"""Looks at hunts while they go on: late, cut off, without a token.

usage: report_live.py CHROMIUM FOXHUNT FOLDER
"""

import json
import os
import re
import socket
import subprocess
import sys
import threading
import urllib.error
import urllib.request

from playwright.sync_api import sync_playwright

from report import settle, wait_for

TOKEN = "correct-horse-battery"


class Program:
    """A hunt with a live view, on a port that the system chose."""

    def __init__(self, foxhunt, *arguments, token=None):
        environment = dict(os.environ)
        if token:
            environment["FOXHUNT_LIVE_TOKEN"] = token
        self.process = subprocess.Popen(
            [foxhunt, *arguments], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE, text=True, env=environment,
        )
        for line in self.process.stderr:
            found = re.search(r"live view: http://[^:]*:(\d+)/", line)
            if found:
                self.port = int(found[1])
                break
        else:
            raise AssertionError("no address of the live view")
        self.lines = []
        threading.Thread(target=lambda: self.lines.extend(self.process.stderr), daemon=True).start()

    def address(self, path="/"):
        return f"http://127.0.0.1:{self.port}{path}"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(10)


class Cable:
    """A connection to a port that can be pulled out, and put in again."""

    def __init__(self, port):
        self.port, self.ends, self.whole = port, [], True
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.outside = self.listener.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            near, _ = self.listener.accept()
            if not self.whole:
                near.close()
                continue
            far = socket.create_connection(("127.0.0.1", self.port))
            self.ends += [near, far]
            for a, b in ((near, far), (far, near)):
                threading.Thread(target=self.pump, args=(a, b), daemon=True).start()

    @staticmethod
    def pump(a, b):
        try:
            while data := a.recv(65536):
                b.sendall(data)
        except OSError:
            pass
        for end in (a, b):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def pull(self):
        self.whole = False
        for end in self.ends:
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass


def status_of(address, method="GET", **headers):
    request = urllib.request.Request(address, method=method, headers=headers)
    opener = urllib.request.build_opener(urllib.request.HTTPRedirectHandler)
    try:
        with opener.open(request, timeout=10) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


def new_page(browser, wrong, size=(1280, 800)):
    page = browser.new_context(viewport={"width": size[0], "height": size[1]}).new_page()
    # A connection that was pulled out is in the console by the browser itself.
    page.on("console", lambda message: wrong.append(message.text) if "ERR_" not in message.text else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    return page


def open_page(page, address):
    page.goto(address)
    page.wait_for_function("window.foxhunt !== undefined")


def in_log(folder):
    with open(os.path.join(folder, "hunt.jsonl"), encoding="utf-8") as file:
        events = [json.loads(line) for line in file][1:]
    return [event["time"] for event in events if event["event"] == "received"]


def hunt(browser, folder, program):
    """A hunt on loopback: late joiners, a cable that is pulled out, the end."""
    wrong = []
    cable = Cable(program.port)
    early, cut = new_page(browser, wrong), new_page(browser, wrong, (390, 844))
    open_page(early, program.address())
    open_page(cut, f"http://127.0.0.1:{cable.outside}/")
    wait_for(early, "foxhunt.received.length >= 6")
    wait_for(cut, "foxhunt.received.length >= 6")
    assert "live" in early.locator("#live-status").text_content()
    assert early.evaluate("foxhunt.state.time === foxhunt.data.span[1]"), "it follows"
    assert early.evaluate("foxhunt.received.every((one) => one.turn)"), "turns come along"

    cable.pull()
    cut.locator("#live-status", has_text="no connection").wait_for(timeout=20_000)
    had = cut.evaluate("foxhunt.received.length")
    wait_for(early, f"foxhunt.received.length >= {had + 6}")
    assert cut.evaluate("foxhunt.received.length") == had, "nothing comes through a cut cable"
    cable.whole = True

    # Who joins late has all of it.
    late = new_page(browser, wrong)
    open_page(late, program.address())
    wait_for(late, f"foxhunt.received.length >= {had + 6}")
    wait_for(cut, f"foxhunt.received.length >= {had + 6}")

    # What is struck out while the hunt goes on stays out.
    late.evaluate("foxhunt.select(1)")
    settle(late)
    late.locator("#strike-one").click()
    late.locator("#strike-status", has_text="1 reception struck out: ").wait_for(timeout=60_000)

    for page in (early, late, cut):
        page.locator("#live-status", has_text="the hunt is over").wait_for(timeout=120_000)
    # A browser that comes when all is over has it, too.
    after = new_page(browser, wrong)
    open_page(after, program.address())
    after.locator("#live-status", has_text="the hunt is over").wait_for(timeout=20_000)
    times = [round(time, 2) for time in in_log(folder)]
    for page in (early, late, cut, after):
        wait_for(page, f"foxhunt.received.length === {len(times)}")
        shown = page.evaluate("foxhunt.received.map((one) => one.time)")
        assert sorted(shown) == sorted(times), "every reception once"

    # The table is that of the report, but where something is struck out.
    report = new_page(browser, wrong)
    open_page(report, "file://" + os.path.abspath(os.path.join(folder, "report.html")))
    table = report.locator("#fixes").text_content()
    for page in (early, cut, after):
        page.locator("#map").focus()
        page.keyboard.press("End")
        settle(page)
        assert page.locator("#fixes").text_content() == table
    late.locator("#strike-status", has_text="1 reception struck out: ").wait_for(timeout=60_000)
    assert late.evaluate("foxhunt.fixes[0].steps + foxhunt.fixes[1].steps") < len(times) + 1

    # Read-only, and under no other name of this computer.
    assert status_of(program.address("/break-off"), "POST") == 403
    assert status_of(program.address(), Host="evil.example") == 403
    assert status_of(program.address("/hunt.jsonl")) == 404
    assert not wrong, f"console: {wrong}"


def fly(browser, program):
    """A flight with a token, on every address: who has it looks and breaks off."""
    wrong = []
    for path, method in (("/", "GET"), ("/events", "GET"), ("/break-off", "POST"), ("/?token=wrong-horse", "GET")):
        assert status_of(program.address(path), method) == 401, path
    assert status_of(program.address(), Authorization=f"Bearer {TOKEN}") == 200
    # The browser writes a line of its own about 401, at a time of its choice: a page apart.
    refused = new_page(browser, [])
    refused.goto(program.address("/?token=wrong-horse"))
    assert "TOKEN" in refused.content()
    refused.close()
    page = new_page(browser, wrong)
    open_page(page, program.address(f"/?token={TOKEN}"))
    assert TOKEN not in page.url, "the token does not stay in the address"
    wait_for(page, "foxhunt.received.length >= 3")
    page.on("dialog", lambda dialog: dialog.accept())
    page.locator("#break-off").click()
    page.locator("#live-status", has_text="the hunt is over").wait_for(timeout=120_000)
    assert "broken off in the live view" in page.locator("#event-list").text_content()
    program.process.wait(30)
    assert any("nothing is encrypted" in line for line in program.lines), program.lines
    assert not wrong, f"console: {wrong}"


def main():
    chromium, foxhunt, folder = sys.argv[1:]
    os.makedirs(folder, exist_ok=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        with Program(foxhunt, "hunt", "--live=127.0.0.1:0", "--pace", "12", "--out", folder) as program:
            hunt(browser, folder, program)
        print("live: joined late, cut off and back, struck out, read-only")
        flight = ["fly", "--emulate", "pritzl-6.1", "--live=0.0.0.0:0", "--live-until-done", "--pace", "15"]
        with Program(foxhunt, *flight, "--out", folder, token=TOKEN) as program:
            fly(browser, program)
        print("live: token refused and accepted, broken off")
        browser.close()


if __name__ == "__main__":
    main()
