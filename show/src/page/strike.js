// ---------------------------------------------------------------- striking out

// The log's lines, or the receptions of recordings, which the replayer needs; none where the page
// cannot replay.
const logLines = byId("log").textContent.split("\n").filter(Boolean);
// What the page cannot do is not offered: its estimates have to follow.
const canReplay = () => !data.not_strikable && (Boolean(data.live) || logLines.length > 0);
const strikable = () => canReplay() && received.some((one) => one.id);
// Receptions of recordings are known by their row, those of logs by their time.
const keyOf = ({ file, line, beacon, drone, time }) => (file === undefined ? { drone, beacon, time } : { file, line, beacon: beacon ?? undefined });
const idText = (id) => JSON.stringify(keyOf(id));
const readsList = () => (received.some((one) => one.id?.file !== undefined) ? "foxhunt locate --ignore" : "foxhunt replay --ignore");
const isChanged = () => received.some((one) => Boolean(one.struck) !== one.original.struck);
const struckOnes = () => received.filter((one) => one.struck);

// The list as `foxhunt replay --ignore` and `foxhunt locate --ignore` read it.
function struckText(ones = struckOnes()) {
  const lines = new Set(ones.map(({ id }) => idText(id)));
  return `${[JSON.stringify({ foxhunt_struck: 1 }), ...lines].join("\n")}\n`;
}

// Several extractors may have read one turn, which is struck out as a whole.
const ofOneTurn = (one) => received.filter((other) => other.id && idText(other.id) === idText(one.id));

// The receptions of a list; throws what is wrong with it.
function readStruck(text) {
  const known = new Map(received.filter((one) => one.id).map((one) => [idText(one.id), one])), listed = new Set();
  const parse = (line, number) => {
    try { return JSON.parse(line); } catch { throw new Error(`line ${number}: not JSON: ${line}`); }
  };
  text.split("\n").forEach((line, index) => {
    if (index > 0 && !line.trim()) return;
    const value = parse(line, index + 1);
    if (index === 0) {
      if (!value || value.foxhunt_struck !== 1) throw new Error(`line 1: no header of struck receptions: ${line}`);
      return;
    }
    const one = value && known.get(idText(value));
    if (!one) throw new Error(`line ${index + 1}: no reception of this hunt: ${line}`);
    for (const same of ofOneTurn(one)) listed.add(same);
  });
  return listed;
}

function strikeButton(one) {
  if (!one.id || !canReplay()) return [];
  const button = element("button", { type: "button", id: "strike-one", title: "x" }, one.struck ? "Take it back" : "Strike it out");
  button.addEventListener("click", () => strike(one));
  return [button];
}

function strike(one) {
  if (!one.id || !canReplay()) return;
  const struck = !one.struck;
  for (const same of ofOneTurn(one)) same.struck = struck;
  if (state.selected === null) state.selected = one.index;
  restrike();
}

// What is chosen, or else the latest one.
function strikeSelected() {
  const one = received[state.selected ?? countUntil(receivedTimes, state.time) - 1];
  if (one) strike(one);
}

function strikeAll(ones) {
  for (const one of received) one.struck = ones.has(one);
  restrike();
}

function showStruck() {
  byId("strike").hidden = byId("strike-key").hidden = !strikable();
  const items = struckOnes().map((one) => {
    const back = element("button", { type: "button" }, "take back");
    back.setAttribute("aria-label", `Take back reception ${one.index + 1}`);
    back.addEventListener("click", () => strike(one));
    const show = element("button", { type: "button" }, `${clockText(one.time)}, ${data.receivers[one.receiver]?.name ?? one.receiver + 1}`);
    show.addEventListener("click", () => { setTime(one.time); select(one.index); });
    return element("li", {}, show, back);
  });
  byId("strike-list").replaceChildren(...items);
  byId("strike-none").disabled = byId("strike-save").disabled = !items.length;
}

function strikeStatus(text) { byId("strike-status").textContent = text; }

// ---------------------------------------------------------------- the estimator, in a worker

// Runs the replayer, a program of standard input and output (WASI); nothing else reaches it.
function work() {
  const run = async (module, input) => {
    const bytes = new TextEncoder().encode(input), written = { 1: [], 2: [] }, EBADF = 8, ENOSYS = 52;
    let at = 0, memory, code = 0;
    const view = () => new DataView(memory.buffer);
    const pieces = function* pieces(vectors, count) {
      for (let i = 0; i < count; i += 1) yield [view().getUint32(vectors + 8 * i, true), view().getUint32(vectors + 8 * i + 4, true)];
    };
    const ends = Symbol("ends"), wasi = {
      fd_read(file, vectors, count, total) {
        if (file !== 0) return EBADF;
        const begin = at;
        for (const [to, length] of pieces(vectors, count)) {
          const piece = bytes.subarray(at, at + length);
          new Uint8Array(memory.buffer).set(piece, to);
          at += piece.length;
        }
        view().setUint32(total, at - begin, true);
        return 0;
      },
      fd_write(file, vectors, count, total) {
        if (!written[file]) return EBADF;
        let sum = 0;
        for (const [from, length] of pieces(vectors, count)) {
          written[file].push(new Uint8Array(memory.buffer).slice(from, from + length));
          sum += length;
        }
        view().setUint32(total, sum, true);
        return 0;
      },
      environ_sizes_get(count, size) { view().setUint32(count, 0, true); view().setUint32(size, 0, true); return 0; },
      environ_get: () => 0, fd_close: () => 0, fd_prestat_get: () => EBADF, fd_filestat_get: () => EBADF,
      proc_exit(status) { code = status; throw ends; },
    };
    for (const { name } of WebAssembly.Module.imports(module)) wasi[name] ||= () => ENOSYS;
    const { exports } = await WebAssembly.instantiate(module, { wasi_snapshot_preview1: wasi });
    memory = exports.memory;
    try { exports._start(); } catch (error) { if (error !== ends) throw error; }
    const text = async (file) => new Blob(written[file]).text();
    if (code !== 0) throw new Error(await text(2));
    return JSON.parse(await text(1));
  };
  self.onmessage = async ({ data: { module, input, number } }) => {
    try { self.postMessage({ number, result: await run(module, input) }); }
    catch (error) { self.postMessage({ number, error: String(error.message || error) }); }
  };
}

let replayer = null, worker = null, number = 0, busy = false, again = false;

// The replayer as it stands in the page: WebAssembly, compressed, in base64.
async function compile() {
  const bytes = Uint8Array.from(atob(byId("replayer").textContent), (letter) => letter.charCodeAt(0));
  const inflated = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return WebAssembly.compile(await new Response(inflated).arrayBuffer());
}

async function replayed(list = struckText()) {
  number += 1;
  const mine = number, input = `${logLines.join("\n")}\n\n${list}`;
  replayer ||= compile();
  const module = await replayer;
  if (mine !== number) return null;
  // What is still on its way is of no use any more.
  if (worker && busy) { worker.terminate(); worker = null; }
  if (!worker) {
    const address = URL.createObjectURL(new Blob([`(${work})()`], { type: "text/javascript" }));
    worker = new Worker(address);
    URL.revokeObjectURL(address);
  }
  busy = true;
  return new Promise((done, failed) => {
    worker.onmessage = ({ data: { number: answered, result, error } }) => {
      if (answered !== number) return;
      busy = false;
      if (error) failed(new Error(error)); else done(result);
    };
    worker.onerror = (event) => { busy = false; failed(new Error(event.message || "the worker failed")); };
    worker.postMessage({ module, input, number: mine });
  });
}

function showReplayed(result) {
  data.searches.forEach((search, index) => {
    const now = result ? result.searches[index] : search.first;
    search.beliefs = result ? now.beliefs : search.original;
    search.regions = now.regions; search.rivals = now.rivals; search.heat = now.heat;
    // Of all receptions; without some of them it is not known.
    search.smoothed = result ? undefined : search.first.smoothed;
    // Estimators of a version without rows have no remarks either.
    search.remarksOfAll = Boolean(result) && search.first.rows.length > 0 && !now.rows && search.beliefs.length > 0;
    search.remarks = search.remarksOfAll ? search.first.remarks : now.remarks || [];
    search.rows = search.remarksOfAll ? search.first.rows : now.rows || [];
    search.of_rows = search.remarksOfAll ? search.first.of_rows : now.of_rows;
    search.failure = search.beliefs.length ? null : now.outcome;
    search.unpacked = new Map();
  });
  const steps = result && new Map(result.received.map((step) => [idText(step.id), step]));
  for (const one of received) {
    const step = steps ? one.id && steps.get(idText(one.id)) : one.original;
    if (step) { one.used = step.used; one.nis = step.nis || undefined; }
  }
  window.foxhunt.fixes = result ? result.fixes : null;
  refresh();
}

// How far the last estimates moved from those that the page came with.
function moved() {
  return data.searches.map((search) => {
    const [now, before] = [search.beliefs.at(-1), search.original.at(-1)];
    if (before && !now) return `${search.name} is ${search.failure}`;
    return now && before ? `${search.name} moves by ${fixed(Math.hypot(now.place[0] - before.place[0], now.place[1] - before.place[1]), 2)} m` : null;
  }).filter(Boolean).join(", ");
}

// Metres that rounding in the page may account for.
const ROUNDED = 0.01;

// How far the page's own estimators are from the program that wrote the page where nothing was changed, in metres;
// null until they have run. They may be of an older version.
let drift = null;

function driftOf(result) {
  const apart = data.searches.map((search, index) => {
    const [now, before] = [result.searches[index].beliefs.at(-1), search.original.at(-1)];
    return now && before ? Math.hypot(now.place[0] - before.place[0], now.place[1] - before.place[1]) : Number(Boolean(now) !== Boolean(before));
  });
  return Math.max(0, ...apart);
}

const driftText = () => (drift > ROUNDED ? ` The estimators in this page are older than the program that wrote it: with nothing changed their place differs by ${fixed(drift, 2)} m. Save the list for ${readsList()}.` : "");

async function restrike() {
  showStruck();
  shownTurn = undefined;
  redraw();
  const count = new Set(struckOnes().map(({ id }) => idText(id))).size, receptions = `${count} reception${count === 1 ? "" : "s"} struck out`;
  if (!isChanged()) {
    number += 1;
    showReplayed(null);
    strikeStatus(count ? `${receptions}.` : "");
    return;
  }
  strikeStatus(`${receptions}; replaying …`);
  const begun = performance.now();
  try {
    if (drift === null && !data.live) {
      const unchanged = await replayed(struckText(received.filter((one) => one.original.struck)));
      if (!unchanged) return;
      drift = driftOf(unchanged);
    }
    const result = await replayed();
    if (!result) return;
    showReplayed(result);
    if (again) { again = false; restrike(); return; }
    strikeStatus(`${receptions}: ${moved()} (replayed in ${fixed((performance.now() - begun) / 1000, 1)} s).${driftText()}`);
  } catch (error) {
    strikeStatus(`${receptions}. The page cannot replay: ${error.message}`);
  }
}

byId("strike-save").addEventListener("click", () => {
  const address = URL.createObjectURL(new Blob([struckText()], { type: "application/jsonl" }));
  element("a", { href: address, download: "struck.jsonl" }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
});
byId("strike-open").addEventListener("change", async (event) => {
  const [file] = event.target.files;
  if (!file) return;
  try { strikeAll(readStruck(await file.text())); } catch (error) { strikeStatus(`${file.name}, ${error.message}`); }
  event.target.value = "";
});
byId("strike-none").addEventListener("click", () => strikeAll(new Set()));
showStruck();
if (struckOnes().length) strikeStatus(`${struckOnes().length} struck out when this page was written.`);
