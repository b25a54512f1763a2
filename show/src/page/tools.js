// ---------------------------------------------------------------- measuring, range rings, the legend

let measuring = false, measuredPlaces = [];

function measure(on) {
  measuring = on;
  measuredPlaces = [];
  byId("measure").setAttribute("aria-pressed", String(on));
  byId("measured").hidden = !on;
  byId("measured").textContent = on ? "Choose places on the map." : "";
  redraw();
}

function addMeasured(place) {
  measuredPlaces.push(place);
  const legs = measuredPlaces.slice(1).map((to, i) => [to[0] - measuredPlaces[i][0], to[1] - measuredPlaces[i][1]]);
  const total = legs.reduce((sum, leg) => sum + Math.hypot(...leg), 0), last = legs.at(-1);
  const bearing = last && String(Math.round(compass(Math.atan2(last[1], last[0]))) % 360).padStart(3, "0");
  byId("measured").textContent = !last ? "From here; choose the next place."
    : `${metres(Math.hypot(...last))} towards ${bearing}°${legs.length > 1 ? `, ${metres(total)} in all` : ""}`;
  redraw();
}
byId("measure").addEventListener("click", () => measure(!measuring));

function drawMeasured() {
  if (!measuredPlaces.length) return;
  context.lineJoin = "round";
  for (const [width, colour] of [[6, look.paper], [2.5, look.ink]]) {
    context.lineWidth = width; context.strokeStyle = colour;
    path(measuredPlaces); context.stroke();
    for (const [e, n] of measuredPlaces) { context.beginPath(); context.arc(x(e), y(n), 5, 0, TAU); context.stroke(); }
  }
}

// About the chosen reception, or else the first fix, or the last reception.
function ringsCentre() {
  const one = received[state.selected];
  if (one) return one.place;
  const belief = data.searches.map((search) => beliefAt(search, state.time)).find(Boolean);
  return belief ? belief.place : received[countUntil(receivedTimes, state.time) - 1]?.place;
}

function drawRings() {
  const centre = ringsCentre();
  if (!centre) return;
  const step = nice(70 / view.scale), [px, py] = [x(centre[0]), y(centre[1])], MOST = 8;
  context.lineWidth = 1.5; context.strokeStyle = look.ink; context.globalAlpha = 0.6;
  for (let ring = 1; ring <= MOST; ring += 1) {
    context.beginPath(); context.arc(px, py, ring * step * view.scale, 0, TAU); context.stroke();
  }
  context.globalAlpha = 1;
  for (let ring = 1; ring <= MOST; ring += 1) label(step >= 1000 ? `${(ring * step) / 1000} km` : `${+(ring * step).toPrecision(6)} m`, px + 3, py - ring * step * view.scale - 3, look.ink);
}

function drawTools() {
  if (state.layers.rings) drawRings();
  drawMeasured();
}

// ---------------------------------------------------------------- what colours and dashes mean

function showLegend() {
  const items = [], line = (attributes) => drawn("path", { d: "M0 8h30", fill: "none", ...attributes });
  const add = (text, ...shapes) => {
    const picture = drawn("svg", { viewBox: "0 0 30 16", "aria-hidden": "true" });
    picture.append(...shapes);
    items.push(element("li", {}, picture, text));
  };
  const bar = (text, colours, before) => items.push(element("li", {}, before, element("span", { class: "bar", style: `background:linear-gradient(90deg,${colours.join()})`, "aria-hidden": "true" }), text));
  const { layers } = state, shares = [0, 0.25, 0.5, 0.75, 1];
  const levels = received.some((one) => one.level) && highest > lowest;
  if (levels && ((layers.places && !hasBearings) || layers.levels)) bar(`${fixed(highest, 0)} ${levelUnit}, strongest`, shares.map(shareColour), `weakest, ${fixed(lowest, 0)} ${levelUnit}`);
  if (layers.levels && data.searches.some((search) => search.level_map)) add("the fainter the map of the level, the less is known", drawn("rect", { width: 30, height: 16, fill: shareColour(0.6), opacity: 0.3 }));
  if (layers.heat) {
    for (const [share, opacity] of CREDIBLE) add(`${100 * share} %`, drawn("rect", { width: 30, height: 16, fill: searchColour(0), opacity }));
  }
  if (layers.searched && data.searched) bar("100 % detected, if it were there", shares.map((share) => searchedColour(share)), "0 %");
  if (layers.paths && data.receivers.length > 1 && data.receivers.length <= 12) {
    data.receivers.forEach((receiver, i) => add(`${i + 1} ${receiver.name}`, drawn("circle", { cx: 15, cy: 8, r: 7, fill: receiverColour(i) })));
  }
  const stroke = receiverColour(0);
  if (layers.bearings && hasBearings) {
    add("bearing that is used", line({ stroke, "stroke-width": 2.5 }));
    if (received.some((one) => one.bearing && !one.used && !one.struck)) add("bearing that is not used", line({ stroke, "stroke-width": 2.5, "stroke-dasharray": "6 5" }));
  }
  if (received.some((one) => one.struck)) add("struck out", line({ stroke: look.faint, "stroke-width": 2, "stroke-dasharray": "2 7" }), drawn("path", { d: "M10 3l10 10M20 3l-10 10", stroke: look.ink, "stroke-width": 2.5 }));
  if (layers.places && received.some((one) => !one.level && !one.bearing)) add("nothing received", drawn("circle", { cx: 15, cy: 8, r: 4, fill: "none", stroke: look.faint, "stroke-width": 1.5 }));
  if (layers.estimates && data.searches.some((search) => search.beliefs.length > 1)) add("way of the estimate", line({ stroke: searchColour(0), "stroke-width": 1.5, "stroke-dasharray": "3 3" }));
  if (layers.truth && data.searches.some((search) => search.truth.length > 1)) add("way of the truth", line({ stroke: look.ink, "stroke-width": 1.5, "stroke-dasharray": "8 4" }));
  byId("legend").replaceChildren(...items);
}
