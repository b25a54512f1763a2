const byId = (id) => document.getElementById(id);

function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (value !== undefined && value !== false) made.setAttribute(name, value === true ? "" : value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined && child !== false));
  return made;
}

const button = (text, onclick, more = {}) => element("button", { type: "button", onclick, ...more }, text);
const fixed = (value, digits) => (Number.isFinite(value) ? value.toFixed(digits) : "");
const megabytes = (size) => (size < 1e6 ? `${Math.max(1, Math.round(size / 1e3))} kB` : `${(size / 1e6).toFixed(1)} MB`);
const status = (text) => { byId("status").textContent = text; };

function save(name, contents, type) {
  const address = URL.createObjectURL(new Blob([contents], { type }));
  element("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}

// ---------------------------------------------------------------- the program, in a worker

// The program as it stands in the page: WebAssembly, compressed, in base64.
async function compile() {
  const bytes = Uint8Array.from(atob(byId("program").textContent), (letter) => letter.charCodeAt(0));
  byId("program").remove();
  const inflated = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return WebAssembly.compile(await new Response(inflated).arrayBuffer());
}
const program = compile();

// A worker with the program. `run` gives it files as [name, bytes], and `hear` its notes, progress and result as they
// come; it returns the exit code, or null if it was stopped, and the contents of `wanted` files that it wrote.
function startEngine() {
  let worker = null, number = 0, listener = null, last = Promise.resolve();
  const start = () => {
    const address = URL.createObjectURL(new Blob([byId("worker").textContent], { type: "text/javascript" }));
    worker = new Worker(address);
    URL.revokeObjectURL(address);
    worker.onmessage = ({ data }) => { if (listener && data.number === number) listener(data.kind, data.value); };
    worker.onerror = (event) => { if (listener) listener("broken", event.message || "the worker failed"); };
  };
  const restart = () => { worker.terminate(); start(); };
  async function runNow(args, given, wanted, hear) {
    const module = await program;
    number += 1;
    return new Promise((done) => {
      listener = (kind, value) => {
        if (kind === "end") { listener = null; done({ code: value.code, written: new Map(value.written) }); }
        else if (kind === "broken") { hear("note", `error: the program broke off: ${value}`); listener = null; restart(); done({ code: 1, written: new Map() }); }
        else if (kind === "stopped") { listener = null; done({ code: null, written: new Map() }); }
        else hear(kind, value);
      };
      worker.postMessage({ module, number, args, given, wanted });
    });
  }
  start();
  return {
    run(...asked) {
      const mine = last.then(() => runNow(...asked));
      last = mine.catch(() => {});
      return mine;
    },
    stop() { if (listener) { restart(); listener("stopped"); } },
    end() { worker.terminate(); },
  };
}
const engine = startEngine();

// The answer of a command that has a result, with the files that it wrote; throws what the program says otherwise.
async function ask(engine, args, given = [], wanted = []) {
  const notes = [];
  let text = null;
  const { code, written } = await engine.run([...args, "--json=lines"], given, wanted, (kind, value) => {
    if (kind === "note") notes.push(value); else if (kind === "result") text = value;
  });
  const failed = notes.filter((note) => note.startsWith("error: ")).map((note) => note.slice(7));
  if (code || text === null) throw new Error(failed.join(" ") || notes.at(-1) || "no answer");
  return { value: JSON.parse(text).value, written };
}

// ---------------------------------------------------------------- files

const files = new Map(), BY_HAND = "by-hand.toml";
const KINDS = {
  log: "log of a hunt", struck: "receptions to leave out", mapping: "mapping of columns", calibration: "calibration", conformal: "factors of regions",
  samples: "samples", recording: "recording",
};

function kindOf(name, head) {
  if (head.startsWith('{"foxhunt_log"')) return "log";
  if (head.startsWith('{"foxhunt_struck"')) return "struck";
  if (/\.toml$/i.test(name)) {
    if (/^foxhunt_calibration/m.test(head)) return "calibration";
    return /^foxhunt_conformal/m.test(head) ? "conformal" : "mapping";
  }
  return /\.(wav|sigmf-meta|sigmf-data|sigmf|rf64|bw64|w64|sdriq|raw|cu8|cs8|cs16|cf32|cfile|iq)$/i.test(name) ? "samples" : "recording";
}

function keep(name, bytes) {
  const head = new TextDecoder().decode(bytes.subarray(0, 4096));
  files.set(name, { bytes, kind: kindOf(name, head) });
}

const ofKind = (...kinds) => [...files].filter(([, file]) => kinds.includes(file.kind)).map(([name]) => name);

function showFiles() {
  byId("files").replaceChildren(...[...files].map(([name, { bytes, kind }]) => element("li", {},
    element("span", {}, name), element("small", {}, `${KINDS[kind]}, ${megabytes(bytes.length)}`),
    button("×", () => { files.delete(name); showFiles(); byId("choose").focus(); }, { "aria-label": `Remove ${name}`, title: "Remove" }))));
  byId("map-columns").disabled = !ofKind("recording").length;
  byId("run").disabled = busy || !ofKind("recording", "log", "samples").length;
}

async function take(list) {
  const chosen = [...list];
  if (!chosen.length) return;
  if (busy) { errors(["A computation is running: stop it, then drop the files again."]); return; }
  errors([]);
  const failed = [];
  const read = await Promise.all(chosen.map(async (file) => {
    try { return [file.name, new Uint8Array(await file.arrayBuffer())]; } catch (error) { failed.push(`${file.name} cannot be read: ${error.message}`); return null; }
  }));
  const kept = read.filter(Boolean);
  const isMain = ([name, bytes]) => ["recording", "log", "samples"].includes(kindOf(name, new TextDecoder().decode(bytes.subarray(0, 4096))));
  // Earlier recordings belong to an earlier question, and so do columns that were mapped for one of them.
  if (kept.some(isMain)) for (const name of [...ofKind("recording", "log", "samples"), BY_HAND]) files.delete(name);
  for (const [name, bytes] of kept) keep(name, bytes);
  showFiles();
  await runAll();
  if (failed.length) errors(failed);
}

// ---------------------------------------------------------------- what is run

let busy = false, stopped = false, ending = Promise.resolve();
// The panel whose answers are shown; another panel hides them.
let resultsOf = null;

// The words of a line as a shell has them: quotes hold spaces together, also within a word.
const words = (text) => [...text.matchAll(/(?:"[^"]*"|'[^']*'|\S)+/g)].map(([word]) => word.replace(/"([^"]*)"|'([^']*)'/g, (_, double, single) => double ?? single));

const REPORT = "report.html", LOG = "hunt.jsonl";

// The arguments of a job on recordings, a log or samples.
function argumentsOf(work, names) {
  const flags = words(byId("flags").value), has = (...given) => flags.some((flag) => given.includes(flag.split("=")[0]));
  const option = (flag, value) => (value && !has(flag) ? [flag, value] : []);
  const first = (...kinds) => ofKind(...kinds)[0];
  const beacon = byId("beacon").value.trim(), margin = byId("margin").value.trim();
  const estimator = option("--estimator", byId("estimator").value);
  const reading = [...option("--format", first("mapping")), ...option("--calibration", first("calibration"))];
  const locating = [...estimator, ...option("--margin-m", margin === "200" ? "" : margin), ...reading, ...option("--conformal", first("conformal"))];
  const ignore = option("--ignore", first("struck")), report = ["--report", REPORT];
  const one = option("--beacon", beacon), every = one.length || has("--beacon", "--track", "--every-beacon") ? [] : ["--every-beacon"];
  switch (work) {
    case "judge": return ["judge", ...names, ...one, ...locating, ...flags];
    case "bearing": return ["bearing", ...names, ...one, ...reading, ...flags, ...report];
    case "replay": return ["replay", ...names, ...estimator, ...ignore, ...flags, ...report];
    case "pulses": return ["pulses", ...names, ...flags];
    default: return ["locate", ...names, ...one, ...every, ...locating, ...ignore, ...flags, ...report];
  }
}

// The jobs that the files and settings ask for.
function jobs(asked = byId("work").value) {
  const recordings = ofKind("recording"), apart = (names) => names.map((name) => [name]);
  const each = (work, groups) => groups.filter((names) => names.length).map((names) => ({ work, names, args: argumentsOf(work, names) }));
  const grouped = byId("several").value === "apart" ? apart(recordings) : [recordings];
  const samples = ofKind("samples").filter((name) => !/\.sigmf-data$/i.test(name) || !files.has(name.replace(/data$/i, "meta")));
  switch (asked) {
    case "locate": case "judge": return each(asked, grouped);
    case "bearing": return each(asked, apart(recordings));
    case "replay": return each(asked, apart(ofKind("log", "recording")));
    case "pulses": return each(asked, apart(ofKind("samples", "recording")));
    default: return [...each("replay", apart(ofKind("log"))), ...each("pulses", apart(samples)), ...each("locate", grouped)];
  }
}

// A phone has no room for the answer beside the settings.
function toResults() {
  if (matchMedia("(max-width: 820px)").matches) byId("results").scrollIntoView();
}

// Runs jobs one after the other. A job may bring files of its own; one that `stays` leaves the screen where it is.
function runAll(list = jobs()) {
  if (!busy && list.length) ending = runJobs(list);
  return ending;
}

async function runJobs(list) {
  busy = true;
  resultsOf = list[0].panel ?? "recordings";
  stopped = false;
  byId("stop").disabled = byId("simulate-stop").disabled = false;
  byId("simulate").disabled = true;
  showFiles();
  errors([]);
  runs.length = 0;
  showRuns();
  if (!list[0].stays) toResults();
  const begun = performance.now();
  try {
    for (const [index, job] of list.entries()) {
      if (stopped) break;
      const of = list.length > 1 ? ` (${index + 1} of ${list.length})` : "";
      status(`${job.work} ${job.names.join(", ")}${of} …`);
      await runOne(job, begun);
    }
  } finally {
    busy = false;
    byId("stop").disabled = byId("simulate-stop").disabled = true;
    byId("simulate").disabled = !window.foxhunt.ready;
    byId("progress").hidden = true;
  }
  showFiles();
  const count = rowsOf(runs).length, failed = runs.filter((one) => one.errors.length).length;
  const done = [count ? `${count} ${count === 1 ? "fix" : "fixes"}` : null, failed ? `${failed} of ${runs.length} ${runs.length === 1 ? "file" : "runs"} with an error` : null].filter(Boolean).join(", ");
  status(stopped ? "Stopped." : `Done in ${fixed((performance.now() - begun) / 1000, 1)} s${done ? `: ${done}` : ""}.`);
  window.foxhunt.done += 1;
}

async function runOne(job, begun) {
  const one = { ...job, notes: [], errors: [], text: null, result: null, report: null, code: null, firstMs: null };
  runs.push(one);
  const bar = byId("progress");
  bar.hidden = false;
  bar.removeAttribute("value");
  const hear = (kind, value) => {
    if (kind === "note") {
      if (value.startsWith("error: ")) one.errors.push(value.slice(7)); else if (!value.startsWith("report: ")) one.notes.push(value);
    } else if (kind === "progress") {
      bar.max = value.total; bar.value = value.done;
    } else {
      // The answer is shown at once; the report page comes after it.
      one.text = value.slice('{"kind":"result","value":'.length, -1);
      one.result = JSON.parse(one.text);
      one.firstMs = performance.now() - begun;
      showRuns(current ?? one);
      if (runs.length === 1 && !job.stays) toResults();
    }
  };
  const all = [...new Set([...job.names, ...ofKind("mapping", "calibration", "conformal", "struck", "recording", "samples")])];
  const given = job.given ?? all.filter((name) => files.has(name)).map((name) => [name, files.get(name).bytes]);
  const { code, written } = await engine.run([...job.args, "--json=lines"], given, job.work === "hunt" ? [REPORT, LOG] : [REPORT], hear);
  one.code = code;
  const page = written.get(REPORT);
  if (page) one.report = new TextDecoder().decode(page);
  if (written.get(LOG)) one.log = new TextDecoder().decode(written.get(LOG));
  if (code && !one.errors.length) one.errors.push(one.notes.pop() || `the program ended with ${code}`);
  showRuns(current ?? one);
  if (one.errors.some((text) => /no known format|names no column|has no column/.test(text)) && !ofKind("mapping").length && !job.given) openMapping(job.names.find((name) => one.errors.some((text) => text.includes(name))) || job.names[0]);
}

// ---------------------------------------------------------------- results

const runs = [];
let current = null;
window.foxhunt = { runs, files, done: 0, ready: false };

function errors(texts) { byId("errors").replaceChildren(...texts.map((text) => element("p", { class: "error" }, text))); }

// The fixes of runs, each as a row of the table.
function rowsOf(list) {
  const row = (one, fix, name, estimator) => ({
    run: one, recording: one.names.join(", "), beacon: name || "", lat: fix.estimate.lat_deg, lon: fix.estimate.lon_deg,
    east: fix.estimate.east_m, north: fix.estimate.north_m, ellipse: fix.ellipse_95, error: fix.error_m,
    used: fix.observations ?? fix.steps, rejected: fix.rejected, estimator, remarks: fix.remarks || [],
  });
  return list.flatMap((one) => {
    if (!one.result) return [];
    if (one.work === "hunt" || one.work === "replay") return one.result.beacons.map((fix) => row(one, fix, fix.name, one.result.estimator));
    if (one.work !== "locate") return [];
    const found = Array.isArray(one.result) ? one.result : [one.result];
    return found.flatMap((fix) => {
      const last = fix.places ? fix.places.at(-1) : fix;
      return last ? [row(one, { ...last, remarks: fix.remarks }, fix.beacon, fix.places ? "track, last place" : fix.estimator)] : [];
    });
  });
}

const COLUMNS = [
  ["Recording", (row) => row.recording, "text"], ["Beacon", (row) => row.beacon, "text"],
  ["Latitude °", (row) => fixed(row.lat, 6)], ["Longitude °", (row) => fixed(row.lon, 6)],
  ["East m", (row) => fixed(row.east, 1)], ["North m", (row) => fixed(row.north, 1)],
  ["95 % ellipse m", (row) => (row.ellipse ? `${fixed(row.ellipse.semi_major, 1)} × ${fixed(row.ellipse.semi_minor, 1)}` : "")],
  ["Error m", (row) => fixed(row.error, 1)], ["Used", (row) => `${row.used ?? ""}`], ["Rejected", (row) => (row.rejected ? `${row.rejected}` : "")],
  ["Estimator", (row) => row.estimator, "text"], ["Remarks", (row) => [...new Set(row.remarks.map(({ code }) => code))].join(", "), "text"],
];

// A table of rows; columns that are empty in all rows are left out.
function fill(table, columns, rows, more = () => ({})) {
  const shown = columns.filter(([, text]) => rows.some((row) => text(row) !== ""));
  const cell = ([name, text, kind], row) => { const value = text(row); return element("td", { class: [kind, value === "" && "empty"].filter(Boolean).join(" ") || undefined, "data-name": name }, value instanceof Node || typeof value === "string" ? value : String(value)); };
  table.className = "reflow";
  table.replaceChildren(
    element("thead", {}, element("tr", {}, ...shown.map(([name, , kind]) => element("th", { scope: "col", class: kind }, name)))),
    element("tbody", {}, ...rows.map((row) => element("tr", more(row), ...shown.map((column) => cell(column, row))))));
}

function showRuns(one = current) {
  if (one && !runs.includes(one)) one = null;
  const rows = rowsOf(runs), several = runs.length > 1;
  byId("fixes-box").hidden = !rows.length;
  const choose = several ? [["Details", (row) => (rows.find((first) => first.run === row.run) !== row ? "" : button("Show", () => { showRuns(row.run); byId("shown-head").focus(); }, { "aria-label": `Show ${row.recording}` }))]] : [];
  if (rows.length) fill(byId("fixes"), [...choose, ...COLUMNS], rows, (row) => (several && row.run === one ? { class: "current", "aria-current": "true" } : {}));
  errors(runs.flatMap((run) => run.errors.map((text) => (several ? `${run.names.join(", ")}: ${text}` : text))));
  if (one !== current || !one || one.shown !== stateOf(one)) showRun(one);
}

const stateOf = (one) => `${one.text?.length} ${one.report?.length} ${one.errors.length} ${one.code}`;

// What a heading of JSON says to people: error_m is "error m".
const heading = (key) => key.replace(/_95\b/, " 95 %").replace(/_deg_compass$/, " °").replace(/_deg$/, " °").replaceAll("_", " ");
const said = (value) => {
  if (value === null || value === undefined) return "";
  if (typeof value === "number") return Number.isInteger(value) ? String(value) : String(Number(value.toPrecision(6)));
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (Array.isArray(value) && value.every((one) => typeof one !== "object")) return value.map(said).join(" … ");
  if (Array.isArray(value) && value.every((one) => one?.code)) return [...new Set(value.map(({ code }) => code))].join(", ");
  return typeof value === "object" ? "" : String(value);
};

const MOST_ROWS = 200;

// A heading and a table of objects, with a column for each value that is plain.
function listed(title, objects, level = "h3") {
  if (!objects?.length) return [];
  const keys = [...new Set(objects.flatMap((object) => Object.keys(object)))];
  const table = element("table"), few = objects.slice(0, MOST_ROWS);
  fill(table, keys.map((key) => [heading(key), (object) => said(object[key]), objects.some((object) => typeof object[key] === "string") ? "text" : undefined]), few);
  const rest = objects.length > few.length ? [element("p", { class: "hint" }, `The first ${few.length} of ${objects.length}; the saved answer has all.`)] : [];
  return [element(level, {}, title), element("div", { class: "wide", tabindex: "0", role: "region", "aria-label": title }, table), ...rest];
}

function tablesOf({ work, result }) {
  if (!result) return [];
  if (work === "judge") {
    const answers = result.fixes.flatMap(({ file, beacon, receptions, answers: of }) => of.map((answer) => ({ file, beacon, receptions, ...answer })));
    return [...listed("Fixes beside the truth", answers), ...listed("Each estimator", result.estimators)];
  }
  if (work === "bearing") return listed("Bearings of the turns", result.turns);
  if (work === "replay") return [element("p", {}, result.own ? `${result.identical} of ${result.compared} estimates are the log's own to the bit.` : `Replayed with ${result.estimator}; the log is of ${result.logged_estimator}.`)];
  if (work === "pulses") return Object.entries(Array.isArray(result) ? { pulses: result } : result).flatMap(([name, list]) => (Array.isArray(list) && typeof list[0] === "object" ? listed(heading(name), list) : []));
  if (result.places) return listed("Places", result.places.map(({ time_s, estimate, error_m }) => ({ time_s, ...estimate, error_m })));
  return [];
}

function remarksOf(one) {
  const ofFixes = rowsOf([one]).flatMap((row) => row.remarks), ofFiles = one.result?.files?.flatMap?.(({ remarks }) => remarks) || [];
  const known = new Map([...ofFixes, ...ofFiles].map((remark) => [`${remark.code} ${remark.text}`, remark]));
  return [...known.values()];
}

// Shows all of a run below the table of fixes.
function showRun(one) {
  current = one;
  const shown = byId("shown");
  if (!one) { shown.replaceChildren(); return; }
  one.shown = stateOf(one);
  const title = `${one.work} ${one.names.join(", ")}`, base = one.names[0].replace(/\.[^.]*$/, "");
  const remarks = remarksOf(one);
  const again = (work, text) => button(text, () => runAll([{ work, names: one.names, args: argumentsOf(work, one.names) }]));
  const parts = [
    element("h3", { id: "shown-head", tabindex: "-1" }, title),
    ...(remarks.length ? [element("ul", { class: "doubts", "aria-label": "Remarks" }, ...remarks.map(({ code, text, ...remark }) => element("li", remark.note ? { class: "note" } : {}, text, " ", element("code", {}, code))))] : []),
    ...tablesOf(one),
    element("p", { class: "buttons" },
      one.report && button("Save report page", () => save(`${base}.html`, one.report, "text/html")),
      one.log && button("Save log", () => save(LOG, one.log, "application/jsonl")),
      one.text && button("Save answer (JSON)", () => save(`${base}.json`, `${one.text}\n`, "application/json")),
      one.work === "locate" && rowsOf([one]).some((row) => Number.isFinite(row.error)) && again("judge", "Judge against the recorded truth"),
      one.work === "locate" && one.notes.some((note) => note.includes("bearings of turns")) && one.names.length === 1 && again("bearing", "Bearings of the turns")),
    element("details", {}, element("summary", {}, "Command line and notes of the program"),
      element("div", { class: "command" }, `foxhunt ${one.args.map((word) => (/^[\w.,:=/%+-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`)).join(" ")}`),
      ...(one.notes.length ? [element("pre", { tabindex: "0" }, one.notes.join("\n"))] : [])),
  ];
  if (one.report) parts.push(element("iframe", { title: `Report page of ${one.names.join(", ")}`, sandbox: "allow-scripts allow-downloads", srcdoc: one.report }));
  shown.replaceChildren(...parts.filter(Boolean));
}

// ---------------------------------------------------------------- columns by hand

const OURS = JSON.parse(byId("columns").textContent), TEXTS = ["beacon", "drone"], SEPARATORS = { ",": "comma", ";": "semicolon", "\t": "tab", "|": "bar", " ": "blank" };
const mapping = { file: null, lines: [], chosen: [] };

// The cells of a line; quotes keep separators.
function cells(line, separator) {
  const found = [""];
  let quoted = false;
  for (const letter of line) {
    if (letter === '"') quoted = !quoted;
    else if (letter === separator && !quoted) found.push("");
    else found[found.length - 1] += letter;
  }
  return found.map((cell) => cell.trim());
}

function openMapping(name) {
  const tables = ofKind("recording");
  byId("mapping").hidden = false;
  byId("mapping-file").replaceChildren(...tables.map((file) => element("option", { value: file }, file)));
  if (name && tables.includes(name)) byId("mapping-file").value = name;
  readTable();
  byId("mapping-head").focus();
}

function readTable() {
  const name = byId("mapping-file").value;
  if (!files.has(name)) { byId("mapping").hidden = true; return; }
  mapping.file = name;
  mapping.lines = new TextDecoder().decode(files.get(name).bytes.subarray(0, 1 << 18)).replace(/^\ufeff/, "").split(/\r?\n/);
  const widest = (separator) => Math.max(...mapping.lines.slice(0, 40).filter((line) => !line.startsWith("#")).map((line) => cells(line, separator).length));
  const best = Object.keys(SEPARATORS).reduce((a, b) => (widest(b) > widest(a) ? b : a));
  byId("mapping-separator").value = best;
  const first = mapping.lines.findIndex((line) => line.trim() && !line.startsWith("#") && cells(line, best).length === widest(best));
  const numbers = cells(mapping.lines[first] || "", best).filter((cell) => cell !== "" && Number.isFinite(Number(cell))).length;
  // A line of numbers names no columns.
  byId("mapping-line").value = numbers > 1 ? 0 : first + 1;
  showPreview();
}

function named() {
  const separator = byId("mapping-separator").value, line = Math.max(0, Math.floor(Number(byId("mapping-line").value) || 0));
  const below = mapping.lines.slice(line).filter((text) => text.trim() && !text.startsWith("#")).slice(0, 10).map((text) => cells(text, separator));
  const count = Math.max(0, ...below.map((row) => row.length));
  const names = line > 0 ? cells(mapping.lines[line - 1] || "", separator) : Array.from({ length: count }, (_, i) => `column_${i + 1}`);
  return { separator, line, below, names };
}

function showPreview() {
  const { names, below } = named();
  mapping.chosen = names.map((name) => ({ ours: OURS.includes(name) ? name : "", factor: "1" }));
  const column = (name, index) => {
    const select = element("select", { "aria-label": `${name} holds`, onchange: (event) => { mapping.chosen[index].ours = event.target.value; showToml(); } },
      element("option", { value: "" }, "not used"), ...OURS.map((ours) => element("option", { value: ours }, ours)));
    select.value = mapping.chosen[index].ours;
    const factor = element("input", { type: "number", step: "any", value: "1", "aria-label": `Factor of ${name}`, oninput: (event) => { mapping.chosen[index].factor = event.target.value; showToml(); } });
    return element("th", { scope: "col" }, element("div", {}, name), select, element("div", {}, "× ", factor));
  };
  byId("preview").replaceChildren(
    element("thead", {}, element("tr", {}, ...names.map(column))),
    element("tbody", {}, ...below.map((row) => element("tr", {}, ...names.map((_, index) => element("td", {}, row[index] ?? ""))))));
  showToml();
}

function toml() {
  const { names, line, separator } = named(), text = JSON.stringify;
  const used = names.map((name, index) => ({ name, ...mapping.chosen[index] })).filter(({ ours }) => ours);
  const decimal = (factor) => (/[.eE]/.test(String(factor)) ? String(factor) : `${factor}.0`);
  const source = ({ name, ours, factor }) => {
    const number = Number(factor);
    return `${ours} = ${number === 1 || !Number.isFinite(number) || TEXTS.includes(ours) ? text(name) : `{ column = ${text(name)}, scale = ${decimal(number)} }`}`;
  };
  const head = line > 0 ? `header = [${used.map(({ name }) => text(name)).join(", ")}]` : `names = [${names.map(text).join(", ")}]`;
  return `name = "by-hand"\ndescription = ${text(`Columns of ${mapping.file}, mapped by hand`)}\n${head}\nseparator = ${text(separator)}\n\n[columns]\n${used.map(source).join("\n")}\n`;
}

function showToml() {
  byId("toml").textContent = toml();
  const ours = mapping.chosen.map((one) => one.ours).filter(Boolean), has = (...names) => names.every((name) => ours.includes(name));
  const twice = ours.find((name, index) => ours.indexOf(name) !== index);
  const measured = ours.some((name) => /^(rss_|bearing_deg|relative_bearing|range_|boresight)/.test(name) && !name.includes("sigma"));
  const lacks = [
    twice && `${twice} is chosen twice`,
    !has("lat_deg", "lon_deg") && !has("east_m", "north_m") && "the receiver's place is missing: lat_deg and lon_deg, or east_m and north_m",
    !measured && "a measurement is missing, such as rss_dbm or bearing_deg_compass",
  ].filter(Boolean).join("; ");
  byId("mapping-lacks").textContent = lacks ? `${lacks[0].toUpperCase()}${lacks.slice(1)}.` : "";
  byId("mapping-use").disabled = Boolean(twice) || !ours.length;
}

// ---------------------------------------------------------------- hands

byId("mapping-separator").replaceChildren(...Object.entries(SEPARATORS).map(([value, name]) => element("option", { value }, name)));
byId("mapping-file").addEventListener("change", readTable);
byId("mapping-separator").addEventListener("change", showPreview);
byId("mapping-line").addEventListener("input", showPreview);
byId("mapping-save").addEventListener("click", () => save(BY_HAND, toml(), "application/toml"));
byId("mapping-close").addEventListener("click", () => { byId("mapping").hidden = true; byId("map-columns").focus(); });
byId("mapping-use").addEventListener("click", () => {
  for (const name of ofKind("mapping")) files.delete(name);
  keep(BY_HAND, new TextEncoder().encode(toml()));
  byId("mapping").hidden = true;
  showFiles();
  byId("results").focus();
  runAll();
});
byId("map-columns").addEventListener("click", () => openMapping());
byId("choose").addEventListener("change", async (event) => { const list = [...event.target.files]; event.target.value = ""; await take(list); });
byId("settings").addEventListener("submit", (event) => { event.preventDefault(); runAll(); });
const stop = () => { stopped = true; engine.stop(); };
byId("stop").addEventListener("click", stop);

const tabs = [...document.querySelectorAll("[role=tab]")];
function choose(tab) {
  for (const one of tabs) {
    const isChosen = one === tab;
    one.setAttribute("aria-selected", String(isChosen));
    one.tabIndex = isChosen ? 0 : -1;
    byId(one.getAttribute("aria-controls")).hidden = !isChosen;
  }
  byId("results").hidden = !busy && resultsOf !== null && resultsOf !== tab.getAttribute("aria-controls");
  tab.dispatchEvent(new Event("chosen"));
}
for (const tab of tabs) {
  tab.addEventListener("click", () => choose(tab));
  tab.addEventListener("keydown", ({ key }) => {
    if (key !== "ArrowLeft" && key !== "ArrowRight") return;
    const by = key === "ArrowRight" ? 1 : tabs.length - 1, next = tabs[(tabs.indexOf(tab) + by) % tabs.length];
    choose(next);
    next.focus();
  });
}
let within = 0;
const over = (event) => { event.preventDefault(); byId("drop").classList.add("over"); };
addEventListener("dragenter", (event) => { within += 1; over(event); });
addEventListener("dragover", over);
addEventListener("dragleave", () => { within -= 1; if (within <= 0) byId("drop").classList.remove("over"); });
addEventListener("drop", (event) => {
  event.preventDefault();
  within = 0;
  byId("drop").classList.remove("over");
  choose(byId("tab-recordings"));
  take(event.dataTransfer.files);
});

// The menus are the program's own, which is ready when it has answered.
async function begin() {
  const listed = async (what) => (await ask(engine, ["list", what])).value;
  const menus = { estimators: await listed("estimators"), planners: await listed("planners"), scenarios: await listed("scenarios") };
  for (const { name, when } of menus.estimators) byId("estimator").append(element("option", { value: name, title: when }, name));
  beginSimulation(menus);
  window.foxhunt.ready = true;
  byId("simulate").disabled = busy;
  byId("many").disabled = false;
  if (!busy && !runs.length) status("Ready.");
}
begin().catch((error) => { errors([`This browser cannot run the program: ${error.message}`]); status(""); });
