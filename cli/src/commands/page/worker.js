// The worker in which the program runs; `runProgram` stands before it.
self.onmessage = async ({ data: { module, number, args, given, wanted } }) => {
  const say = (kind, value) => self.postMessage({ number, kind, value });
  const decoders = { 1: new TextDecoder(), 2: new TextDecoder() }, rest = { 1: [], 2: [] };
  const line = (stream, one) => {
    if (stream === 2) say("note", one);
    else if (one.startsWith('{"kind":"result"')) say("result", one);
    else if (one.startsWith('{"kind":"progress"')) say("progress", JSON.parse(one).value);
  };
  const print = (stream, piece) => {
    const [first, ...more] = decoders[stream].decode(piece, { stream: true }).split("\n");
    rest[stream].push(first);
    for (const one of more) {
      line(stream, rest[stream].join(""));
      rest[stream] = [one];
    }
  };
  const files = new Map(given.map(([name, bytes]) => [name, { bytes, length: bytes.length }]));
  try {
    const code = await runProgram(module, ["foxhunt", ...args], files, print);
    for (const stream of [1, 2]) if (rest[stream].some(Boolean)) line(stream, rest[stream].join(""));
    const written = wanted.filter((name) => files.has(name)).map((name) => [name, files.get(name).bytes.slice(0, files.get(name).length)]);
    self.postMessage({ number, kind: "end", value: { code, written } }, written.map(([, bytes]) => bytes.buffer));
  } catch (error) {
    say("broken", String(error.message || error));
  }
};
