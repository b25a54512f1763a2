// ---------------------------------------------------------------- the scenario that is flown

const SCENARIOS = JSON.parse(byId("scenarios").textContent);
// Defaults of the channel, which the fields show while a scenario leaves the key out.
const NOISES = { "pattern-sigma": ["pattern_sigma_db", 4], "sample-sigma": ["sample_sigma_db", 2], "bearing-sigma": ["bearing_sigma_deg", 30] };
const SHADOWING_CORRELATION_M = 20;

// The chosen scenario as it is edited, a copy of the built-in one.
let draft = null;

const builtIn = () => SCENARIOS[byId("scenario").value];
const isEdited = () => JSON.stringify(draft) !== JSON.stringify(builtIn());
const numberIn = (id) => { const value = byId(id).valueAsNumber; return Number.isFinite(value) ? value : null; };

// Copies the built-in scenario anew and shows its values.
function resetScenario() {
  draft = structuredClone(builtIn());
  const channel = draft.world.channel ?? {};
  for (const [id, [key, usual]] of Object.entries(NOISES)) {
    byId(id).value = channel[key] ?? "";
    byId(id).placeholder = usual;
  }
  byId("shadowing-sigma").value = channel.shadowing?.sigma_db ?? "";
  byId("shadowing-sigma").placeholder = 0;
  byId("antenna").value = byId("simulated-estimator").value = "";
  byId("scenario-about").textContent = byId("scenario").selectedOptions[0]?.title ?? "";
  showScene();
}

// Puts antenna, noise and estimator of the fields into the scenario; places are put there as they are dragged.
function readScenario() {
  const original = builtIn(), given = original.world.channel ?? {}, channel = draft.world.channel ??= {};
  const put = (table, key, value) => { if (value === null || value === undefined) delete table[key]; else table[key] = value; };
  for (const [id, [key]] of Object.entries(NOISES)) put(channel, key, numberIn(id));
  const sigma_db = numberIn("shadowing-sigma");
  put(channel, "shadowing", sigma_db ? { correlation_m: SHADOWING_CORRELATION_M, ...given.shadowing, sigma_db } : null);
  put(channel, "antenna", byId("antenna").value || given.antenna);
  put(draft, "estimator", byId("simulated-estimator").value || original.estimator);
  if (!original.world.channel && !Object.keys(channel).length) delete draft.world.channel;
}

const isTable = (value) => typeof value === "object" && !Array.isArray(value);

// A table of JSON as TOML: plain values first, then its tables. Lists of tables have a line for each.
function tomlOf(table, path = []) {
  const name = (key) => (/^[\w-]+$/.test(key) ? key : JSON.stringify(key));
  const pairs = (one) => Object.entries(one).map(([key, inner]) => `${name(key)} = ${value(inner)}`).join(", ");
  const value = (one) => (Array.isArray(one) ? `[${one.map(value).join(", ")}]` : isTable(one) ? `{ ${pairs(one)} }` : JSON.stringify(one));
  const rows = (one) => (Array.isArray(one) && one.length && one.every(isTable) ? `[\n${one.map((row) => `    ${value(row)},\n`).join("")}]` : value(one));
  const entries = Object.entries(table), plain = entries.filter(([, one]) => !isTable(one)), tables = entries.filter(([, one]) => isTable(one));
  const head = path.length && (plain.length || !tables.length) ? `\n[${path.map(name).join(".")}]\n` : "";
  return head + plain.map(([key, one]) => `${name(key)} = ${rows(one)}\n`).join("") + tables.map(([key, one]) => tomlOf(one, [...path, key])).join("");
}

const seed = () => Math.max(0, Math.floor(numberIn("seed") ?? 0));
const simulatedFlags = () => [...(byId("planner").value ? ["--planner", byId("planner").value] : []), ...words(byId("simulated-flags").value)];

// The hunt that the fields ask for: its scenario's name or file, and a command line for any seed.
function simulated() {
  readScenario();
  const chosen = byId("scenario").value, flags = simulatedFlags();
  const name = isEdited() ? `${chosen}-edited.toml` : chosen;
  const args = (seed) => ["hunt", name, "--seed", String(seed), ...flags, "--out", "."];
  const text = `# foxhunt hunt ${[`${chosen}-edited.toml`, "--seed", seed(), ...flags].join(" ")}\n${tomlOf(draft)}`;
  return { name, args, text, given: isEdited() ? [[name, new TextEncoder().encode(text)]] : [] };
}

function simulation() {
  const { name, args, given } = simulated();
  return { work: "hunt", names: [name], args: args(seed()), given, panel: "simulation" };
}

// ---------------------------------------------------------------- the map

const shape = (tag, attributes = {}, ...children) => {
  const made = document.createElementNS(byId("scene").namespaceURI, tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...children);
  return made;
};

// A step of 1, 2 or 5 times a power of ten that is not below a length.
function roundStep(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return [1, 2, 5, 10].map((by) => by * power).find((step) => step >= length * 0.999);
}

const decimals = (step) => Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
const sided = (value, positive, negative) => `${said(Math.abs(value))} m ${value < 0 ? negative : positive}`;

function showScene() {
  const scene = byId("scene"), width = scene.clientWidth, height = scene.clientHeight;
  if (!draft || !width || !height) return;
  const beacons = draft.world.beacons ?? [], drones = draft.world.drones ?? [];
  const all = [...beacons, ...drones], range = (key) => { const values = all.map((one) => one[key]); return [Math.min(...values), Math.max(...values)]; };
  const [west, east] = range("east_m"), [south, north] = range("north_m");
  // Half again as much around them, so that there is room to drag to.
  const perMetre = Math.min(width / (2 * Math.max(east - west, 4)), height / (2 * Math.max(north - south, 4)));
  const middle = [(west + east) / 2, (south + north) / 2];
  const toScreen = ({ east_m, north_m }) => [width / 2 + (east_m - middle[0]) * perMetre, height / 2 - (north_m - middle[1]) * perMetre];
  const step = roundStep(70 / perMetre), digits = perMetre > 20 ? 2 : 1;
  const lines = [];
  const gridLabel = (at, positive, negative) => `${Math.abs(at).toFixed(decimals(step))} m ${at < 0 ? negative : positive}`;
  const through = (centre, half) => { const found = []; for (let at = Math.ceil((centre - half) / step); at * step <= centre + half; at += 1) found.push(at * step); return found; };
  for (const at of through(middle[0], width / 2 / perMetre)) {
    const [x] = toScreen({ east_m: at, north_m: 0 });
    lines.push(shape("line", { x1: x, x2: x, y1: 0, y2: height }), shape("text", { x: x + 3, y: height - 4 }, gridLabel(at, "E", "W")));
  }
  for (const at of through(middle[1], height / 2 / perMetre)) {
    const [, y] = toScreen({ east_m: 0, north_m: at });
    lines.push(shape("line", { x1: 0, x2: width, y1: y, y2: y }), shape("text", { x: 3, y: y - 3 }, gridLabel(at, "N", "S")));
  }
  const movable = (one, id, name, form) => {
    const mark = shape("g", { id, class: "movable", tabindex: 0, role: "button" }, shape("circle", { r: 18, class: "grip" }), form, shape("text", { x: 11, y: -8 }, name));
    const place = () => {
      const [x, y] = toScreen(one);
      mark.setAttribute("transform", `translate(${x} ${y})`);
      mark.setAttribute("aria-label", `${name}, ${sided(one.east_m, "East", "West")}, ${sided(one.north_m, "North", "South")}`);
    };
    const moveTo = (east_m, north_m, digits) => { one.east_m = Number(east_m.toFixed(digits)); one.north_m = Number(north_m.toFixed(digits)); place(); };
    mark.addEventListener("pointerdown", (event) => { mark.setPointerCapture(event.pointerId); });
    mark.addEventListener("pointermove", (event) => {
      if (!mark.hasPointerCapture(event.pointerId)) return;
      const { left, top } = scene.getBoundingClientRect();
      moveTo(middle[0] + (event.clientX - left - width / 2) / perMetre, middle[1] - (event.clientY - top - height / 2) / perMetre, digits);
    });
    mark.addEventListener("pointerup", () => { showScene(); byId(id).focus(); });
    mark.addEventListener("keydown", (event) => {
      const [right, up] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key] ?? [0, 0];
      if (!right && !up) return;
      event.preventDefault();
      const by = event.shiftKey ? 10 : 1;
      // Six decimals: a sum such as 0.1 + 0.2 has the digits of its parts.
      moveTo(one.east_m + by * right, one.north_m + by * up, 6);
      showScene();
      byId(id).focus();
    });
    place();
    return mark;
  };
  scene.setAttribute("viewBox", `0 0 ${width} ${height}`);
  scene.replaceChildren(shape("g", { class: "grid", "aria-hidden": "true" }, ...lines),
    ...drones.map((one, index) => movable(one, `drone-${index}`, `drone ${index + 1}`, shape("path", { d: "M0 -9 L8 7 L-8 7 Z", class: "drone" }))),
    ...beacons.map((one, index) => movable(one, `beacon-${index}`, one.name, shape("circle", { r: 8, class: "beacon" }))));
}
new ResizeObserver(showScene).observe(byId("scene"));

// ---------------------------------------------------------------- many hunts

// Hunts that have ended, those that could not go on, and the workers that fly.
const many = { hunts: [], failures: [], engines: [], stopped: false };
window.foxhunt.many = many;
// A beacon is within its 95 % ellipse if its normalised squared error is below this, the quantile of χ² with two degrees of freedom.
const WITHIN_95 = -2 * Math.log(0.05);
// A command line that is wrong fails every hunt: after this number without one that succeeds the others are not tried.
const HOPELESS = 5;
const MOST_WORKERS = 8;

// The quantile of sorted values as `foxhunt campaign` has it (Hyndman & Fan 1996, definition 8).
function quantile(sorted, share) {
  const at = (sorted.length + 1 / 3) * share + 1 / 3, below = Math.floor(at);
  if (at < 1) return sorted[0];
  if (at >= sorted.length) return sorted.at(-1);
  return sorted[below - 1] + (at - below) * (sorted[below] - sorted[below - 1]);
}
const ascending = (values) => values.filter(Number.isFinite).sort((a, b) => a - b);

async function flyMany() {
  const { name, args, given } = simulated(), count = Math.max(1, Math.floor(numberIn("hunts") ?? 200)), first = seed();
  Object.assign(many, { hunts: [], failures: [], engines: [], stopped: false });
  let next = first, shownAt = 0;
  byId("many").disabled = true;
  byId("many-stop").disabled = false;
  byId("many-save").disabled = true;
  const bar = byId("many-progress"), begun = performance.now();
  bar.hidden = false;
  bar.max = count;
  bar.value = 0;
  const told = (state) => {
    const done = many.hunts.length + many.failures.length, failed = many.failures.length ? `, ${many.failures.length} failed` : "";
    byId("many-status").textContent = `${name}: ${done} of ${count} hunts${failed}${state}`;
    bar.value = done;
  };
  const isOver = () => many.stopped || next >= first + count || (!many.hunts.length && many.failures.length >= HOPELESS);
  const fly = async (engine) => {
    while (!isOver()) {
      const mine = next;
      next += 1;
      try {
        many.hunts.push((await ask(engine, args(mine), given)).value);
      } catch (error) {
        if (!many.stopped) many.failures.push({ seed: mine, text: error.message });
      }
      told(" …");
      if (performance.now() - shownAt > 1000) { showDistributions(); shownAt = performance.now(); }
    }
  };
  told(" …");
  many.engines = Array.from({ length: Math.min(count, MOST_WORKERS, navigator.hardwareConcurrency || 2) }, startEngine);
  await Promise.all(many.engines.map(fly));
  for (const engine of many.engines) engine.end();
  many.hunts.sort((a, b) => a.seed - b.seed);
  byId("many").disabled = false;
  byId("many-stop").disabled = true;
  byId("many-save").disabled = !many.hunts.length;
  bar.hidden = true;
  told(`${many.stopped ? ", stopped" : ""} in ${fixed((performance.now() - begun) / 1000, 1)} s.`);
  showDistributions();
}

// A histogram with the median and the 90 % quantile. Its last bar has all values beyond it.
function histogram(title, unit, values) {
  const sorted = ascending(values);
  if (sorted.length < 2) return null;
  const median = quantile(sorted, 0.5), most = quantile(sorted, 0.9), top = Math.min(sorted.at(-1), 2.5 * most) || 1;
  const step = roundStep((top - Math.min(sorted[0], top)) / 30 || top), first = Math.floor(Math.min(sorted[0], top) / step), bars = new Array(Math.max(1, Math.ceil(top / step) - first)).fill(0);
  for (const value of sorted) bars[Math.min(bars.length - 1, Math.floor(value / step) - first)] += 1;
  const width = 480, height = 180, side = 18, floor = 160, highest = Math.max(...bars), x = (value) => side + ((value / step - first) / bars.length) * (width - 2 * side);
  const marks = bars.map((count, index) => shape("rect", { x: x((first + index) * step) + 0.5, width: Math.max(1, (width - 2 * side) / bars.length - 1), y: floor - (count / highest) * 120, height: (count / highest) * 120, class: "bar" }));
  const every = Math.ceil(bars.length / 6), ticks = [];
  for (let index = 0; index <= bars.length; index += every) ticks.push(shape("text", { x: x((first + index) * step), y: floor + 16, "text-anchor": "middle" }, ((first + index) * step).toFixed(decimals(step))));
  // The labels are on two lines, as the two quantiles may be near each other.
  const line = (value, name, y) => {
    const at = Math.min(x(value), width - side), left = at > width / 2;
    return [shape("line", { x1: at, x2: at, y1: y - 10, y2: floor, class: "quantile" }), shape("text", { x: at + (left ? -4 : 4), y, "text-anchor": left ? "end" : "start" }, `${name} ${said(Number(value.toPrecision(3)))} ${unit}`)];
  };
  const text = `${title}: median ${said(Number(median.toPrecision(3)))} ${unit}, 90 % below ${said(Number(most.toPrecision(3)))} ${unit}, ${sorted.length} values`;
  return element("figure", {}, shape("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": text, class: "histogram" },
    ...marks, shape("line", { x1: side, x2: width - side, y1: floor, y2: floor, class: "axis" }), ...ticks,
    ...line(median, "median", 14), ...line(most, "90 %", 32)), element("figcaption", { class: "hint" }, `${title}, ${unit}`));
}

function showDistributions() {
  const { hunts, failures } = many, names = [...new Set(hunts.flatMap(({ beacons }) => beacons.map(({ name }) => name)))];
  const rows = names.map((name) => {
    const found = hunts.flatMap(({ beacons }) => beacons.filter((beacon) => beacon.name === name));
    const spread = (key) => { const sorted = ascending(found.map((one) => one[key])); return sorted.length ? [quantile(sorted, 0.5), quantile(sorted, 0.9)] : []; };
    const judged = ascending(found.map(({ nees }) => nees)), inside = judged.filter((nees) => nees <= WITHIN_95).length;
    const outcomes = new Map();
    for (const { outcome } of found) outcomes.set(outcome, (outcomes.get(outcome) ?? 0) + 1);
    return { name, hunts: found.length, error: spread("error_m"), steps: spread("steps"), path: spread("path_m"), inside: judged.length ? `${inside} of ${judged.length} (${Math.round((100 * inside) / judged.length)} %)` : "", outcomes: [...outcomes].map(([outcome, count]) => `${outcome.replaceAll("_", " ")} ${count}`).join(", ") };
  });
  many.rows = rows;
  const both = ([median, most], digits) => (median === undefined ? "" : `${fixed(median, digits)} … ${fixed(most, digits)}`);
  const table = element("table");
  fill(table, [
    ["Beacon", (row) => row.name, "text"], ["Hunts", (row) => String(row.hunts)], ["Error m, median … 90 %", (row) => both(row.error, 2)], ["In the 95 % ellipse", (row) => row.inside],
    ["Turns, median … 90 %", (row) => both(row.steps, 1)], ["Path m, median … 90 %", (row) => both(row.path, 0)], ["Outcome", (row) => row.outcomes, "text"],
  ], rows);
  const errors = names.map((name) => histogram(`Error of ${name}`, "m", hunts.flatMap(({ beacons }) => beacons.filter((beacon) => beacon.name === name).map(({ error_m }) => error_m))));
  byId("distributions").replaceChildren(...[
    failures.length && element("p", { class: "error" }, `${failures.length} ${failures.length === 1 ? "hunt" : "hunts"} could not go on, the first with seed ${failures[0].seed}: ${failures[0].text}`),
    rows.length && element("div", { class: "wide", tabindex: "0", role: "region", "aria-label": "Distributions" }, table),
    rows.length && element("div", { class: "histograms" }, ...[...errors, histogram("Time of a hunt", "s", hunts.map(({ duration_s }) => duration_s))].filter(Boolean)),
  ].filter(Boolean));
}

function huntsTable() {
  const cell = (value) => (/[",\n]/.test(String(value ?? "")) ? `"${String(value).replaceAll('"', '""')}"` : String(value ?? ""));
  const rows = many.hunts.flatMap(({ seed, duration_s, beacons }) => beacons.map((one) => [seed, one.name, one.estimate.east_m, one.estimate.north_m, one.error_m, one.nees, one.steps, one.path_m, one.outcome, duration_s]));
  return [["seed", "beacon", "east_m", "north_m", "error_m", "nees", "steps", "path_m", "outcome", "duration_s"], ...rows].map((row) => `${row.map(cell).join(",")}\n`).join("");
}

// ---------------------------------------------------------------- hands of the simulation

function beginSimulation({ estimators, planners, scenarios }) {
  for (const { name, when } of estimators) byId("simulated-estimator").append(element("option", { value: name, title: when }, name));
  for (const { name, about } of planners) byId("planner").append(element("option", { value: name, title: about }, name));
  for (const name of JSON.parse(byId("antennas").textContent)) byId("antenna").append(element("option", { value: name }, name));
  for (const { name, description } of scenarios) if (SCENARIOS[name]) byId("scenario").append(element("option", { value: name, title: description }, name));
  resetScenario();
}

byId("scenario").addEventListener("change", resetScenario);
byId("scenario-reset").addEventListener("click", resetScenario);
byId("scenario-save").addEventListener("click", () => { const { text } = simulated(); save(`${byId("scenario").value}-edited.toml`, text, "application/toml"); });
byId("simulate-stop").addEventListener("click", stop);
byId("simulated").addEventListener("submit", (event) => { event.preventDefault(); runAll([simulation()]); });
byId("many").addEventListener("click", flyMany);
byId("many-stop").addEventListener("click", () => { many.stopped = true; for (const engine of many.engines) engine.stop(); });
byId("many-save").addEventListener("click", () => save("hunts.csv", huntsTable(), "text/csv"));
