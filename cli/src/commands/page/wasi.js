// A host of WASI (preview 1) whose files are in memory: the program reads the files that it is given and writes
// beside them; it reaches no network, no disk and no terminal.
//
// `files` maps paths to bytes, and holds what was written besides when the program has ended. `print` is given each
// piece of standard output (1) and standard error (2). Returns the program's exit code.
async function runProgram(module, args, files, print) {
  const BADF = 8, EXIST = 20, INVAL = 28, ISDIR = 31, NOENT = 44, NOSYS = 52, NOTDIR = 54;
  const REGULAR = 4, FOLDER = 3, ROOT = 3;
  const text = new TextEncoder(), read = new TextDecoder();
  const folders = new Set([""]), open = new Map([[ROOT, { path: "" }]]);
  for (const path of files.keys()) {
    const parts = path.split("/");
    for (let count = 1; count < parts.length; count += 1) folders.add(parts.slice(0, count).join("/"));
  }
  let memory, code = 0, nextFile = ROOT + 1;
  const ends = Symbol("ends");
  const view = () => new DataView(memory.buffer), bytes = () => new Uint8Array(memory.buffer);
  const u32 = (at, value) => { view().setUint32(at, value, true); return 0; };
  const u64 = (at, value) => { view().setBigUint64(at, BigInt(value), true); return 0; };
  const pieces = (vectors, count) => Array.from({ length: count }, (_, i) => {
    const from = view().getUint32(vectors + 8 * i, true);
    return bytes().subarray(from, from + view().getUint32(vectors + 8 * i + 4, true));
  });
  // The path from the root, without "." and "..".
  const pathOf = (folder, at, length) => {
    const parts = [];
    for (const part of [open.get(folder)?.path || "", read.decode(bytes().slice(at, at + length))].join("/").split("/")) {
      if (part === "..") parts.pop();
      else if (part && part !== ".") parts.push(part);
    }
    return parts.join("/");
  };
  const contents = (file) => file.bytes.subarray(0, file.length);
  const list = (texts) => texts.map((one) => text.encode(`${one}\0`));
  const sizes = (texts) => (count, size) => { u32(count, texts.length); return u32(size, list(texts).reduce((sum, one) => sum + one.length, 0)); };
  const get = (texts) => (table, at) => {
    for (const one of list(texts)) { u32(table, at); bytes().set(one, at); table += 4; at += one.length; }
    return 0;
  };
  const stat = (to, path) => {
    const file = files.get(path);
    bytes().fill(0, to, to + 64);
    u64(to + 8, [...path].reduce((hash, letter) => (hash * 31 + letter.codePointAt(0)) % 2 ** 40, 7));
    bytes()[to + 16] = file ? REGULAR : FOLDER;
    u64(to + 24, 1);
    return u64(to + 32, file ? file.length : 0);
  };
  const reserve = (file, length) => {
    if (length <= file.bytes.length) return;
    const larger = new Uint8Array(Math.max(length, 2 * file.bytes.length, 65536));
    larger.set(contents(file));
    file.bytes = larger;
  };
  const readAt = (file, at, vectors, count) => {
    let sum = 0;
    for (const piece of pieces(vectors, count)) {
      const part = file.bytes.subarray(Math.min(at, file.length), Math.min(at + piece.length, file.length));
      piece.set(part);
      at += part.length;
      sum += part.length;
    }
    return sum;
  };
  const at = (handle) => { const one = open.get(handle); return one && files.get(one.path) ? { one, file: files.get(one.path) } : null; };
  const wasi = {
    args_sizes_get: sizes(args), args_get: get(args), environ_sizes_get: sizes([]), environ_get: get([]),
    clock_time_get: (_, __, to) => u64(to, BigInt(Math.round(Date.now() * 1e6))),
    clock_res_get: (_, to) => u64(to, 1000000),
    random_get(to, length) {
      for (let from = 0; from < length; from += 65536) crypto.getRandomValues(bytes().subarray(to + from, to + Math.min(from + 65536, length)));
      return 0;
    },
    sched_yield: () => 0,
    proc_exit(status) { code = status; throw ends; },
    fd_prestat_get(handle, to) {
      if (handle !== ROOT) return BADF;
      u32(to, 0);
      return u32(to + 4, 1);
    },
    fd_prestat_dir_name(handle, to) { if (handle !== ROOT) return BADF; bytes()[to] = 47; return 0; },
    fd_fdstat_get(handle, to) {
      bytes().fill(0, to, to + 24);
      const one = open.get(handle);
      if (handle > 2 && !one) return BADF;
      // Standard streams are files, so that nothing is taken for a terminal.
      bytes()[to] = one && folders.has(one.path) ? FOLDER : REGULAR;
      u64(to + 8, 0x1fffffffn);
      return u64(to + 16, 0x1fffffffn);
    },
    fd_fdstat_set_flags: () => 0,
    fd_filestat_get(handle, to) { const one = open.get(handle); return one ? stat(to, one.path) : BADF; },
    fd_filestat_set_size(handle, size) {
      const found = at(handle);
      if (!found) return BADF;
      reserve(found.file, Number(size));
      found.file.length = Number(size);
      return 0;
    },
    fd_close(handle) { return open.delete(handle) || handle < 3 ? 0 : BADF; },
    fd_sync: () => 0, fd_datasync: () => 0, fd_advise: () => 0,
    fd_read(handle, vectors, count, total) {
      if (handle === 0) return u32(total, 0);
      const found = at(handle);
      if (!found) return BADF;
      const sum = readAt(found.file, found.one.at, vectors, count);
      found.one.at += sum;
      return u32(total, sum);
    },
    fd_pread(handle, vectors, count, from, total) {
      const found = at(handle);
      return found ? u32(total, readAt(found.file, Number(from), vectors, count)) : BADF;
    },
    fd_write(handle, vectors, count, total) {
      const parts = pieces(vectors, count), sum = parts.reduce((length, part) => length + part.length, 0);
      if (handle === 1 || handle === 2) {
        for (const part of parts) print(handle, part.slice());
        return u32(total, sum);
      }
      const found = at(handle);
      if (!found) return BADF;
      const { one, file } = found;
      if (one.appends) one.at = file.length;
      reserve(file, one.at + sum);
      for (const part of parts) { file.bytes.set(part, one.at); one.at += part.length; }
      file.length = Math.max(file.length, one.at);
      return u32(total, sum);
    },
    fd_seek(handle, by, from, to) {
      const found = at(handle);
      if (!found) return handle < 3 ? 70 : BADF;
      const place = [0, found.one.at, found.file.length][from] + Number(by);
      if (!(place >= 0)) return INVAL;
      found.one.at = place;
      return u64(to, place);
    },
    fd_tell(handle, to) { const found = at(handle); return found ? u64(to, found.one.at) : BADF; },
    fd_readdir(handle, to, length, cookie, used) {
      const one = open.get(handle);
      if (!one || !folders.has(one.path)) return BADF;
      const within = one.path ? `${one.path}/` : "";
      const names = [...files.keys(), ...folders].filter((path) => path && path.startsWith(within) && !path.slice(within.length).includes("/"));
      let at = to;
      for (let index = Number(cookie); index < names.length && at < to + length; index += 1) {
        const name = text.encode(names[index].slice(within.length)), entry = new Uint8Array(24 + name.length), head = new DataView(entry.buffer);
        head.setBigUint64(0, BigInt(index + 1), true);
        head.setUint32(16, name.length, true);
        entry[20] = files.has(names[index]) ? REGULAR : FOLDER;
        entry.set(name, 24);
        bytes().set(entry.subarray(0, to + length - at), at);
        at += Math.min(entry.length, to + length - at);
      }
      return u32(used, at - to);
    },
    path_open(folder, _, path, length, how, rights, ___, flags, to) {
      const name = pathOf(folder, path, length), isFolder = folders.has(name);
      const [creates, wantsFolder, isNew, empties] = [1, 2, 4, 8].map((bit) => Boolean(how & bit));
      if (isFolder && creates) return isNew ? EXIST : ISDIR;
      if (!isFolder) {
        const parent = name.split("/").slice(0, -1).join("/");
        if (files.has(name) && isNew) return EXIST;
        if (wantsFolder) return files.has(name) ? NOTDIR : NOENT;
        if (!files.has(name) && !(creates && folders.has(parent))) return NOENT;
        if (!files.has(name) || empties) files.set(name, { bytes: new Uint8Array(0), length: 0 });
      }
      open.set(nextFile, { path: name, at: 0, appends: Boolean(flags & 1) });
      nextFile += 1;
      return u32(to, nextFile - 1);
    },
    path_filestat_get(folder, _, path, length, to) {
      const name = pathOf(folder, path, length);
      return files.has(name) || folders.has(name) ? stat(to, name) : NOENT;
    },
    path_create_directory(folder, path, length) {
      const name = pathOf(folder, path, length);
      if (files.has(name) || folders.has(name)) return EXIST;
      folders.add(name);
      return 0;
    },
    path_unlink_file(folder, path, length) { return files.delete(pathOf(folder, path, length)) ? 0 : NOENT; },
    path_rename(folder, from, length, other, to, size) {
      const [before, after] = [pathOf(folder, from, length), pathOf(other, to, size)];
      if (!files.has(before)) return NOENT;
      files.set(after, files.get(before));
      files.delete(before);
      return 0;
    },
  };
  for (const { name } of WebAssembly.Module.imports(module)) wasi[name] ||= () => NOSYS;
  const { exports } = await WebAssembly.instantiate(module, { wasi_snapshot_preview1: wasi });
  memory = exports.memory;
  try { exports._start(); } catch (error) { if (error !== ends) throw error; }
  return code;
}
