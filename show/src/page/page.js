// The report page: a map in time, the turn behind each bearing, plots and events.
// Its data are the JSON of data.rs: metres East and North, radians counter-clockwise from East, seconds.
// place.js, heat.js, tools.js, strike.js, tiles.js and live.js stand behind it in the same scope.

const data = JSON.parse(document.getElementById("data").textContent);
// Tiles of a map that the page brings along.
const embedded = JSON.parse(document.getElementById("embedded").textContent || "null");
const hasTiles = Boolean(embedded || data.live?.tiles);
const byId = (id) => document.getElementById(id);
// What only a script can do is shown by one.
document.querySelector("main").hidden = byId("looks").hidden = byId("keys").hidden = false;

// ---------------------------------------------------------------- colours, numbers, elements

// Okabe & Ito 2008, told apart with any colour vision; receivers have numbers besides.
const RECEIVERS = ["#0072b2", "#e69f00", "#009e73", "#56b4e9", "#cc79a7", "#8c6e1e"];
const SEARCHES = ["#d55e00", "#7b3294", "#00624a", "#8c510a"];
const SHEET = {
  ink: "#000", faint: "#555", grid: "#e2e2e2", paper: "#fff", veil: "#ffffff33", plate: "#ffffffd0", receivers: RECEIVERS, searches: SEARCHES,
  width: 1, past: 0.35, area: 1, levels: [25, 30],
};
// The hues of a sheet, darker on white for the sun, and lighter on black for the night.
const IN_THE_SUN = {
  ...SHEET, faint: "#000", grid: "#9a9a9a", veil: "#ffffff8c", width: 1.8, past: 0.5, area: 1.8,
  receivers: ["#004c7a", "#9a5b00", "#00543d", "#1f6fa0", "#8b3f6e", "#4d3b0c"],
};
const AT_NIGHT = {
  ...SHEET, ink: "#f0f0f0", faint: "#b9bfc4", grid: "#2f353a", paper: "#16191c", veil: "#16191c99", plate: "#16191cd0", past: 0.5, levels: [45, 35],
  receivers: ["#5aaee6", "#f0a830", "#2fc79a", "#a5dbfb", "#e39ac6", "#c9a65a"], searches: ["#ff8438", "#c892e6", "#5fd6b6", "#d8a066"],
};
// How the map is drawn now: colours, how thick lines are and how faint what is past.
let look = SHEET;
const receiverColour = (index) => look.receivers[index % RECEIVERS.length];
const searchColour = (index) => look.searches[index % SEARCHES.length];

const TAU = 2 * Math.PI;
const compass = (angle) => (((90 - (angle * 180) / Math.PI) % 360) + 360) % 360;
const fixed = (value, decimals) => (Number.isFinite(value) ? value.toFixed(decimals) : "–");
const degrees = (angle) => fixed((angle * 180) / Math.PI, 1) + "°";

// Text is only ever set as text, never as HTML: names come from files.
function element(tag, attributes, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) made.setAttribute(name, value);
  made.append(...children);
  return made;
}

// A table, without the columns whose head is null; a narrow screen has each cell below its head.
function filled(table, head, rows) {
  const shown = head.map((name, index) => [name, index]).filter(([name]) => name !== null);
  const line = (cells) => element("tr", {}, ...shown.map(([name, index]) => element("td", { "data-name": name }, cells[index])));
  table.className = "reflow";
  table.replaceChildren(
    element("thead", {}, element("tr", {}, ...shown.map(([name]) => element("th", { scope: "col" }, name)))),
    element("tbody", {}, ...rows.map(line)));
  return table;
}

// A distance in metres as people read it.
const metres = (value) => (value >= 9999.5 ? `${fixed(value / 1000, 1)} km` : `${fixed(value, value >= 999.5 ? 0 : 1)} m`);
// East and North in metres, in the words of a compass.
const directed = ([east, north]) => `${metres(Math.abs(east))} ${east < 0 ? "W" : "E"}, ${metres(Math.abs(north))} ${north < 0 ? "S" : "N"}`;

function drawn(tag, attributes, text) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

// Points of 12 bits for either number, four characters each.
const SIX_BITS = new Map([..."ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"].map((c, i) => [c.charCodeAt(0), i]));
function unpack({ from, size, points }) {
  const places = new Float64Array(points.length / 2);
  for (let i = 0; i < places.length; i += 1) {
    const steps = SIX_BITS.get(points.charCodeAt(2 * i)) * 64 + SIX_BITS.get(points.charCodeAt(2 * i + 1));
    places[i] = from[i % 2] + (size[i % 2] * steps) / 4095;
  }
  return places;
}

// The number of leading items whose time is not after `time`; items are in the order of time.
function countUntil(times, time) {
  let low = 0, high = times.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle + 1; else high = middle;
  }
  return low;
}

// ---------------------------------------------------------------- the data in the order of time

let begin, end, duration, hasBearings, lowest, highest, receivedTimes;
const received = [];

// Adds receptions, in the order of time.
function addReceived(more) {
  for (const one of more) {
    // What it was before anything was struck out in this page.
    one.original = { used: one.used, nis: one.nis, struck: Boolean(one.struck) };
    received.push(one);
  }
  received.forEach((one, index) => { one.index = index; });
  received.sort((a, b) => a.time - b.time || a.index - b.index);
  received.forEach((one, index) => { one.index = index; });
}

// What follows from the data as they are now.
function survey() {
  [begin, end] = data.span;
  duration = Math.max(end - begin, 1e-9);
  receivedTimes = received.map((one) => one.time);
  for (const search of data.searches) {
    search.original ||= search.beliefs;
    search.first ||= { regions: search.regions, rivals: search.rivals, heat: search.heat, remarks: search.remarks || [], rows: search.rows || [], of_rows: search.of_rows, smoothed: search.smoothed };
    search.times = search.beliefs.map((belief) => belief.time);
    search.unpacked ||= new Map();
  }
  for (const receiver of data.receivers) {
    receiver.path.sort((a, b) => a[0] - b[0]);
    receiver.times = receiver.path.map((knot) => knot[0]);
  }
  hasBearings = received.some((one) => one.bearing || one.modes);
  const levels = received.filter((one) => one.level).map((one) => one.level[0]);
  lowest = levels.reduce((a, b) => Math.min(a, b), Infinity);
  highest = levels.reduce((a, b) => Math.max(a, b), -Infinity);
}
addReceived(data.received);
survey();

// A place on the way at a time, on straight lines between knots [time, East, North, …].
function placeAt(knots, times, time) {
  const after = countUntil(times, time);
  if (after === 0) return null;
  const a = knots[after - 1], b = knots[after];
  if (!b) return [a[1], a[2]];
  const share = (time - a[0]) / Math.max(b[0] - a[0], 1e-9);
  return [a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])];
}

const beliefAt = (search, time) => search.beliefs[countUntil(search.times, time) - 1];

function clockText(time) {
  if (data.epoch !== null && data.epoch !== undefined) {
    return new Date((data.epoch + time) * 1000).toISOString().slice(11, 21).replace("T", " ");
  }
  return `${fixed(time - (begin > 1e6 ? begin : 0), 1)} s`;
}

// East, North and Up about the origin on WGS84, to and from latitude and longitude in degrees.
const earth = data.origin && (() => {
  const [lat0, lon0, height] = data.origin, a = 6378137, e2 = 6.69437999014e-3, rad = Math.PI / 180;
  const centred = (lat, lon) => {
    const sin = Math.sin(lat * rad), cos = Math.cos(lat * rad), n = a / Math.sqrt(1 - e2 * sin * sin);
    return [(n + height) * cos * Math.cos(lon * rad), (n + height) * cos * Math.sin(lon * rad), (n * (1 - e2) + height) * sin];
  };
  const zero = centred(lat0, lon0), sin = Math.sin(lat0 * rad), cos = Math.cos(lat0 * rad);
  const sinLon = Math.sin(lon0 * rad), cosLon = Math.cos(lon0 * rad), w = 1 - e2 * sin * sin;
  const perLat = ((a * (1 - e2)) / w ** 1.5 + height) * rad, perLon = (a / Math.sqrt(w) + height) * cos * rad;
  const toLocal = (lat, lon) => {
    const [dx, dy, dz] = centred(lat, lon).map((value, i) => value - zero[i]);
    return [cosLon * dy - sinLon * dx, cos * dz - sin * (cosLon * dx + sinLon * dy)];
  };
  // Newton's steps, for a place on the ellipsoid; within 100 km the third is below a millimetre.
  const toDegrees = ([east, north]) => {
    let lat = lat0, lon = lon0;
    for (let i = 0; i < 5; i += 1) {
      const [e, n] = toLocal(lat, lon);
      lat += (north - n) / perLat; lon += (east - e) / perLon;
    }
    return [lat, lon];
  };
  return { toLocal, toDegrees };
})();
const onEarth = (place) => earth.toDegrees(place).map((value) => value.toFixed(6)).join(", ");

// ---------------------------------------------------------------- the state

const state = { time: end, playing: false, selected: null, layers: {}, dark: false, contrast: false };
const levelUnit = data.relative_levels ? "dB" : "dBm";

// ---------------------------------------------------------------- the map

const canvas = byId("map"), context = canvas.getContext("2d");
const view = { east: 0, north: 0, scale: 1, width: 1, height: 1, moved: false };

let extent, rayLength;
function findExtent() {
  let [west, south, east, north] = [Infinity, Infinity, -Infinity, -Infinity];
  const add = (e, n) => {
    west = Math.min(west, e); east = Math.max(east, e); south = Math.min(south, n); north = Math.max(north, n);
  };
  for (const receiver of data.receivers) for (const knot of receiver.path) add(knot[1], knot[2]);
  if (data.searched) {
    const { corner, cell, columns, numbers } = data.searched;
    add(...corner); add(corner[0] + columns * cell, corner[1] + (numbers.length / 2 / columns) * cell);
  }
  for (const one of received) add(one.place[0], one.place[1]);
  for (const search of data.searches) {
    for (const knot of search.truth) add(knot[1], knot[2]);
    for (const rival of search.rivals) add(rival[0], rival[1]);
    const last = search.beliefs[search.beliefs.length - 1];
    if (last) add(...last.place);
    if (last && last.ellipse && last.ellipse[0] < 3 * Math.hypot(east - west, north - south)) {
      const r = last.ellipse[0];
      add(last.place[0] - r, last.place[1] - r); add(last.place[0] + r, last.place[1] + r);
    }
  }
  if (west > east) [west, south, east, north] = [-10, -10, 10, 10];
  const least = Math.max(10 - Math.max(east - west, north - south), 0) / 2;
  extent = { west: west - least, south: south - least, east: east + least, north: north + least };
  rayLength = Math.max(0.6 * Math.hypot(extent.east - extent.west, extent.north - extent.south), 10);
}
findExtent();

function fit() {
  const margin = 46;
  view.scale = Math.min(
    Math.max(view.width - 2 * margin, 50) / (extent.east - extent.west),
    Math.max(view.height - 2 * margin, 50) / (extent.north - extent.south),
  );
  view.east = (extent.west + extent.east) / 2;
  view.north = (extent.south + extent.north) / 2;
  view.moved = false;
}
const x = (east) => view.width / 2 + (east - view.east) * view.scale;
const y = (north) => view.height / 2 - (north - view.north) * view.scale;
const toPlace = (px, py) => [view.east + (px - view.width / 2) / view.scale, view.north - (py - view.height / 2) / view.scale];

// 1, 2 or 5 times a power of ten, at least `least`.
function nice(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return [1, 2, 5, 10].map((step) => step * power).find((step) => step >= least);
}

function path(points, close) {
  context.beginPath();
  points.forEach(([e, n], index) => (index ? context.lineTo(x(e), y(n)) : context.moveTo(x(e), y(n))));
  if (close) context.closePath();
}

function label(text, px, py, colour) {
  context.font = "600 14px system-ui, sans-serif";
  context.lineWidth = 4; context.strokeStyle = look.paper; context.lineJoin = "round";
  context.strokeText(text, px, py);
  context.fillStyle = colour; context.fillText(text, px, py);
}

// Draws the map below all else, where there is one (tiles.js).
let drawTiles = null;

function drawGround() {
  context.fillStyle = look.paper; context.fillRect(0, 0, view.width, view.height);
  if (drawTiles && state.layers.tiles) drawTiles();
  const step = nice(90 / view.scale), [west, north] = toPlace(0, 0), [east, south] = toPlace(view.width, view.height);
  const decimals = step < 1 ? Math.ceil(-Math.log10(step)) : 0;
  context.lineWidth = 1; context.strokeStyle = look.grid; context.fillStyle = look.faint; context.font = "12px system-ui, sans-serif";
  context.textAlign = "center";
  for (let e = Math.ceil(west / step) * step; e <= east; e += step) {
    context.beginPath(); context.moveTo(x(e), 0); context.lineTo(x(e), view.height); context.stroke();
    if (x(e) > 60) context.fillText(e.toFixed(decimals), x(e), 14);
  }
  context.textAlign = "left";
  for (let n = Math.ceil(south / step) * step; n <= north; n += step) {
    context.beginPath(); context.moveTo(0, y(n)); context.lineTo(view.width, y(n)); context.stroke();
    if (y(n) > 24 && y(n) < view.height - 30) context.fillText(n.toFixed(decimals), 4, y(n) - 3);
  }
}

function drawScaleAndNorth() {
  const bar = nice(70 / view.scale), px = bar * view.scale, right = view.width - 16, bottom = view.height - 14;
  context.fillStyle = look.plate; context.fillRect(right - px - 8, bottom - 24, px + 16, 34);
  context.strokeStyle = look.ink; context.fillStyle = look.ink; context.lineWidth = 3;
  context.beginPath(); context.moveTo(right - px, bottom); context.lineTo(right, bottom); context.stroke();
  context.textAlign = "center"; context.font = "600 13px system-ui, sans-serif";
  context.fillText(bar >= 1000 ? `${bar / 1000} km` : `${bar} m`, right - px / 2, bottom - 8);
  const left = 26, top = 34;
  context.beginPath(); context.moveTo(left, top - 18); context.lineTo(left + 8, top + 8); context.lineTo(left, top + 2);
  context.lineTo(left - 8, top + 8); context.closePath(); context.fill();
  context.fillText("N", left, top + 24);
  context.textAlign = "left";
}

// Viridis-like steps from weak to strong, legible without colour vision by their lightness.
const shareColour = (share) => `hsl(${Math.round(270 - 215 * share)} 75% ${Math.round(look.levels[0] + look.levels[1] * share)}%)`;
const levelColour = (dbm) => shareColour(highest > lowest ? (dbm - lowest) / (highest - lowest) : 1);

function wedge(one, alpha) {
  const [angle, sigma] = one.bearing, [e, n] = one.place, reach = Math.min(sigma, Math.PI);
  context.beginPath(); context.moveTo(x(e), y(n));
  context.arc(x(e), y(n), rayLength * view.scale, -(angle + reach), -(angle - reach));
  context.closePath();
  context.globalAlpha = alpha * look.area; context.fillStyle = receiverColour(one.receiver); context.fill(); context.globalAlpha = 1;
}

function ray(one, angle, dash, width, alpha) {
  const [e, n] = one.place;
  context.globalAlpha = alpha; context.lineWidth = width * look.width; context.setLineDash(dash);
  context.strokeStyle = one.struck ? look.faint : receiverColour(one.receiver);
  path([[e, n], [e + rayLength * Math.cos(angle), n + rayLength * Math.sin(angle)]]); context.stroke();
  context.setLineDash([]); context.globalAlpha = 1;
}

function drawReceived(count) {
  // The latest of each receiver stand out.
  const latest = new Map();
  for (let i = count - 1; i >= 0 && latest.size < data.receivers.length; i -= 1) {
    const key = received[i].receiver;
    if (!latest.has(key) && received[i].time >= state.time - 0.2 * duration) latest.set(key, i);
    else if (received[i].time < state.time - 0.2 * duration) break;
  }
  const isLatest = (one) => latest.get(one.receiver) === one.index;
  if (hasBearings) {
    for (let i = 0; i < count; i += 1) {
      const one = received[i];
      if (!one.bearing) continue;
      if (state.layers.wedges && !one.struck && (isLatest(one) || i === state.selected)) wedge(one, i === state.selected ? 0.3 : 0.16);
      if (state.layers.bearings) {
        const strong = isLatest(one) || i === state.selected;
        const dash = one.struck ? [2, 7] : one.used ? [] : [6, 5];
        ray(one, one.bearing[0], dash, i === state.selected ? 4 : strong ? 2.5 : 1, strong ? 1 : look.past);
      }
    }
    if (state.layers.rivals) {
      for (let i = 0; i < count; i += 1) {
        const one = received[i];
        if (one.modes && (isLatest(one) || i === state.selected)) for (const mode of one.modes) ray(one, mode[1], [2, 4], 2, 0.9);
      }
    }
  }
}

// A cross over what was struck out.
function drawStruck(one) {
  const [px, py] = [x(one.place[0]), y(one.place[1])];
  // Those of one place stand beside each other, each on its own bearing.
  const [dx, dy] = one.bearing ? [16 * Math.cos(one.bearing[0]), -16 * Math.sin(one.bearing[0])] : [0, 0];
  const cross = () => {
    context.beginPath();
    for (const turn of [1, -1]) {
      context.moveTo(px + dx - 5, py + dy - 5 * turn); context.lineTo(px + dx + 5, py + dy + 5 * turn);
    }
    context.stroke();
  };
  context.lineWidth = 5; context.strokeStyle = look.paper; cross();
  context.lineWidth = 2.5; context.strokeStyle = look.ink; cross();
}

function drawPlaces(count) {
  if (state.layers.places) {
    for (let i = 0; i < count; i += 1) {
      const one = received[i], radius = hasBearings ? 3.5 : 4.5;
      context.beginPath(); context.arc(x(one.place[0]), y(one.place[1]), radius, 0, TAU);
      context.fillStyle = !hasBearings && one.level ? levelColour(one.level[0]) : receiverColour(one.receiver);
      if (one.level || one.bearing) context.fill();
      else { context.strokeStyle = look.faint; context.lineWidth = 1.5; context.stroke(); }
    }
  }
  for (let i = 0; i < count; i += 1) if (received[i].struck) drawStruck(received[i]);
  const selected = received[state.selected];
  if (selected) {
    context.beginPath(); context.arc(x(selected.place[0]), y(selected.place[1]), 10, 0, TAU);
    context.lineWidth = 3; context.strokeStyle = look.ink; context.stroke();
  }
}

function drawPaths() {
  data.receivers.forEach((receiver, index) => {
    const count = countUntil(receiver.times, state.time), here = placeAt(receiver.path, receiver.times, state.time);
    if (!here) return;
    path([...receiver.path.slice(0, count).map((knot) => [knot[1], knot[2]]), here]);
    context.lineJoin = "round";
    context.lineWidth = 6; context.strokeStyle = look.paper; context.stroke();
    context.lineWidth = 3; context.strokeStyle = receiverColour(index); context.globalAlpha = 0.8; context.stroke(); context.globalAlpha = 1;
  });
}

function drawReceivers() {
  if (data.receivers.length > 12) return;
  data.receivers.forEach((receiver, index) => {
    const here = placeAt(receiver.path, receiver.times, state.time);
    if (!here) return;
    context.beginPath(); context.arc(x(here[0]), y(here[1]), 10, 0, TAU);
    context.fillStyle = receiverColour(index); context.fill();
    context.lineWidth = 2; context.strokeStyle = look.paper; context.stroke();
    context.font = "700 13px system-ui, sans-serif"; context.textAlign = "center";
    context.fillStyle = state.dark || (!state.contrast && (index % RECEIVERS.length === 1 || index % RECEIVERS.length === 3)) ? "#000" : "#fff";
    context.fillText(String(index + 1), x(here[0]), y(here[1]) + 4.5); context.textAlign = "left";
  });
}

function cloudOf(search, belief) {
  if (!belief.cloud) return null;
  if (!search.unpacked.has(belief)) {
    if (search.unpacked.size > 64) search.unpacked.clear();
    search.unpacked.set(belief, unpack(belief.cloud));
  }
  return search.unpacked.get(belief);
}

function drawCloud(search, belief, colour) {
  const places = cloudOf(search, belief);
  if (!places) return;
  context.fillStyle = colour; context.globalAlpha = Math.min(0.35 * look.area, 1);
  for (let i = 0; i < places.length; i += 2) context.fillRect(x(places[i]) - 1.5, y(places[i + 1]) - 1.5, 3, 3);
  context.globalAlpha = 1;
}

function drawSearch(search, index) {
  const colour = searchColour(index), belief = beliefAt(search, state.time);
  if (!belief) return;
  const isLast = belief === search.beliefs[search.beliefs.length - 1];
  if (state.layers.cloud) drawCloud(search, belief, colour);
  if (isLast && state.layers.regions) {
    for (const part of search.regions) {
      context.beginPath();
      for (const border of part) border.forEach(([e, n], i) => (i ? context.lineTo(x(e), y(n)) : context.moveTo(x(e), y(n))));
      // The heat map is its area.
      if (!state.layers.heat) { context.globalAlpha = 0.2; context.fillStyle = colour; context.fill("evenodd"); }
      context.globalAlpha = 1; context.lineWidth = 1.5; context.strokeStyle = colour; context.stroke();
    }
  }
  if (state.layers.estimates && search.beliefs.length > 1) {
    const count = countUntil(search.times, state.time);
    context.globalAlpha = 0.7; context.lineWidth = 1.5; context.strokeStyle = colour; context.setLineDash([3, 3]);
    path(search.beliefs.slice(0, count).map((one) => one.place)); context.stroke();
    context.setLineDash([]); context.globalAlpha = 1;
  }
  const [px, py] = [x(belief.place[0]), y(belief.place[1])];
  if (state.layers.ellipse && belief.ellipse) {
    const [a, b, along] = belief.ellipse;
    context.beginPath(); context.ellipse(px, py, a * view.scale, b * view.scale, -along, 0, TAU);
    context.lineWidth = 3 * look.width; context.strokeStyle = colour; context.stroke();
  }
  if (state.layers.conformal && search.conformal && belief.ellipse) {
    const [a, b, along] = belief.ellipse, scale = view.scale * search.conformal[1];
    context.beginPath(); context.ellipse(px, py, a * scale, b * scale, -along, 0, TAU);
    context.lineWidth = 2 * look.width; context.strokeStyle = colour; context.setLineDash([8, 5]); context.stroke(); context.setLineDash([]);
  }
  if (state.layers.estimates) {
    if (isLast) {
      for (const [e, n, density] of search.rivals) {
        context.strokeStyle = colour; context.lineWidth = 2; context.strokeRect(x(e) - 6, y(n) - 6, 12, 12);
        label(`rival, ${density.toFixed(2)}`, x(e) + 10, y(n) + 5, colour);
      }
    }
    context.lineWidth = 6; context.strokeStyle = look.paper;
    const cross = () => {
      context.beginPath(); context.moveTo(px - 9, py); context.lineTo(px + 9, py); context.moveTo(px, py - 9); context.lineTo(px, py + 9);
      context.stroke();
    };
    cross(); context.lineWidth = 3; context.strokeStyle = colour; cross();
    label(search.name, px + 11, py - 9, colour);
  }
}

// The track as all receptions have it, and its ellipse at the time that is shown.
function drawSmoothed(search, index) {
  if (!search.smoothed) return;
  const colour = searchColour(index);
  context.lineWidth = 2.5 * look.width; context.strokeStyle = colour;
  path(search.smoothed.map((one) => one.place)); context.stroke();
  const count = countUntil(search.smoothed.map((one) => one.time), state.time), here = search.smoothed[count - 1];
  if (!here) return;
  const [px, py] = [x(here.place[0]), y(here.place[1])];
  context.beginPath(); context.arc(px, py, 5, 0, TAU); context.fillStyle = colour; context.fill();
  if (here.ellipse) {
    const [a, b, along] = here.ellipse;
    context.beginPath(); context.ellipse(px, py, a * view.scale, b * view.scale, -along, 0, TAU);
    context.lineWidth = 1.5 * look.width; context.stroke();
  }
}

function drawTruth(search) {
  if (!search.truth.length) return;
  const here = placeAt(search.truth, search.truth.map((knot) => knot[0]), state.time) || [search.truth[0][1], search.truth[0][2]];
  if (search.truth.length > 1) {
    context.lineWidth = 1.5; context.strokeStyle = look.ink; context.setLineDash([8, 4]);
    path(search.truth.map((knot) => [knot[1], knot[2]])); context.stroke(); context.setLineDash([]);
  }
  const [px, py] = [x(here[0]), y(here[1])];
  context.beginPath();
  for (let i = 0; i < 10; i += 1) {
    const radius = i % 2 ? 4 : 10, angle = -Math.PI / 2 + (i * Math.PI) / 5;
    context.lineTo(px + radius * Math.cos(angle), py + radius * Math.sin(angle));
  }
  context.closePath(); context.fillStyle = look.ink; context.fill(); context.lineWidth = 1.5; context.strokeStyle = look.paper; context.stroke();
}

function drawMap() {
  const ratio = window.devicePixelRatio || 1;
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  drawGround();
  drawFields();
  const count = countUntil(receivedTimes, state.time);
  drawReceived(count);
  if (state.layers.paths) drawPaths();
  drawPlaces(count);
  data.searches.forEach(drawSearch);
  if (state.layers.smoothed) data.searches.forEach(drawSmoothed);
  if (state.layers.truth) data.searches.forEach(drawTruth);
  if (state.layers.paths) drawReceivers();
  drawTools();
  drawScaleAndNorth();
}

function resizeMap() {
  const box = byId("map-box").getBoundingClientRect(), ratio = window.devicePixelRatio || 1;
  view.width = box.width - 2; view.height = box.height - 2;
  canvas.width = Math.round(view.width * ratio); canvas.height = Math.round(view.height * ratio);
  if (!view.moved) fit();
}

// ---------------------------------------------------------------- pointing at the map

// The reception whose place or bearing is nearest to a pixel, among those that are shown.
function receptionAt(px, py, reach) {
  let best = null, least = reach;
  const count = countUntil(receivedTimes, state.time);
  for (let i = 0; i < count; i += 1) {
    const one = received[i], [dx, dy] = [px - x(one.place[0]), py - y(one.place[1])];
    let distance = Math.hypot(dx, dy) - 4;
    if (one.bearing && state.layers.bearings) {
      const [cos, sin] = [Math.cos(one.bearing[0]), -Math.sin(one.bearing[0])];
      const along = dx * cos + dy * sin, off = Math.abs(dy * cos - dx * sin);
      if (along >= 0 && along <= rayLength * view.scale) distance = Math.min(distance, off);
    }
    // Of equally near ones the latest: it is drawn on top.
    if (distance <= least) { least = distance; best = i; }
  }
  return best;
}

function zoom(factor, px = view.width / 2, py = view.height / 2) {
  const [e, n] = toPlace(px, py);
  view.scale = Math.min(Math.max(view.scale * factor, 1e-4), 1e5);
  const [e2, n2] = toPlace(px, py);
  view.east += e - e2; view.north += n - n2; view.moved = true;
  redraw();
}

const pointers = new Map();
let pressed = null;
canvas.addEventListener("pointerdown", (event) => {
  canvas.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
  pressed = pointers.size === 1 ? { at: [event.offsetX, event.offsetY], touch: event.pointerType !== "mouse" } : null;
});
canvas.addEventListener("pointermove", (event) => {
  const now = [event.offsetX, event.offsetY], before = pointers.get(event.pointerId);
  const place = toPlace(...now);
  byId("pointer").textContent = directed(place) + (earth ? `  (${onEarth(place)})` : "") + valueAt(place);
  if (!before) return;
  if (pointers.size === 2) {
    const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
    const apart = (a, b) => Math.max(Math.hypot(a[0] - b[0], a[1] - b[1]), 1);
    zoom(apart(now, other) / apart(before, other), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
  } else if (!pressed || Math.hypot(now[0] - pressed.at[0], now[1] - pressed.at[1]) > 5) {
    pressed = null;
    view.east -= (now[0] - before[0]) / view.scale; view.north += (now[1] - before[1]) / view.scale; view.moved = true;
    redraw();
  }
  pointers.set(event.pointerId, now);
});
canvas.addEventListener("pointerup", (event) => {
  pointers.delete(event.pointerId);
  if (pressed && measuring) addMeasured(toPlace(...pressed.at));
  else if (pressed) select(receptionAt(...pressed.at, pressed.touch ? 22 : 10));
  pressed = null;
});
canvas.addEventListener("pointercancel", (event) => { pointers.delete(event.pointerId); pressed = null; });
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.exp(-0.0015 * event.deltaY), event.offsetX, event.offsetY);
}, { passive: false });
// Moves the map by shares of its size.
function pan(right, up) {
  view.east += (right * view.width) / view.scale; view.north += (up * view.height) / view.scale; view.moved = true;
  redraw();
}
byId("zoom-in").addEventListener("click", () => zoom(1.5));
byId("zoom-out").addEventListener("click", () => zoom(1 / 1.5));
byId("zoom-fit").addEventListener("click", () => { fit(); redraw(); });

// ---------------------------------------------------------------- what is shown

const LAYERS = [
  ["tiles", "map", `<path d="M1 3l9-2 10 3 9-2v11l-9 2-10-3-9 2z" fill="#cfe8cf" stroke="#555"/>`, () => hasTiles],
  ["levels", "map of the level", `<rect width="30" height="16" fill="#21918c"/><path d="M15 0h15v16H20z" fill="#b8b021"/>`, () => data.searches.some((s) => s.level_map)],
  ["searched", "searched, nothing heard", `<rect width="30" height="16" fill="#5b7c99" opacity=".7"/><path d="M0 0h9v16H0z" fill="#5b7c99"/>`, () => data.searched],
  ["heat", "heat map of the belief", `<circle cx="15" cy="8" r="7.5" fill="#d55e00" opacity=".25"/><circle cx="15" cy="8" r="5" fill="#d55e00" opacity=".4"/><circle cx="15" cy="8" r="2.5" fill="#d55e00"/>`,
    () => data.searches.some((s) => s.beliefs.some((b) => b.cloud || b.ellipse))],
  ["paths", "receivers and paths", `<circle cx="8" cy="8" r="6" fill="#0072b2"/><path d="M14 8h16" stroke="#0072b2" stroke-width="2"/>`, () => true],
  ["places", "receptions", `<circle cx="9" cy="8" r="4" fill="#0072b2"/><circle cx="21" cy="8" r="4" fill="#009e73"/>`, () => true],
  ["bearings", "bearings", `<path d="M0 8h30" stroke="#0072b2" stroke-width="2.5"/>`, () => hasBearings],
  ["wedges", "± σ of the latest", `<path d="M0 8L30 0V16z" fill="#0072b2" opacity=".35"/>`, () => hasBearings],
  ["rivals", "rival directions", `<path d="M0 8h30" stroke="#0072b2" stroke-width="2" stroke-dasharray="2 4"/>`, () => received.some((one) => one.modes)],
  ["estimates", "estimates", `<path d="M15 1v14M8 8h14" stroke="#d55e00" stroke-width="3"/>`, () => data.searches.length],
  ["smoothed", "smoothed track", `<path d="M1 12Q8 2 15 8T29 4" fill="none" stroke="#d55e00" stroke-width="2.5"/><circle cx="15" cy="8" r="3.5" fill="#d55e00"/>`,
    () => data.searches.some((s) => s.smoothed)],
  ["ellipse", "95 % ellipse", `<ellipse cx="15" cy="8" rx="13" ry="6" fill="none" stroke="#d55e00" stroke-width="2.5"/>`, () => data.searches.length],
  ["conformal", "95 % by your own recordings", `<ellipse cx="15" cy="8" rx="13" ry="6" fill="none" stroke="#d55e00" stroke-width="2" stroke-dasharray="5 3"/>`,
    () => data.searches.some((s) => s.conformal)],
  ["regions", "95 % region", `<path d="M2 12Q8-6 15 6T28 4L26 14z" fill="#d55e00" opacity=".35"/>`, () => data.searches.some((s) => s.regions.length)],
  ["cloud", "belief", `<g fill="#d55e00" opacity=".6"><rect x="6" y="4" width="3" height="3"/><rect x="12" y="9" width="3" height="3"/><rect x="17" y="5" width="3" height="3"/><rect x="22" y="10" width="3" height="3"/></g>`,
    () => data.searches.some((s) => s.beliefs.some((b) => b.cloud))],
  ["rings", "range rings", `<g fill="none" stroke="currentColor"><circle cx="15" cy="8" r="7"/><circle cx="15" cy="8" r="3.5"/></g>`, () => data.searches.length || received.length],
  ["truth", "truth", `<path fill="currentColor" d="M15 1l2 5h5l-4 3 2 6-5-4-5 4 2-6-4-3h5z"/>`, () => data.searches.some((s) => s.truth.length)],
];
// Boxes for what there is; what comes later gets its box then.
function showLayers() {
  for (const layer of LAYERS) if (!(layer[0] in state.layers) && layer[3]()) showLayer(layer);
}
// Layers that are there on request: the heat map shows what the belief's places do.
const ON_REQUEST = ["cloud", "levels", "rings"];
function showLayer([name, text, icon]) {
  state.layers[name] = !ON_REQUEST.includes(name);
  const box = element("input", { type: "checkbox", id: `layer-${name}` });
  box.checked = state.layers[name];
  box.addEventListener("change", () => { state.layers[name] = box.checked; showLegend(); redraw(); });
  const picture = drawn("svg", { viewBox: "0 0 30 16", "aria-hidden": "true" });
  picture.innerHTML = icon; // a constant of this file
  const made = element("label", {}, box, picture, text), order = LAYERS.findIndex((layer) => layer[0] === name);
  made.dataset.order = String(order);
  const after = [...byId("layers").querySelectorAll("label")].find((other) => Number(other.dataset.order) > order);
  byId("layers").insertBefore(made, after || null);
}
showLayers();

// ---------------------------------------------------------------- the drones' health

// Share of a battery below which it is said to be low.
const LOW_BATTERY = 0.25;

let shownHealth = "";
function showHealth() {
  const receivers = data.receivers.filter((receiver) => receiver.health?.length);
  const said = receivers.map((receiver) => {
    const known = receiver.health.findLast((entry) => entry[0] <= state.time);
    if (!known) return [`${receiver.name}: no messages yet`, false];
    const [, battery, linked, sigma, height] = known, isLow = battery !== null && battery < LOW_BATTERY;
    const parts = [
      battery === null ? "battery not reported" : `${isLow ? "⚠ " : ""}battery ${Math.round(100 * battery)} %`,
      linked ? "link ok" : "⚠ no messages",
      sigma === null ? "place not known" : `± ${sigma.toFixed(1)} m`,
      // The autopilot's own height above the ground, where it has one.
      height ? `${height[0].toFixed(1)} m above ground (${height[1]})` : null,
    ];
    return [`${receiver.name}: ${parts.filter(Boolean).join(", ")}`, isLow || !linked];
  });
  const key = said.join();
  if (key === shownHealth) return;
  shownHealth = key;
  byId("drones-section").hidden = !said.length;
  byId("drones").replaceChildren(...said.map(([text, isBad]) => element("li", isBad ? { class: "bad" } : {}, text)));
}

// ---------------------------------------------------------------- the table of fixes

function showFixes() {
  const known = data.searches.some((search) => search.truth.length);
  const head = ["beacon", "place", "95 % ellipse", known ? "error" : null];
  // On Earth, and below from the origin.
  const placed = (place) => (earth ? element("span", {}, onEarth(place), " ", element("span", { class: "outcome" }, directed(place))) : directed(place));
  const rows = data.searches.map((search, index) => {
    const belief = beliefAt(search, state.time);
    const swatch = element("span", { class: "swatch", style: `border-color:${searchColour(index)}` });
    const isLast = belief === search.beliefs[search.beliefs.length - 1];
    const ended = isLast ? search.outcome || (data.live ? "searching" : "") : "searching";
    // Below the name, where a column of its own would be cut off.
    const own = search.conformal && belief && belief.ellipse;
    const scaled = own ? `95 % by your own recordings (n = ${search.conformal[0]}): ${own.slice(0, 2).map((axis) => fixed(axis * search.conformal[1], 2)).join(" × ")} m` : "";
    const outcome = element("span", { class: "outcome" }, belief ? [ended, `${belief.steps} used`, scaled].filter(Boolean).join(", ") : search.failure || "not yet");
    const name = element("span", {}, swatch, search.name, " ", outcome);
    if (!belief) return [name, "–", "–", "–"];
    return [
      name, placed(belief.place),
      belief.ellipse ? `${fixed(belief.ellipse[0], 2)} × ${fixed(belief.ellipse[1], 2)} m` : "–", `${fixed(belief.error ?? NaN, 2)} m`,
    ];
  });
  filled(byId("fixes"), head, rows);
  showCoordinates();
}

// ---------------------------------------------------------------- remarks, and the rows that fit worst

const WORST = 8;
const whose = (search) => (data.searches.length > 1 ? `${search.name}: ` : "");

function showDoubts() {
  const item = ([code, text], before) => element("li", {}, before + text + " ", element("code", {}, code));
  const items = data.searches.flatMap((search) => (search.remarks || []).map((remark) => item(remark, whose(search))));
  items.push(...(data.remarks || []).map((remark) => item(remark, "")));
  const stale = data.searches.some((search) => search.remarksOfAll);
  if (stale && items.length) items.push(element("li", { class: "note" }, "The remarks are those before anything was struck out; the program makes new ones."));
  byId("doubts").hidden = !items.length;
  byId("doubt-list").replaceChildren(...items);
}

function rowsTable(rows) {
  const several = data.searches.length > 1, named = rows.some((one) => one.receiver), some = rows.some((one) => one.left_out);
  const cells = (one) => [
    `${one.file}, line ${one.line}`, one.beacon, one.receiver || "", one.kind.replace("-", " "),
    `${one.residual > 0 ? "+" : ""}${fixed(one.residual, 1)}${one.unit === "deg" ? "°" : " " + one.unit}`,
    one.p === undefined ? "–" : one.p < 0.001 ? one.p.toExponential(0) : fixed(one.p, 3), one.left_out ? "left out" : "used",
  ];
  const head = ["row", several ? "beacon" : null, named ? "receiver" : null, "measured", "residual", "p", some ? "estimate" : null];
  return element("div", { class: "wide" }, filled(element("table"), head, rows.map(cells)));
}

function showRows() {
  const rows = data.searches.flatMap((search) => (search.rows || []).map((one) => ({ ...one, beacon: search.name })));
  const p = (one) => one.p ?? Infinity;
  rows.sort((a, b) => (p(a) < p(b) ? -1 : p(a) > p(b) ? 1 : Math.abs(b.residual) - Math.abs(a.residual)));
  const parts = rows.length ? [rowsTable(rows.slice(0, WORST))] : [];
  if (rows.length > WORST) {
    const total = data.searches.reduce((sum, search) => sum + (search.of_rows || (search.rows || []).length), 0);
    const text = total > rows.length ? `The worst ${rows.length} of ${total} measurements` : `All ${total} measurements`;
    const fold = element("details", {}, element("summary", {}, text));
    // Thousands of rows are made when they are wanted.
    fold.addEventListener("toggle", () => {
      if (fold.open && fold.children.length < 2) fold.append(element("div", { class: "all", tabindex: "0", role: "region", "aria-label": text }, rowsTable(rows)));
    });
    parts.push(fold);
  }
  byId("rows").hidden = !parts.length;
  byId("rows-body").replaceChildren(...parts);
}

// ---------------------------------------------------------------- one reception and its turn

function polar(one) {
  const size = 260, centre = size / 2, radius = 104;
  const svg = drawn("svg", { viewBox: `0 0 ${size} ${size}`, role: "img", "aria-label": "Polar plot of the turn" });
  const turn = one.turn && { samples: unpack(one.turn.samples), smoothed: unpack(one.turn.smoothed), fitted: unpack(one.turn.fitted) };
  let top = -Infinity, bottom = Infinity;
  if (turn) {
    for (const points of [turn.samples, turn.smoothed]) {
      for (let i = 1; i < points.length; i += 2) { top = Math.max(top, points[i]); bottom = Math.min(bottom, points[i]); }
    }
  }
  if (top < bottom) [bottom, top] = [-10, 0];
  const step = nice(Math.max(top - bottom, 4) / 4);
  bottom -= Math.max(0.15 * (top - bottom), 1);
  const at = (angle, share) => [centre + radius * share * Math.cos(angle), centre - radius * share * Math.sin(angle)];
  const share = (level) => Math.min(Math.max((level - bottom) / (top - bottom), 0), 1);
  svg.append(drawn("circle", { cx: centre, cy: centre, r: radius, fill: "none", stroke: look.faint }));
  for (let level = Math.ceil(bottom / step) * step; level <= top && turn; level += step) {
    svg.append(drawn("circle", { cx: centre, cy: centre, r: radius * share(level), fill: "none", stroke: look.grid }));
    svg.append(drawn("text", { x: centre + 3, y: centre - radius * share(level) + 11, "font-size": 10, fill: look.faint }, `${+level.toFixed(6)}`));
  }
  for (const [text, angle] of [["N", TAU / 4], ["E", 0], ["S", -TAU / 4], ["W", TAU / 2]]) {
    const [px, py] = at(angle, 1.13);
    svg.append(drawn("text", { x: px, y: py + 5, "text-anchor": "middle", "font-size": 14, "font-weight": 600, fill: look.ink }, text));
  }
  const sector = (angle, sigma, colour) => {
    const reach = Math.min(sigma, Math.PI * 0.999), [ax, ay] = at(angle - reach, 1), [bx, by] = at(angle + reach, 1);
    svg.append(drawn("path", {
      d: `M${centre} ${centre}L${ax} ${ay}A${radius} ${radius} 0 ${reach > Math.PI / 2 ? 1 : 0} 0 ${bx} ${by}Z`, fill: colour, opacity: 0.22,
    }));
  };
  const line = (angle, attributes) => {
    const [px, py] = at(angle, 1);
    svg.append(drawn("path", { d: `M${centre} ${centre}L${px} ${py}`, fill: "none", ...attributes }));
  };
  const colour = receiverColour(one.receiver);
  if (one.bearing) sector(one.bearing[0], one.bearing[1], colour);
  if (turn) {
    const curve = (points) => {
      let text = "";
      for (let i = 0; i < points.length; i += 2) {
        const [px, py] = at(points[i], share(points[i + 1]));
        text += `${i ? "L" : "M"}${px.toFixed(1)} ${py.toFixed(1)}`;
      }
      return text && `${text}Z`;
    };
    let dots = "";
    for (let i = 0; i < turn.samples.length; i += 2) {
      const [px, py] = at(turn.samples[i], share(turn.samples[i + 1]));
      dots += `M${px.toFixed(1)} ${py.toFixed(1)}h0`;
    }
    svg.append(drawn("path", { d: dots, stroke: look.faint, "stroke-width": 2.5, "stroke-linecap": "round", class: "samples" }));
    svg.append(drawn("path", { d: curve(turn.smoothed), fill: "none", stroke: look.receivers[0], "stroke-width": 2.5, class: "smoothed" }));
    svg.append(drawn("path", { d: curve(turn.fitted), fill: "none", stroke: look.searches[0], "stroke-width": 2, "stroke-dasharray": "5 3", class: "fitted" }));
  }
  for (const mode of one.modes || []) line(mode[1], { stroke: colour, "stroke-width": 2, "stroke-dasharray": "2 4" });
  if (one.bearing) line(one.bearing[0], { stroke: colour, "stroke-width": 3.5, class: "bearing" });
  const truth = one.search !== null && data.searches[one.search] && data.searches[one.search].truth;
  if (truth && truth.length) {
    const there = placeAt(truth, truth.map((knot) => knot[0]), one.time) || [truth[0][1], truth[0][2]];
    const angle = Math.atan2(there[1] - one.place[1], there[0] - one.place[0]);
    const [ax, ay] = at(angle, 0.97), [bx, by] = at(angle, 1.07);
    svg.append(drawn("path", { d: `M${ax} ${ay}L${bx} ${by}`, stroke: look.ink, "stroke-width": 5, class: "true" }));
  }
  return svg;
}

let shownTurn;
function showTurn() {
  // What was chosen, or else the last one.
  const index = state.selected ?? countUntil(receivedTimes, state.time) - 1;
  if (index === shownTurn) return;
  shownTurn = index;
  const one = received[index], body = byId("turn-body");
  byId("turn-head").textContent = one ? `Reception ${index + 1} of ${received.length}${state.selected === null ? ", the latest" : ", chosen"}` : "Reception";
  if (!one) { body.replaceChildren(element("p", { class: "remark" }, "Nothing received yet.")); return; }
  const rows = [["receiver", data.receivers[one.receiver]?.name ?? String(one.receiver + 1)], ["time", clockText(one.time)]];
  if (one.search !== null && data.searches[one.search]) rows.push(["beacon", data.searches[one.search].name]);
  rows.push(["place", `${directed(one.place)}, ${metres(one.place[2])} up`]);
  if (one.level) rows.push(["level", `${fixed(one.level[0], 1)} ± ${fixed(one.level[1], 1)} ${levelUnit}`]);
  if (one.bearing) {
    rows.push(["bearing", `${fixed(compass(one.bearing[0]), 1)}° compass`], ["σ", degrees(one.bearing[1])], ["confidence", fixed(one.bearing[2], 2)]);
  }
  for (const mode of one.modes || []) rows.push(["rival", `${fixed(compass(mode[1]), 0)}° ± ${degrees(mode[2])}, weight ${fixed(mode[0], 2)}`]);
  if (one.nis) rows.push(["NIS", `${fixed(one.nis[0], 2)}, ${one.nis[1]} degrees of freedom`]);
  if (data.searches.length) rows.push(["used", one.struck ? "struck out" : one.used ? "yes" : "no"]);
  if (one.remark) rows.push(["remark", one.remark]);
  const list = element("dl", {});
  for (const [term, text] of rows) list.append(element("dt", {}, term), element("dd", {}, text));
  const side = element("div", {}, list, ...strikeButton(one));
  side.append(element("p", { class: "remark" }, one.turn
    ? `Grey: samples in ${levelUnit}. Blue: mean over seven positions. Orange, dashed: the antenna, where it is known. Line and sector: bearing ± σ. Thick tick: the truth.`
    : hasBearings ? "No samples of its turn were kept." : ""));
  body.replaceChildren(...(one.turn || one.bearing ? [polar(one)] : []), side);
}

function select(index) {
  state.selected = index;
  shownTurn = undefined;
  redraw();
}

// ---------------------------------------------------------------- plots over time

const charts = [];

function renewCharts() {
  for (const { plot } of charts.splice(0)) plot.destroy();
  byId("charts").replaceChildren();
  makeCharts();
}

// What is of one moment, such as the turns of several drones, stands a millisecond apart.
function apart(times) {
  let before = -Infinity;
  return times.map((time) => { before = Math.max(time, before + 1e-3); return before; });
}

// Several [times, values] on one axis of times, gaps as undefined.
const joined = (series) => uPlot.join(series.map(([times, values]) => [apart(times), values]));

function addChart(title, series, options) {
  const box = element("div", { class: "chart" });
  byId("charts").append(element("h2", {}, title), box);
  const table = joined(series.map((one) => one.data));
  const width = () => Math.max(box.clientWidth, 200);
  const plot = new uPlot({
    width: width(), height: 190, cursor: { drag: { x: true, y: false } }, legend: { live: false },
    scales: { x: { time: false, range: (_, low, high) => (low === high ? [low - 1, high + 1] : [low, high]) }, y: options.scale },
    axes: [
      { values: (_, ticks) => ticks.map((tick) => fixed(tick - (begin > 1e6 ? begin : 0), 0)), stroke: look.ink, grid: { stroke: look.grid, width: 1 }, size: 34 },
      { stroke: look.ink, grid: { stroke: look.grid, width: 1 }, size: 52, ...options.axis },
    ],
    bands: options.bands,
    series: [{ label: "time" }, ...series.map((one) => ({ spanGaps: true, ...one.style }))],
  }, table, box);
  const now = element("div", { class: "now" });
  plot.over.append(now);
  plot.over.addEventListener("click", (event) => {
    if (plot.select.width > 2) return;
    setTime(plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x"));
  });
  charts.push({ plot, now, width });
}

// Lines of a logarithmic axis: 1, 2 and 5 times the powers of ten over up to two decades, and the powers alone beyond.
function logSteps(low, high) {
  const steps = [], times = high / low > 100 ? [1] : [1, 2, 5];
  for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power += 1) steps.push(...times.map((one) => one * 10 ** power));
  return steps.filter((step) => step >= low * 0.999 && step <= high * 1.001);
}

// A logarithmic scale that ends where its data do.
const LOG_SCALE = { distr: 3, range: (_, low, high) => (low > 0 ? [low / 1.25, high * 1.25] : [0.1, 10]) };

function positive(values, least) {
  return values.map((value) => (value === null || value === undefined ? null : Math.max(value, least)));
}

function makeCharts() {
  const several = data.searches.filter((search) => search.beliefs.length > 1);
  if (!several.length) return;
  const sizes = [];
  several.forEach((search) => {
    const index = data.searches.indexOf(search), stroke = searchColour(index);
    const times = search.times, semiAxis = (i) => positive(search.beliefs.map((b) => b.ellipse && b.ellipse[i]), 1e-3);
    if (search.truth.length) {
      sizes.push({ data: [times, positive(search.beliefs.map((b) => b.error), 1e-3)], style: { label: `${search.name}: error`, stroke, width: 2.5 } });
    }
    sizes.push({ data: [times, semiAxis(0)], style: { label: "semi-major", points: { show: false }, stroke, width: 2, dash: [7, 4] } });
    sizes.push({ data: [times, semiAxis(1)], style: { label: "semi-minor", points: { show: false }, stroke, width: 1.5, dash: [2, 3] } });
  });
  const plain = (_, ticks) => ticks.map((tick) => (tick === null || tick === undefined ? "" : String(+tick.toPrecision(3))));
  const axis = { values: plain, splits: (_, __, low, high) => logSteps(low, high), filter: (_, splits) => splits };
  addChart(`${sizes.some(({ style }) => style.label.endsWith("error")) ? "Error and 95 % semi-axes" : "95 % semi-axes"} in m, over s`, sizes, { scale: LOG_SCALE, axis });
  const tested = received.filter((one) => one.nis && one.nis[1] > 0);
  if (!tested.length) return;
  const least = 1e-2, times = tested.map((one) => one.time);
  const limit = (i) => tested.map((one) => Math.max((data.nis_95[one.nis[1] - 1] || data.nis_95[1])[i], least));
  const points = data.searches.map((search, index) => {
    const own = tested.filter((one) => one.search === index);
    return {
      data: [own.map((one) => one.time), positive(own.map((one) => one.nis[0]), least)],
      style: { label: search.name, stroke: "transparent", width: 0, points: { show: true, size: 7, stroke: searchColour(index), fill: look.paper, width: 2 } },
    };
  }).filter((one) => one.data[0].length);
  const edge = { stroke: "#009e73", width: 1.5, points: { show: false } };
  addChart("NIS with its 95 % band, over s", [
    { data: [times, limit(1)], style: { label: "χ² 97.5 %", ...edge } }, { data: [times, limit(0)], style: { label: "2.5 %", ...edge } }, ...points,
  ], { scale: LOG_SCALE, axis, bands: [{ series: [1, 2], fill: "#009e7326" }] });
}

function markCharts() {
  for (const { plot, now } of charts) {
    const left = plot.valToPos(state.time, "x");
    now.style.transform = `translateX(${Math.min(Math.max(left, -9), plot.over.clientWidth + 9) - 1}px)`;
  }
}

// ---------------------------------------------------------------- events

let events = [], listed = [], listedTimes = [], currentEvent;
function listEvents() {
  if (events.length !== data.notices.length) {
    events = data.notices.map(([time, text, important]) => ({ time, text, important })).sort((a, b) => a.time - b.time);
  }
  byId("events").hidden = !events.length;
  listed = events.filter((event) => event.important || byId("all-events").checked);
  listedTimes = listed.map((event) => event.time);
  const items = listed.map((event) => {
    event.button = element("button", { type: "button" }, element("span", {}, clockText(event.time)), element("span", {}, event.text));
    event.button.addEventListener("click", () => setTime(event.time));
    return element("li", {}, event.button);
  });
  byId("event-list").replaceChildren(...items);
  currentEvent = undefined;
  markEvents();
}
function markEvents() {
  const count = countUntil(listedTimes, state.time);
  if (count === currentEvent) return;
  currentEvent = count;
  listed.forEach((event, index) => {
    event.button.className = index === count - 1 ? "current" : index >= count ? "later" : "";
  });
  const list = byId("event-list"), button = count > 0 && listed[count - 1].button;
  // The list alone scrolls, never the page.
  if (button) list.scrollTop = Math.max(button.offsetTop - list.clientHeight / 2, 0);
}
byId("all-events").addEventListener("change", listEvents);

// ---------------------------------------------------------------- time

const slider = byId("time");
let shownBeliefs = "";
function redraw() { if (!state.frame) state.frame = requestAnimationFrame(frame); }

function frame(now) {
  state.frame = 0;
  if (state.playing) {
    const passed = Math.min((now - (state.before ?? now)) / 1000, 0.25);
    state.before = now;
    state.time = Math.min(state.time + passed * state.speed, end);
    if (state.time >= end) play(false); else redraw();
  }
  drawMap(); showTurn(); markCharts(); markEvents(); showHealth();
  const beliefs = data.searches.map((search) => countUntil(search.times, state.time)).join();
  if (beliefs !== shownBeliefs) { shownBeliefs = beliefs; showFixes(); }
  slider.value = String(Math.round((1000 * (state.time - begin)) / duration));
  slider.setAttribute("aria-valuetext", clockText(state.time));
  byId("clock").textContent = clockText(state.time);
}

function setTime(time) {
  state.time = Math.min(Math.max(time, begin), end);
  state.selected = null;
  redraw();
}

function play(on) {
  if (on && state.time >= end) state.time = begin;
  if (on) state.selected = null;
  state.playing = on; state.before = undefined;
  byId("play").textContent = on ? "❚❚" : "▶";
  byId("play").setAttribute("aria-label", on ? "Pause" : "Play");
  redraw();
}

function step(by) {
  play(false);
  // Receptions of one moment are one step apart each.
  const index = state.selected ?? countUntil(receivedTimes, state.time) - 1;
  const next = Math.min(Math.max(index + by, 0), received.length - 1);
  if (!received[next]) return;
  state.time = received[next].time;
  select(next);
}

// How fast it plays; all of it in half a minute where nothing else is chosen.
function offerSpeeds() {
  const chosen = byId("speed").value || "all";
  const speeds = [1, 2, 5, 10, 20, 50, 100].filter((speed) => duration / speed > 4).map(String);
  if (byId("speed").length !== speeds.length + 1) {
    byId("speed").replaceChildren(element("option", { value: "all" }, "all in 30 s"),
      ...speeds.map((speed) => element("option", { value: speed }, `${speed} ×`)));
    byId("speed").value = speeds.includes(chosen) ? chosen : "all";
  }
  state.speed = byId("speed").value === "all" ? duration / 30 : Number(byId("speed").value);
}
byId("speed").addEventListener("change", offerSpeeds);
byId("play").addEventListener("click", () => play(!state.playing));
byId("before").addEventListener("click", () => step(-1));
byId("after").addEventListener("click", () => step(1));
slider.addEventListener("input", () => { play(false); setTime(begin + (Number(slider.value) / 1000) * duration); });
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  const inField = event.target instanceof Element && event.target.matches("input, select, button, summary, a");
  const key = event.key;
  // Fields keep the keys that are theirs.
  if (inField && [" ", "Enter", "ArrowLeft", "ArrowRight", "Home", "End"].includes(key)) return;
  const ways = { ArrowLeft: [-0.15, 0], ArrowRight: [0.15, 0], ArrowUp: [0, 0.15], ArrowDown: [0, -0.15] };
  const act = event.shiftKey && ways[key] ? () => pan(...ways[key]) : {
    " ": () => play(!state.playing), ArrowLeft: () => step(-1), ArrowRight: () => step(1), Home: () => setTime(begin), End: () => setTime(end),
    "+": () => zoom(1.5), "=": () => zoom(1.5), "-": () => zoom(1 / 1.5), "0": () => { fit(); redraw(); }, Escape: () => (measuring ? measure(false) : select(null)), m: () => measure(!measuring), M: () => measure(!measuring),
    x: strikeSelected, X: strikeSelected, Delete: strikeSelected,
  }[key];
  if (!act) return;
  event.preventDefault();
  act();
});

// ---------------------------------------------------------------- begin

function showHeads() {
  document.title = `${data.title} – foxhunt`;
  byId("title").textContent = data.title;
  byId("subtitle").textContent = [
    data.method, data.seed !== null ? `seed ${data.seed}` : null,
    data.epoch !== null ? new Date((data.epoch + begin) * 1000).toISOString().slice(0, 16).replace("T", " ") + " UTC" : null,
    `${received.length} receptions in ${fixed(duration, 0)} s`, data.every > 1 ? `every ${data.every}th of the receptions is shown` : null,
  ].filter(Boolean).join(" · ");
  byId("fixes").closest("section").hidden = !data.searches.length;
  showSearched();
}

// Shows everything anew after the data have changed.
function refresh() {
  survey(); findExtent(); showHeads(); showDoubts(); showRows(); showLayers(); showLegend(); offerSpeeds(); listEvents(); renewCharts();
  if (!view.moved) fit();
  shownTurn = undefined; shownBeliefs = "";
  redraw();
}

// Dark, or black, white and thick for a phone in the sun, which is dark again afterwards.
let wantsDark = false;
function setLook(dark, contrast) {
  wantsDark = dark;
  Object.assign(state, { dark: dark && !contrast, contrast });
  look = contrast ? IN_THE_SUN : dark ? AT_NIGHT : SHEET;
  const classes = document.documentElement.classList;
  classes.add("ready");
  classes.toggle("dark", state.dark);
  classes.toggle("contrast", contrast);
  byId("dark").setAttribute("aria-pressed", String(state.dark));
  byId("contrast").setAttribute("aria-pressed", String(contrast));
  shownBeliefs = ""; shownTurn = undefined;
  forgetHeat();
  renewCharts();
  showLegend();
  redraw();
}
const wished = { dark: window.matchMedia("(prefers-color-scheme: dark)"), contrast: window.matchMedia("(prefers-contrast: more)") };
const asWished = () => setLook(wished.dark.matches, wished.contrast.matches);
for (const wish of Object.values(wished)) wish.addEventListener("change", asWished);
byId("dark").addEventListener("click", () => setLook(!state.dark, false));
byId("contrast").addEventListener("click", () => setLook(wantsDark, !state.contrast));
// Paper is white.
let beforePrint = null;
window.addEventListener("beforeprint", () => {
  if (!state.dark) return;
  beforePrint = [wantsDark, state.contrast];
  setLook(false, state.contrast);
  drawMap(); showTurn();
});
window.addEventListener("afterprint", () => { if (beforePrint) setLook(...beforePrint); beforePrint = null; });

showHeads();
showDoubts();
showRows();
offerSpeeds();
listEvents();
new ResizeObserver(() => {
  resizeMap();
  for (const { plot, width } of charts) plot.setSize({ width: width(), height: 190 });
  redraw();
}).observe(document.body);
// Waits for the scripts behind this one.
queueMicrotask(() => { resizeMap(); asWished(); });
// For tests, and for those who open the console.
window.foxhunt = { data, state, view, received, select, setTime, at: (place) => [x(place[0]), y(place[1])], onEarth };
