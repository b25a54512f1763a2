// ---------------------------------------------------------------- the list of entries

const LIST = "field.csv", KEPT = "foxhunt-field";
// A phone's accuracy is the radius that holds its place with 68 % (Android) or with 95 % (the standard). The first gives the
// wider σ on each axis, so it is taken.
const RADII = Math.sqrt(-2 * Math.log(1 - 0.68));
// A place that is older than this is said to be old.
const OLD_S = 15;

// The list, what the sensors have last told, the entry that was last deleted with its index, and the fix as a row of the results.
// `heading` is magnetic, `declination` and it are in degrees, and `keeps` is false if the browser refuses to keep the list.
const field = { entries: [], place: null, heading: null, declination: null, deleted: null, fix: null, keeps: true, watched: null, located: 0, isSteep: false };
window.foxhunt.field = field;
// Conversions of bearings wait for no other computation.
let converter = null;

function restoreEntries() {
  try {
    const kept = JSON.parse(localStorage.getItem(KEPT) ?? "null");
    if (!Array.isArray(kept?.entries)) return;
    field.entries = kept.entries;
    byId("level-unit").value = kept.unit;
  } catch {
    field.keeps = false;
  }
}

function keepEntries() {
  try {
    localStorage.setItem(KEPT, JSON.stringify({ entries: field.entries, unit: byId("level-unit").value }));
    field.keeps = true;
  } catch {
    field.keeps = false;
  }
}

const COLUMNS_OF_LIST = ["time_utc", "lat_deg", "lon_deg", "receiver_sigma_m", "level", "bearing_deg_compass", "bearing_sigma_deg"];

function lineOf({ time, lat, lon, sigma, level, bearing, bearingSigma }) {
  return [time, lat, lon, sigma, level, bearing, bearingSigma].map((value) => value ?? "").join(",");
}

// The list as `foxhunt locate` reads it. Entries that are struck out are comments.
function listTable() {
  const header = COLUMNS_OF_LIST.map((name) => (name === "level" ? byId("level-unit").value : name)).join(",");
  return `${[header, ...field.entries.map((entry) => (entry.struck ? `# struck out: ${lineOf(entry)}` : lineOf(entry)))].join("\n")}\n`;
}

const clock = (time) => new Date(time).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", second: "2-digit" });

function showEntries() {
  byId("entries").replaceChildren(...field.entries.map((entry, index) => {
    const what = entry.level !== null ? `${entry.level} ${byId("level-unit").selectedOptions[0].text}` : `${fixed(entry.bearing, 1)}° from true North${entry.magnetic === null ? "" : ` (compass ${fixed(entry.magnetic, 1)}°)`}${entry.bearingSigma === null ? "" : ` ± ${entry.bearingSigma}°`}`;
    const where = `${fixed(entry.lat, 5)}, ${fixed(entry.lon, 5)}${entry.accuracy === null ? "" : ` ± ${fixed(entry.accuracy, 0)} m`}`;
    const name = `${what}, ${clock(entry.time)}`;
    return element("li", entry.struck ? { class: "struck" } : {}, element("span", {}, element("b", {}, what), element("small", {}, `${clock(entry.time)}, ${where}`)),
      button(entry.struck ? "Restore" : "Strike", () => { entry.struck = !entry.struck; changed(); }, { "aria-label": `${entry.struck ? "Restore" : "Strike out"} ${name}` }),
      button("×", () => { field.deleted = [index, entry]; field.entries.splice(index, 1); changed(); byId("entries-undo").focus(); }, { "aria-label": `Delete ${name}`, title: "Delete" }));
  }));
  byId("entries-save").disabled = byId("entries-clear").disabled = !field.entries.length;
  byId("entries-undo").hidden = !field.deleted;
  const count = field.entries.length, struck = field.entries.filter((entry) => entry.struck).length;
  byId("kept").textContent = [
    count ? `${count} ${count === 1 ? "entry" : "entries"}${struck ? `, ${struck} struck out` : ""}.` : "No entries yet.",
    field.keeps ? "This browser keeps the list until it is cleared." : "This browser refuses to keep the list: save it before you close the page.",
  ].join(" ");
}

function changed() {
  keepEntries();
  showEntries();
  locateEntries();
}

// ---------------------------------------------------------------- place and compass

const say = (text) => { byId("field-status").textContent = text; };

function placeByHand() {
  const lat = numberIn("hand-lat"), lon = numberIn("hand-lon");
  return lat === null || lon === null || Math.abs(lat) > 90 || Math.abs(lon) > 180 ? null : { lat, lon, accuracy: null, since: Date.now() };
}

const placeNow = () => placeByHand() ?? field.place;

function showPlace() {
  const place = placeNow();
  if (!place) return;
  const age = (Date.now() - place.since) / 1000;
  byId("here").textContent = `${fixed(place.lat, 5)}, ${fixed(place.lon, 5)} ${place.accuracy === null ? "by hand" : `± ${fixed(place.accuracy, 0)} m`}${age > OLD_S ? `, ${Math.round(age)} s old` : ""}`;
  showFix();
}

async function located({ coords, timestamp }) {
  const isFirst = !field.place;
  field.place = { lat: coords.latitude, lon: coords.longitude, accuracy: coords.accuracy, since: timestamp };
  say("");
  showPlace();
  if (isFirst) await findDeclination();
}

const notLocated = ({ code, message }) => say(code === 1
  ? "The browser may not use the place: allow it in the settings of the browser or the page, or enter the place by hand."
  : `The place is not known: ${message || "no answer"}`);

// The heading of the phone's upper edge. While the phone stands upright the edge points nowhere over the ground.
function turned(event) {
  const isCompass = Number.isFinite(event.webkitCompassHeading);
  if (!isCompass && !(event.absolute && Number.isFinite(event.alpha))) return;
  field.heading = (isCompass ? event.webkitCompassHeading : 360 - event.alpha) % 360;
  field.isSteep = Math.abs(event.beta ?? 0) > 60;
  byId("hold").disabled = false;
  const magnetic = `${fixed(field.heading, 0)}°`;
  const fromTrue = field.declination === null ? "" : `, ${fixed((field.heading + field.declination + 360) % 360, 0)}° from true North`;
  byId("compass").textContent = field.isSteep ? `${magnetic}: hold the phone flat` : `${magnetic}${fromTrue}`;
}

// The sensors start by a press, as browsers ask for it.
async function watch() {
  if (!navigator.geolocation) say("This browser has no place: enter it by hand.");
  else {
    if (field.watched !== null) navigator.geolocation.clearWatch(field.watched);
    field.watched = navigator.geolocation.watchPosition(located, notLocated, { enableHighAccuracy: true });
  }
  if (typeof DeviceOrientationEvent === "undefined") { byId("compass").textContent = "none in this browser"; return; }
  const allowed = await (DeviceOrientationEvent.requestPermission?.().catch(() => "denied") ?? "granted");
  if (field.heading === null) byId("compass").textContent = allowed === "granted" ? "no reading yet" : "not allowed by the browser";
  for (const kind of ["deviceorientationabsolute", "deviceorientation"]) {
    removeEventListener(kind, turned);
    addEventListener(kind, turned);
  }
  // A phone that sleeps would lose its place; browsers without the lock, or on a low battery, go on without it.
  navigator.wakeLock?.request("screen").catch(() => {});
}

// The bearing from true North that the program makes of one from magnetic North, by its World Magnetic Model.
async function fromMagnetic(bearing, { lat, lon }, time) {
  converter ??= startEngine();
  const table = `time_utc,lat_deg,lon_deg,bearing_deg_compass\n${time},${lat},${lon},${bearing}\n`;
  const { written } = await ask(converter, ["convert", "magnetic.csv", "true.csv", "--north", "magnetic"], [["magnetic.csv", new TextEncoder().encode(table)]], ["true.csv"]);
  const [names, values] = new TextDecoder().decode(written.get("true.csv")).split("\n").map((line) => line.split(","));
  const converted = values?.[names.indexOf("bearing_deg_compass")];
  if (!converted) throw new Error("the declination is not known at this place and time");
  return Number(converted);
}

async function findDeclination() {
  const place = placeNow();
  try {
    const turn = await fromMagnetic(0, place, new Date().toISOString());
    field.declination = turn > 180 ? turn - 360 : turn;
    showFix();
  } catch (error) {
    say(`Declination: ${error.message}`);
  }
}

// ---------------------------------------------------------------- entries

// A new entry at the present place, or null if that is not known.
function entryHere() {
  const place = placeNow();
  if (!place) { say("The place is not known yet: start it, or enter it by hand."); return null; }
  const { lat, lon, accuracy } = place;
  return {
    time: new Date().toISOString(), lat: Number(lat.toFixed(7)), lon: Number(lon.toFixed(7)), accuracy,
    sigma: accuracy === null ? null : Number(Math.max(0.1, accuracy / RADII).toFixed(1)), level: null, bearing: null, magnetic: null, bearingSigma: null, struck: false,
  };
}

function addEntry(entry) {
  field.entries.push(entry);
  field.deleted = null;
  say("");
  changed();
}

function levelHere(level) {
  const entry = level === null ? null : entryHere();
  if (level === null) say("Enter a level first.");
  if (!entry) return;
  byId("level").value = "";
  addEntry({ ...entry, level });
}

async function bearingHere() {
  const typed = numberIn("bearing"), isMagnetic = typed === null || byId("north").value === "magnetic";
  const given = typed ?? field.heading;
  if (given === null) { say("There is no compass reading: enter a bearing."); return; }
  if (typed === null && field.isSteep) { say("Hold the phone flat, its upper edge towards the transmitter."); return; }
  const bearing = Number((((given % 360) + 360) % 360).toFixed(1)), entry = entryHere();
  if (!entry) return;
  byId("bearing-here").disabled = true;
  try {
    const fromTrue = isMagnetic ? await fromMagnetic(bearing, entry, entry.time) : bearing;
    byId("bearing").value = "";
    addEntry({ ...entry, bearing: fromTrue, magnetic: isMagnetic ? bearing : null, bearingSigma: numberIn("bearing-sigma-deg") });
  } catch (error) {
    say(error.message);
  } finally {
    byId("bearing-here").disabled = false;
  }
}

// ---------------------------------------------------------------- the fix

let locating = false, again = false;

// Locates from the list; while that goes on, or another computation does, the list may change and is then located again.
async function locateEntries() {
  again = true;
  if (locating) return;
  locating = true;
  try {
    while (again) {
      while (busy) await ending;
      again = false;
      if (!field.entries.some((entry) => !entry.struck)) { field.fix = null; byId("field-fix").replaceChildren("No fix yet."); break; }
      const given = [[LIST, new TextEncoder().encode(listTable())]];
      await runAll([{ work: "locate", names: [LIST], args: ["locate", LIST, "--every-beacon", "--report", REPORT], given, panel: "field", stays: true }]);
      const [one] = runs;
      // Another computation may have come between and taken the answer's place.
      if (one?.given !== given) { again = true; continue; }
      field.fix = rowsOf([one])[0] ?? null;
      if (field.fix) showFix();
      // Too few entries are no error yet.
      else { byId("field-fix").replaceChildren(`No fix yet: ${one.errors.join(" ")}`); errors([]); }
      field.located += 1;
    }
  } finally {
    locating = false;
  }
}

const EARTH_M = 6371008.8;

// Distance in metres and direction in degrees from true North, on a sphere.
function way(from, to) {
  const [a, b, turn] = [from.lat, to.lat, to.lon - from.lon].map((degrees) => (degrees * Math.PI) / 180);
  const east = Math.sin(turn) * Math.cos(b), north = Math.cos(a) * Math.sin(b) - Math.sin(a) * Math.cos(b) * Math.cos(turn);
  const along = Math.sin(a) * Math.sin(b) + Math.cos(a) * Math.cos(b) * Math.cos(turn);
  return { metres: EARTH_M * Math.atan2(Math.hypot(east, north), along), degrees: ((Math.atan2(east, north) * 180) / Math.PI + 360) % 360 };
}

function showFix() {
  const { fix } = field, here = placeNow();
  if (!fix) return;
  const path = here && way(here, fix);
  const byCompass = field.declination === null ? "" : `, ${fixed((path?.degrees - field.declination + 360) % 360, 0)}° by the compass`;
  const doubts = fix.remarks.filter(({ note }) => !note);
  const lines = [path && `${said(Math.round(path.metres))} m from here, ${fixed(path.degrees, 0)}° from true North${byCompass}`, `${fixed(fix.lat, 6)}, ${fixed(fix.lon, 6)}`, `95 % ellipse ${fixed(fix.ellipse.semi_major, 0)} × ${fixed(fix.ellipse.semi_minor, 0)} m`];
  const parts = [...lines.filter(Boolean).map((line, index) => element("p", index ? {} : { class: "first" }, line)),
    ...(doubts.length ? [element("ul", { class: "doubts", "aria-label": "Remarks on the fix" }, ...doubts.map((remark) => element("li", {}, remark.text)))] : [])];
  // A screen reader says what is put here, so it is put here only when it is new.
  const text = parts.map((part) => part.textContent).join("");
  if (byId("field-fix").textContent !== text) byId("field-fix").replaceChildren(...parts);
}

// ---------------------------------------------------------------- receivers that send lines

let receiver = null, lastEach = 0;

// The level in a line: the number before dB or dBm, else the first negative one, else the first.
function levelIn(line) {
  const found = line.match(/([-−]?\d+(?:\.\d+)?)\s*dB/i) ?? line.match(/(?<![\d.])([-−]\d+(?:\.\d+)?)/) ?? line.match(/(\d+(?:\.\d+)?)/);
  return found ? Number(found[1].replace("−", "-")) : null;
}

function heard(line) {
  const level = levelIn(line);
  byId("received").textContent = `Last line: ${line.trim().slice(0, 80)}`;
  if (level === null) return;
  byId("level").value = level;
  if (byId("each").checked && Date.now() - lastEach >= 2000 && placeNow()) { lastEach = Date.now(); levelHere(level); }
}

// Takes pieces of text and hears their lines. A line without an end ends when nothing follows for 0.3 s.
function lineTaker() {
  let rest = "", timer = null;
  return (piece) => {
    const lines = (rest + piece).split(/[\r\n]+/);
    rest = lines.pop();
    for (const line of lines) if (line.trim()) heard(line);
    clearTimeout(timer);
    timer = setTimeout(() => { if (rest.trim()) heard(rest); rest = ""; }, 300);
  };
}

function connected(close) {
  receiver = { close };
  byId("disconnect").hidden = false;
  byId("received").textContent = "Connected; no line yet.";
}

async function disconnect() {
  const { close } = receiver ?? {};
  receiver = null;
  byId("disconnect").hidden = true;
  byId("received").textContent = "Disconnected.";
  await close?.();
}

async function openSerial() {
  const port = await navigator.serial.requestPort();
  await port.open({ baudRate: Math.floor(numberIn("baud") ?? 115200) });
  const reader = port.readable.getReader(), decoder = new TextDecoder(), take = lineTaker();
  connected(async () => { await reader.cancel().catch(() => {}); reader.releaseLock(); await port.close().catch(() => {}); });
  try {
    for (;;) {
      const { value, done } = await reader.read();
      if (done) break;
      take(decoder.decode(value, { stream: true }));
    }
  } finally {
    if (receiver) await disconnect();
  }
}

async function openBluetooth() {
  const service = byId("service").value.trim().toLowerCase();
  const device = await navigator.bluetooth.requestDevice({ acceptAllDevices: true, optionalServices: [service] });
  const server = await device.gatt.connect(), take = lineTaker(), decoder = new TextDecoder();
  const channels = (await (await server.getPrimaryService(service)).getCharacteristics()).filter(({ properties }) => properties.notify || properties.indicate);
  if (!channels.length) { server.disconnect(); throw new Error("the service sends no notifications"); }
  for (const channel of channels) {
    channel.addEventListener("characteristicvaluechanged", ({ target }) => take(decoder.decode(target.value, { stream: true })));
    await channel.startNotifications();
  }
  device.addEventListener("gattserverdisconnected", () => { if (receiver) disconnect(); });
  connected(async () => server.disconnect());
}

const opens = (open) => () => open().catch((error) => { if (error.name !== "NotFoundError") say(`The receiver cannot be read: ${error.message}`); });

// ---------------------------------------------------------------- a page that is served may stand on a phone's home screen

// A browser reads the manifest of a page from a server alone, and its addresses have to be whole.
function offerInstallation() {
  if (!location.protocol.startsWith("http")) return;
  const { offline } = document.documentElement.dataset;
  // Without it the page works as before, with a network.
  if (offline) navigator.serviceWorker?.register(offline).catch(() => {});
  const canvas = element("canvas", { width: 192, height: 192 }), pen = canvas.getContext("2d");
  pen.fillStyle = "#005f96";
  pen.fillRect(0, 0, 192, 192);
  pen.strokeStyle = "#fff";
  pen.lineWidth = 10;
  // Two bearings that cross at a transmitter.
  for (const [x, y] of [[30, 165], [162, 165]]) { pen.beginPath(); pen.moveTo(x, y); pen.lineTo(96, 66); pen.stroke(); }
  pen.fillStyle = "#e69f00";
  pen.beginPath();
  pen.arc(96, 62, 30, 0, 2 * Math.PI);
  pen.fill();
  const start = location.href.split("#")[0];
  const manifest = { name: "foxhunt", short_name: "foxhunt", id: start, start_url: start, scope: new URL(".", start).href, display: "standalone", background_color: "#ffffff", theme_color: "#005f96", icons: [{ src: canvas.toDataURL("image/png"), sizes: "192x192", type: "image/png" }] };
  document.head.append(element("link", { rel: "manifest", href: `data:application/manifest+json,${encodeURIComponent(JSON.stringify(manifest))}` }));
}

// ---------------------------------------------------------------- hands of the field

Object.assign(field, { levelIn, table: listTable });

byId("watch").addEventListener("click", watch);
for (const id of ["hand-lat", "hand-lon"]) byId(id).addEventListener("change", () => { showPlace(); if (placeByHand()) findDeclination(); });
byId("level-form").addEventListener("submit", (event) => { event.preventDefault(); levelHere(numberIn("level")); });
byId("level-unit").addEventListener("change", changed);
byId("bearing-form").addEventListener("submit", (event) => { event.preventDefault(); bearingHere(); });
byId("hold").addEventListener("click", () => {
  if (field.isSteep) { say("Hold the phone flat, its upper edge towards the transmitter."); return; }
  byId("bearing").value = fixed(field.heading, 1);
  byId("north").value = "magnetic";
});
byId("entries-save").addEventListener("click", () => save(LIST, listTable(), "text/csv"));
byId("entries-clear").addEventListener("click", () => {
  if (!confirm(`Delete all ${field.entries.length} entries?`)) return;
  field.entries = [];
  field.deleted = null;
  changed();
});
byId("entries-undo").addEventListener("click", () => {
  const [index, entry] = field.deleted;
  field.entries.splice(index, 0, entry);
  field.deleted = null;
  changed();
});
byId("serial").hidden = !navigator.serial;
byId("bluetooth").hidden = !navigator.bluetooth;
byId("receivers").hidden = !navigator.serial && !navigator.bluetooth;
byId("serial").addEventListener("click", opens(openSerial));
byId("bluetooth").addEventListener("click", opens(openBluetooth));
byId("disconnect").addEventListener("click", disconnect);
setInterval(showPlace, 5000);
offerInstallation();
restoreEntries();
showEntries();
// A list that was kept is located when it is first looked at.
byId("tab-field").addEventListener("chosen", () => { if (field.entries.length) locateEntries(); }, { once: true });
