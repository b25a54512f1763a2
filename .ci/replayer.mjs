// Runs two replayers on logs and compares their answers: node replayer.mjs COMMITTED BUILT LOG...
// The committed one is WebAssembly, the other a program of this machine.
// Exits with 1 where the answers have another shape; prints by how much numbers differ.

import { spawnSync } from "node:child_process";
import { closeSync, mkdtempSync, openSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { WASI } from "node:wasi";

// What two compilers' roundings may make of one answer, relative to its size.
const TOLERANCE = 1e-6;

const [committed, built, ...logs] = process.argv.slice(2);
const folder = mkdtempSync(join(tmpdir(), "replayer-"));

function answerOfProgram(program, input) {
  const run = spawnSync(program, { input, maxBuffer: 2 ** 30 });
  if (run.status !== 0) throw new Error(`${program} ends with ${run.status}: ${run.stderr}`);
  return JSON.parse(run.stdout);
}

async function answerOfModule(program, input) {
  const files = ["in", "out", "err"].map((name) => join(folder, name));
  writeFileSync(files[0], input);
  const [stdin, stdout, stderr] = files.map((file, index) => openSync(file, index === 0 ? "r" : "w"));
  const wasi = new WASI({ version: "preview1", stdin, stdout, stderr, returnOnExit: true });
  const module = await WebAssembly.compile(readFileSync(program));
  const instance = await WebAssembly.instantiate(module, wasi.getImportObject());
  const code = wasi.start(instance);
  [stdin, stdout, stderr].forEach(closeSync);
  if (code !== 0) throw new Error(`${program} ends with ${code}: ${readFileSync(files[2], "utf8")}`);
  return JSON.parse(readFileSync(files[1], "utf8"));
}

// The lists that are struck out: nothing, every fifth reception, the first two.
function lists(log) {
  const events = log.trim().split("\n").slice(1).map((line) => JSON.parse(line));
  const received = events.filter((event) => event.event === "received");
  const ids = received.map(({ drone, reception: { beacon, time } }) => ({ drone, beacon, time }));
  if (!ids.length) throw new Error("the log holds no reception");
  return [[], ids.filter((_, index) => index % 5 === 0), ids.slice(0, 2)];
}

// The largest relative difference of numbers; throws where the shapes differ.
function difference(a, b, path = "") {
  if (typeof a === "number" && typeof b === "number") return Math.abs(a - b) / Math.max(1, Math.abs(a), Math.abs(b));
  if (typeof a !== typeof b || (a === null) !== (b === null)) throw new Error(`${path}: ${JSON.stringify(a)} became ${JSON.stringify(b)}`);
  if (a === null || typeof a !== "object") {
    return a === b ? 0 : 1;
  }
  const keys = [Object.keys(a), Object.keys(b)].map((names) => names.sort().join());
  // Lists of cells may differ in length, as the numbers do.
  if (Array.isArray(a)) return a.length === b.length ? Math.max(0, ...a.map((value, index) => difference(value, b[index], `${path}[${index}]`))) : 1;
  if (keys[0] !== keys[1]) throw new Error(`${path}: the fields ${keys[0]} became ${keys[1]}`);
  return Math.max(0, ...Object.keys(a).map((key) => difference(a[key], b[key], `${path}.${key}`)));
}

try {
  let worst = 0;
  for (const file of logs) {
    const log = readFileSync(file, "utf8").trim();
    for (const list of lists(log)) {
      const input = `${log}\n\n${[{ foxhunt_struck: 1 }, ...list].map((line) => JSON.stringify(line)).join("\n")}\n`;
      const [before, now] = [await answerOfModule(committed, input), answerOfProgram(built, input)];
      worst = Math.max(worst, difference(before, now, file));
    }
  }
  console.log(worst <= TOLERANCE
    ? `${logs.length} logs: the committed replayer answers as the sources do (${worst.toExponential(1)})`
    : `STALE: the committed replayer's numbers differ from those of the sources, by ${worst.toExponential(1)} of their size`);
} catch (error) {
  console.error(`${error.message}\nthe format changed: .ci/replayer --renew`);
  process.exitCode = 1;
} finally {
  rmSync(folder, { recursive: true });
}
