// Drops a recording on the page of `foxhunt page` in Firefox, over WebDriver BiDi, and opens a report page there:
// node page_firefox.mjs FIREFOX NODE_MODULES FOXHUNT FOLDER, which holds foxhunt.html.
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [firefox, modules, foxhunt, folder] = process.argv.slice(2);
const puppeteer = createRequire(resolve(modules, "x.js"))("puppeteer-core");
const recording = "docs/walk.csv";
const fail = (text) => { throw new Error(text); };
const run = (...args) => execFileSync(resolve(foxhunt), args, { encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] });

// A place without a network, and without a question.
const place = { location: { lat: 50.0755, lng: 14.4378 }, accuracy: 6 };
const extraPrefsFirefox = { "geo.prompt.testing": true, "geo.prompt.testing.allow": true, "geo.provider.testing": true, "geo.provider.use_geoclue": false, "geo.provider.network.url": `data:application/json,${JSON.stringify(place)}` };
const browser = await puppeteer.launch({ browser: "firefox", executablePath: firefox, headless: true, extraPrefsFirefox });
try {
  const open = async (name) => {
    const page = await browser.newPage(), wrong = [];
    page.on("console", (message) => wrong.push(message.text()));
    page.on("pageerror", (error) => wrong.push(String(error)));
    await page.goto(pathToFileURL(resolve(folder, name)).href);
    return [page, wrong];
  };
  const until = async (page, expression) => {
    for (let tries = 0; tries < 1200; tries += 1) {
      if (await page.evaluate(expression)) return;
      await new Promise((done) => { setTimeout(done, 100); });
    }
    fail(`${expression} in two minutes`);
  };
  const [page, wrong] = await open("foxhunt.html");
  await until(page, "foxhunt.ready");
  await page.evaluate((text) => {
    const files = new DataTransfer();
    files.items.add(new File([Uint8Array.from(text, (letter) => letter.charCodeAt(0))], "walk.csv"));
    document.body.dispatchEvent(new DragEvent("drop", { dataTransfer: files, bubbles: true, cancelable: true }));
  }, readFileSync(recording, "latin1"));
  await until(page, "foxhunt.done > 0");
  const [here] = await page.evaluate("foxhunt.runs.map(({ text, errors, firstMs, report }) => ({ text, errors, firstMs, report: report?.length }))");
  if (here.errors.length || !here.report) fail(`${here.errors}`);
  const lines = execFileSync(resolve(foxhunt), ["locate", "walk.csv", "--every-beacon", "--json=lines"], { cwd: "docs", encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] });
  const there = lines.split("\n").find((line) => line.startsWith('{"kind":"result"')).slice('{"kind":"result","value":'.length, -1);
  const places = [here.text, there].map((text) => JSON.parse(text)[0].estimate);
  if (JSON.stringify(places[0]) !== JSON.stringify(places[1])) fail(`${JSON.stringify(places)}`);

  // In the field: a bearing by the compass at the place of the browser, one that is typed at a typed place, and their list as
  // the program locates it.
  await page.evaluate(() => {
    const put = (id, value) => { document.getElementById(id).value = value; document.getElementById(id).dispatchEvent(new Event("change")); };
    window.bearing = (lat, lon, typed) => {
      if (lat) put("hand-lat", lat);
      if (lon) put("hand-lon", lon);
      put("bearing", typed);
      document.getElementById("bearing-here").click();
    };
    document.getElementById("tab-field").click();
    document.getElementById("watch").click();
  });
  // It listens when the press has been dealt with.
  await until(page, `(() => {
    dispatchEvent(new DeviceOrientationEvent("deviceorientationabsolute", { alpha: 315, beta: 0, gamma: 0, absolute: true }));
    return !document.getElementById("hold").disabled;
  })()`);
  await until(page, "foxhunt.field.place !== null");
  await page.evaluate("bearing(null, null, '')");
  await until(page, "foxhunt.field.located === 1");
  await page.evaluate("bearing(50.0755, 14.4398, 315)");
  await until(page, "foxhunt.field.located === 2");
  const list = await page.evaluate("({ table: foxhunt.field.table(), text: foxhunt.runs[0].text, entries: foxhunt.field.entries, kept: document.getElementById('kept').textContent })");
  if (JSON.stringify(list.entries.map(({ magnetic }) => magnetic)) !== "[45,315]") fail(JSON.stringify(list.entries));
  if (JSON.stringify(list.entries.map(({ lat, lon, sigma }) => [lat, lon, sigma])) !== "[[50.0755,14.4378,4],[50.0755,14.4398,null]]") fail(JSON.stringify(list.entries));
  if (!list.kept.includes("keeps the list")) fail(list.kept);
  writeFileSync(resolve(folder, "field.csv"), list.table);
  const fix = execFileSync(resolve(foxhunt), ["locate", "field.csv", "--every-beacon", "--json=lines"], { cwd: folder, encoding: "utf8", stdio: ["ignore", "pipe", "ignore"] });
  if (!fix.includes(list.text)) fail(`${list.text} instead of ${fix}`);

  run("locate", recording, "--report", resolve(folder, "walk.html"));
  const [report, errors] = await open("walk.html");
  // The first frame that is drawn fills the table.
  await until(report, "window.foxhunt !== undefined && document.querySelector('#fixes tbody') !== null");
  const row = await report.evaluate("document.querySelector('#fixes tbody').textContent");
  const place = `${places[1].lat_deg.toFixed(6)}, ${places[1].lon_deg.toFixed(6)}`;
  if (!row.includes(place)) fail(`${row} without ${place}`);
  // The estimate follows what is struck out, in a worker of the page.
  await report.evaluate("foxhunt.select(60)");
  await until(report, "document.getElementById('strike-one') !== null");
  await report.evaluate("document.getElementById('strike-one').click()");
  await until(report, "document.getElementById('strike-status').textContent.includes('struck out: ')");
  if (wrong.length || errors.length) fail(`console: ${[...wrong, ...errors]}`);
  console.log(`${await browser.version()}: the fixes of a recording and of a list in the field are the program's to the bit, the first ${(here.firstMs / 1000).toFixed(2)} s after the drop; its report page follows what is struck out`);
} finally {
  await browser.close();
}
