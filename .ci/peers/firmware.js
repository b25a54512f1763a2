// firmata-io drives a stepper through 128 positions of a turn, to and fro, and checks every answer.
// usage: node firmware.js PORT [REPORT]   Prints REPORT (default: what it proved).
"use strict";
const EventEmitter = require("events");
const fs = require("fs");
const tty = require("tty");
const { Firmata } = require("firmata-io");

const port = process.argv[2];
const POSITIONS = 128;
// A 28BYJ-48, exactly: 64 half steps for a turn of the rotor, and its gear.
const HALF_STEPS = (64 * 31 * 32 * 26 * 22) / (9 * 11 * 10 * 9);

const fail = message => {
  console.error(`firmata-io: ${message}`);
  process.exit(1);
};

// The peer's own serialport needs a compiler; a raw terminal needs nothing.
class Terminal extends EventEmitter {
  constructor(path) {
    super();
    this.fd = fs.openSync(path, fs.constants.O_RDWR | fs.constants.O_NOCTTY);
    this.stream = new tty.ReadStream(this.fd);
    this.stream.on("data", data => this.emit("data", data));
    this.stream.on("error", error => this.emit("error", error));
    setImmediate(() => this.emit("open"));
  }
  write(bytes, callback) {
    fs.writeSync(this.fd, Buffer.from(bytes));
    if (callback) callback();
  }
}

const board = new Firmata(new Terminal(port), { reportVersionTimeout: 500 });
board.on("error", error => fail(error));

const done = act => new Promise(resolve => act(resolve));

board.on("ready", async () => {
  const stepper = [8, 9, 10, 11].every(pin => board.pins[pin].supportedModes.includes(board.MODES.STEPPER));
  if (!stepper) fail("pins 8 to 11 are reported as no stepper's");
  board.accelStepperConfig({
    deviceNum: 0, type: board.STEPPER.TYPE.FOUR_WIRE, stepSize: board.STEPPER.STEP_SIZE.HALF,
    motorPin1: 8, motorPin2: 10, motorPin3: 9, motorPin4: 11,
  });
  const go = async to => {
    const at = await done(resolve => board.accelStepperTo(0, to, resolve));
    if (at !== to) fail(`sent to ${to}, done at ${at}`);
    const reported = await done(resolve => board.accelStepperReportPosition(0, resolve));
    if (reported !== to) fail(`done at ${to}, reported at ${reported}`);
  };
  board.accelStepperSpeed(0, 1000);
  for (let i = 1; i <= POSITIONS; i++) await go(Math.round((HALF_STEPS * i) / POSITIONS));
  // Back with ramps.
  board.accelStepperAcceleration(0, 4000);
  for (let i = POSITIONS - 1; i >= 0; i--) await go(Math.round((HALF_STEPS * i) / POSITIONS));
  // Stopped on the way, and a step by a relative order.
  const stopped = await done(resolve => {
    board.accelStepperTo(0, 4000, resolve);
    setTimeout(() => board.accelStepperStop(0), 300);
  });
  if (!(stopped > 0 && stopped < 4000)) fail(`stopped at ${stopped}`);
  await go(1000);
  const at = await done(resolve => board.accelStepperStep(0, -1, resolve));
  if (at !== 999) fail(`a step back from 1000 ended at ${at}`);
  const name = board.firmware.name;
  console.log(`firmata-io: ${name} went through ${2 * POSITIONS} positions; it is at ${at}`);
  process.exit(0);
});
