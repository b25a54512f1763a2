// Runs the program of `foxhunt page` in the page's own host of WASI, without a browser:
// node page.mjs PROGRAM FOXHUNT FILE... compares its answers for each file with those of FOXHUNT.
// Exits with 1 where an answer is missing or has another shape; prints by how much numbers differ.

import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { basename, dirname, resolve } from "node:path";

// The p of residuals are by functions that two C libraries round differently in the last bit.
const TOLERANCE = 1e-15;

const [program, foxhunt, ...paths] = process.argv.slice(2);
const host = readFileSync("cli/src/commands/page/wasi.js", "utf8");
const runProgram = new Function(`${host}\nreturn runProgram;`)();
const module = await WebAssembly.compile(readFileSync(program));

async function answer(args, path) {
  const bytes = new Uint8Array(readFileSync(path)), out = { 1: [], 2: [] };
  const files = new Map([[basename(path), { bytes, length: bytes.length }]]);
  const code = await runProgram(module, ["foxhunt", ...args], files, (stream, piece) => out[stream].push(piece));
  const text = (stream) => Buffer.concat(out[stream]).toString();
  if (code !== 0) throw new Error(`${program} ends with ${code}: ${text(2)}`);
  if (!files.has("report.html")) throw new Error(`${path}: no report page`);
  return JSON.parse(text(1));
}

// The largest relative difference of numbers; throws where the shapes differ.
function difference(a, b, path = "") {
  if (typeof a === "number" && typeof b === "number") return Math.abs(a - b) / Math.max(1, Math.abs(a), Math.abs(b));
  if (a === null || b === null || typeof a !== "object" || typeof b !== "object") {
    if (typeof a !== typeof b || (a === null) !== (b === null)) throw new Error(`${path}: ${JSON.stringify(a)} instead of ${JSON.stringify(b)}`);
    return a === b ? 0 : 1;
  }
  if (Array.isArray(a) && a.length !== b.length) return 1;
  const keys = [Object.keys(a), Object.keys(b)].map((names) => names.sort().join());
  if (keys[0] !== keys[1]) throw new Error(`${path}: the fields ${keys[0]} instead of ${keys[1]}`);
  return Object.keys(a).reduce((most, key) => Math.max(most, difference(a[key], b[key], `${path}.${key}`)), 0);
}

try {
  let worst = 0, same = 0;
  for (const path of paths) {
    const args = ["locate", basename(path), "--every-beacon", "--json"];
    const here = await answer([...args, "--report", "report.html"], path);
    const there = JSON.parse(execFileSync(resolve(foxhunt), args, { cwd: dirname(path), stdio: ["ignore", "pipe", "ignore"], maxBuffer: 1 << 28 }));
    worst = Math.max(worst, difference(here, there, path));
    same += Number(JSON.stringify(here) === JSON.stringify(there));
  }
  console.log(worst <= TOLERANCE
    ? `${same} of ${paths.length} answers of the page's program are the program's to the bit; numbers differ by ${worst.toExponential(1)} at most`
    : `STALE: the numbers of the page's program differ from the program's, by ${worst.toExponential(1)} of their size`);
} catch (error) {
  console.error(`${error.message}\nthe program in the page is too old: .ci/replayer --renew`);
  process.exitCode = 1;
}
