// ---------------------------------------------------------------- a place for other programs: geo:, UTM, MGRS, QR

// Zone, band letter, East and North in metres by Krüger's series (Karney 2011, eq. 35 of order n⁴); null near the poles.
function utm([lat, lon]) {
  if (!(lat >= -80 && lat <= 84)) return null;
  let zone = (Math.floor((lon + 180) / 6) % 60 + 60) % 60 + 1;
  // Wider zones in the South-West of Norway and on Svalbard.
  if (lat >= 56 && lat < 64 && lon >= 3 && lon < 12) zone = 32;
  if (lat >= 72 && lon >= 0 && lon < 42) zone = 31 + 2 * Math.floor((lon + 3) / 12);
  const band = "CDEFGHJKLMNPQRSTUVWXX"[Math.floor(lat / 8 + 10)];
  const a = 6378137, f = 1 / 298.257223563, n = f / (2 - f), e = Math.sqrt(f * (2 - f)), rad = Math.PI / 180;
  const radius = (0.9996 * a * (1 + n ** 2 / 4 + n ** 4 / 64)) / (1 + n);
  const series = [
    n / 2 - (2 * n ** 2) / 3 + (5 * n ** 3) / 16 + (41 * n ** 4) / 180, (13 * n ** 2) / 48 - (3 * n ** 3) / 5 + (557 * n ** 4) / 1440,
    (61 * n ** 3) / 240 - (103 * n ** 4) / 140, (49561 * n ** 4) / 161280,
  ];
  const sin = Math.sin(lat * rad), east = (lon - (6 * zone - 183)) * rad;
  const t = Math.sinh(Math.atanh(sin) - e * Math.atanh(e * sin)), xi = Math.atan2(t, Math.cos(east)), eta = Math.asinh(Math.sin(east) / Math.hypot(t, Math.cos(east)));
  const sum = (of) => series.reduce((all, factor, i) => all + factor * of(2 * (i + 1)), 0);
  return {
    zone, band, east: 500000 + radius * (eta + sum((k) => Math.cos(k * xi) * Math.sinh(k * eta))),
    north: (lat < 0 ? 1e7 : 0) + radius * (xi + sum((k) => Math.sin(k * xi) * Math.cosh(k * eta))),
  };
}

const utmText = (at) => (at ? `${at.zone}${at.band} ${at.east.toFixed(0)} ${at.north.toFixed(0)}` : null);

// Square of 100 km and five digits each, which are cut off and not rounded.
function mgrsText(at) {
  if (!at) return null;
  const column = ["STUVWXYZ", "ABCDEFGH", "JKLMNPQR"][at.zone % 3][Math.floor(at.east / 1e5) - 1];
  const row = "ABCDEFGHJKLMNPQRSTUV"[(Math.floor(at.north / 1e5) + (at.zone % 2 ? 0 : 5)) % 20];
  const digits = (value) => String(Math.floor(value % 1e5)).padStart(5, "0");
  return `${at.zone}${at.band} ${column}${row} ${digits(at.east)} ${digits(at.north)}`;
}

// RFC 5870, with the longer 95 % semi-axis as the uncertainty.
function geoText([lat, lon], ellipse) {
  const metres = ellipse && ellipse[0] < 99999.5 ? `;u=${Math.ceil(ellipse[0])}` : "";
  return `geo:${lat.toFixed(6)},${lon.toFixed(6)}${metres}`;
}

// A QR code of version 3 with error correction M (ISO/IEC 18004): 42 bytes at most, 29 modules a side.
const QR = { size: 29, data: 44, checks: 26, most: 42 };

// A product in the field of 256 elements.
function product(a, b) {
  let sum = 0;
  for (let i = 7; i >= 0; i -= 1) { sum = (sum << 1) ^ ((sum >>> 7) * 0x11d); sum ^= ((b >>> i) & 1) * a; }
  return sum;
}

// The bytes with their check bytes (Reed and Solomon).
function checked(bytes) {
  const divisor = new Array(QR.checks).fill(0), rest = new Array(QR.checks).fill(0);
  divisor[QR.checks - 1] = 1;
  for (let i = 0, root = 1; i < QR.checks; i += 1, root = product(root, 2)) {
    for (let j = 0; j < QR.checks; j += 1) divisor[j] = product(divisor[j], root) ^ (divisor[j + 1] ?? 0);
  }
  for (const byte of bytes) {
    const factor = byte ^ rest.shift();
    rest.push(0);
    divisor.forEach((value, i) => { rest[i] ^= product(value, factor); });
  }
  return [...bytes, ...rest];
}

// Rows of dark modules; null for a text that is too long.
function qr(text) {
  const bytes = [...new TextEncoder().encode(text)], { size } = QR;
  if (bytes.length > QR.most) return null;
  const bits = [4, bytes.length, ...bytes].flatMap((value, i) => [...value.toString(2).padStart(i ? 8 : 4, "0")]).concat(["0", "0", "0", "0"]).join("");
  const words = bits.match(/.{8}/g).map((word) => parseInt(word, 2));
  while (words.length < QR.data) words.push(words.length % 2 === (bytes.length + 2) % 2 ? 0xec : 0x11);
  const dark = Array.from({ length: size }, () => new Array(size).fill(false)), fixed = Array.from({ length: size }, () => new Array(size).fill(false));
  const set = (column, line, on) => { if (column >= 0 && line >= 0 && column < size && line < size) { dark[line][column] = on; fixed[line][column] = true; } };
  const square = (column, line, reach, isDark) => {
    for (let dy = -reach; dy <= reach; dy += 1) for (let dx = -reach; dx <= reach; dx += 1) set(column + dx, line + dy, isDark(Math.max(Math.abs(dx), Math.abs(dy))));
  };
  for (let i = 0; i < size; i += 1) { set(6, i, i % 2 === 0); set(i, 6, i % 2 === 0); }
  for (const [column, line] of [[3, 3], [size - 4, 3], [3, size - 4]]) square(column, line, 4, (away) => away !== 2 && away !== 4);
  square(size - 7, size - 7, 2, (away) => away !== 1);
  const format = (mask) => {
    let rest = mask;
    for (let i = 0; i < 10; i += 1) rest = (rest << 1) ^ ((rest >>> 9) * 0x537);
    const value = ((mask << 10) | rest) ^ 0x5412, bit = (i) => ((value >>> i) & 1) === 1;
    for (let i = 0; i < 6; i += 1) { set(8, i, bit(i)); set(5 - i, 8, bit(i + 9)); }
    set(8, 7, bit(6)); set(8, 8, bit(7)); set(7, 8, bit(8));
    for (let i = 0; i < 8; i += 1) set(size - 1 - i, 8, bit(i));
    for (let i = 8; i < 15; i += 1) set(8, size - 15 + i, bit(i));
    set(8, size - 8, true);
  };
  format(0);
  const all = checked(words), free = [];
  for (let right = size - 1; right >= 1; right -= 2) {
    if (right === 6) right = 5;
    for (let step = 0; step < size; step += 1) {
      for (const column of [right, right - 1]) {
        const line = ((right + 1) & 2) === 0 ? size - 1 - step : step;
        if (!fixed[line][column]) free.push([column, line]);
      }
    }
  }
  const masks = [
    (c, l) => (c + l) % 2, (_, l) => l % 2, (c) => c % 3, (c, l) => (c + l) % 3, (c, l) => (Math.floor(c / 3) + Math.floor(l / 2)) % 2,
    (c, l) => ((c * l) % 2) + ((c * l) % 3), (c, l) => (((c * l) % 2) + ((c * l) % 3)) % 2, (c, l) => (((c + l) % 2) + ((c * l) % 3)) % 2,
  ];
  const masked = (mask) => {
    free.forEach(([column, line], i) => {
      const bit = i < 8 * all.length && ((all[i >>> 3] >>> (7 - (i & 7))) & 1) === 1;
      dark[line][column] = bit !== (masks[mask](column, line) === 0);
    });
    format(mask);
    return dark.map((line) => [...line]);
  };
  // Long runs, blocks and an excess of either are harder to read.
  const cost = (rows) => {
    let sum = 0, count = 0;
    const lines = [...rows, ...rows.map((_, i) => rows.map((line) => line[i]))];
    for (const line of lines) for (const run of line.map(Number).join("").match(/0{5,}|1{5,}/g) || []) sum += run.length - 2;
    for (let l = 1; l < size; l += 1) for (let c = 1; c < size; c += 1) sum += new Set([rows[l][c], rows[l - 1][c], rows[l][c - 1], rows[l - 1][c - 1]]).size === 1 ? 3 : 0;
    for (const line of rows) count += line.filter(Boolean).length;
    return sum + 2 * Math.abs((100 * count) / size ** 2 - 50);
  };
  return masks.map((_, mask) => masked(mask)).reduce((a, b) => (cost(b) < cost(a) ? b : a));
}

function qrPicture(text) {
  const rows = qr(text);
  if (!rows) return null;
  const picture = drawn("svg", { viewBox: "-4 -4 37 37", role: "img", "aria-label": `QR code of ${text}`, "shape-rendering": "crispEdges" });
  picture.append(drawn("rect", { x: -4, y: -4, width: 37, height: 37, fill: "#fff" }));
  const path = rows.flatMap((line, y) => line.map((on, x) => (on ? `M${x} ${y}h1v1h-1z` : ""))).join("");
  picture.append(drawn("path", { d: path, fill: "#000" }));
  return picture;
}

async function copy(text, button) {
  let done = true;
  try { await navigator.clipboard.writeText(text); } catch {
    // Without a secure connection, and within other pages, there is no clipboard but by a field.
    const field = element("textarea", { "aria-hidden": "true" });
    field.value = text;
    document.body.append(field);
    field.select();
    done = document.execCommand("copy");
    field.remove();
    button.focus();
  }
  button.textContent = done ? "Copied" : "Not copied";
  setTimeout(() => { button.textContent = "Copy"; }, 2000);
}

// One fold for each fix, which stays open while the fix moves.
const folds = new Map();
function showCoordinates() {
  if (!earth) return;
  data.searches.forEach((search, index) => {
    const belief = beliefAt(search, state.time);
    let fold = folds.get(index);
    if (!fold) {
      fold = element("details", {}, element("summary"), element("div"));
      fold.addEventListener("toggle", () => showCoordinates());
      folds.set(index, fold);
      byId("coordinates").append(fold);
    }
    fold.hidden = !belief;
    if (!belief) return;
    const degrees = earth.toDegrees(belief.place), uri = geoText(degrees, belief.ellipse);
    if (fold.dataset.shown === `${uri} ${fold.open}`) return;
    fold.dataset.shown = `${uri} ${fold.open}`;
    fold.firstChild.textContent = data.searches.length > 1 ? `Coordinates of ${search.name}` : "Coordinates";
    if (!fold.open) return;
    const at = utm(degrees), list = element("dl"), link = element("a", { href: uri }, uri);
    for (const [name, text, shown] of [["degrees", degrees.map((value) => value.toFixed(6)).join(", ")], ["UTM", utmText(at)], ["MGRS", mgrsText(at)], ["geo", uri, link]]) {
      if (text === null) continue;
      const button = element("button", { type: "button", "aria-label": `Copy ${name}` }, "Copy");
      button.addEventListener("click", () => copy(text, button));
      list.append(element("dt", {}, name), element("dd", {}, element("span", {}, shown || text), button));
    }
    const picture = qrPicture(uri);
    fold.lastChild.replaceChildren(list, ...(picture ? [picture] : []));
  });
}
Object.assign(window.foxhunt, { utm, utmText, mgrsText, geoText, qr });
