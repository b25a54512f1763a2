// ---------------------------------------------------------------- a hunt that goes on

if (hasTiles) {
  imageOf = (key) => {
    // Without a connection it is requested again later.
    const later = () => { setTimeout(() => tiles.delete(key), 5000); };
    return fetch(`tiles/${key}`)
      .then((answer) => (answer.status === 200 ? answer.blob() : null), later)
      .then((blob) => blob && createImageBitmap(blob));
  };
}

// Adds what is new; what is sent twice after a reconnection never arrives, by the number of each event.
function take(news) {
  data.span = news.span;
  news.receivers.forEach((receiver, index) => {
    if (!data.receivers[index]) data.receivers[index] = { name: receiver.name, path: [] };
    data.receivers[index].path.push(...receiver.path);
    (data.receivers[index].health ??= []).push(...(receiver.health ?? []));
  });
  news.searches.forEach((search, index) => {
    if (!data.searches[index]) data.searches[index] = { ...search, truth: [], beliefs: [] };
    const known = data.searches[index];
    known.outcome = search.outcome;
    known.truth.push(...search.truth);
    (known.original || known.beliefs).push(...search.beliefs);
  });
  addReceived(news.received);
  data.notices.push(...news.notices);
}

// Where each receiver is to go next, by its number, and the way there from where it was last.
const next = new Map();
function showNext() {
  const ways = [...next].map(([index, [east, north]]) => {
    const receiver = data.receivers[index], here = receiver?.path.at(-1);
    if (!here) return null;
    const far = Math.hypot(east - here[1], north - here[2]);
    const towards = String(Math.round(compass(Math.atan2(north - here[2], east - here[1]))) % 360).padStart(3, "0");
    return `${receiver.name}: ${far.toFixed(0)} m towards ${towards}°, to ${directed([east, north])}`;
  });
  const text = ways.filter(Boolean).join("; ");
  byId("next").textContent = text ? `Next place — ${text}` : "";
  byId("next").hidden = !text;
}

let waiting = [], shown = 0;
function showNews() {
  shown = 0;
  const follows = state.time >= end - 1e-6;
  const searches = data.searches.length;
  for (const { news, log, sent } of waiting.splice(0)) {
    take(news);
    logLines.push(...log);
    for (const [index, east, north] of sent ?? []) next.set(index, [east, north]);
  }
  showNext();
  if (data.searches.length !== searches) view.moved = false;
  refresh();
  if (follows && !state.playing) { state.time = end; redraw(); }
  showStruck();
  // A replay that runs is not broken off: where many come none would end.
  if (isChanged()) { if (busy) again = true; else restrike(); }
}

function liveStatus(text, good) {
  byId("live-status").textContent = text;
  byId("live").classList.toggle("cut", !good);
}

byId("live").hidden = false;
liveStatus("connecting …", false);
// Reconnects by itself, and names the last event that came.
const source = new EventSource("events");
source.addEventListener("open", () => liveStatus("live", true));
source.addEventListener("error", () => {
  liveStatus(source.readyState === EventSource.CLOSED ? "the connection was refused; reload the page" : "no connection; trying again …", false);
});
source.addEventListener("message", (event) => {
  waiting.push(JSON.parse(event.data));
  window.foxhunt.lastEvent = event.lastEventId;
  // Many come at once to who joins late.
  if (!shown) shown = setTimeout(showNews, 100);
});
source.addEventListener("over", () => {
  source.close();
  liveStatus("the hunt is over", true);
  next.clear();
  showNext();
  byId("break-off").hidden = true;
});
// The program runs another hunt than the one that this page began with.
source.addEventListener("other", () => { source.close(); window.location.reload(); });

if (data.live.orders) {
  byId("break-off").hidden = false;
  byId("break-off").addEventListener("click", async () => {
    if (!window.confirm("Break the flight off? The drones then follow flight.on_abort of its file.")) return;
    try {
      const answer = await fetch("break-off", { method: "POST" });
      liveStatus(answer.ok ? "breaking off …" : `refused: ${answer.status}`, answer.ok);
    } catch (error) { liveStatus(`the order did not arrive: ${error.message}`, false); }
  });
}
window.foxhunt.source = source;
