// ---------------------------------------------------------------- fields: the belief, the level, what was searched

// Cumulative probabilities of the heat map, each with the opacity of its colour.
const CREDIBLE = [[0.5, 0.62], [0.8, 0.4], [0.95, 0.22]];
const SEARCHED = "#5b7c99";
// Opacity of a cell that a transmitter would surely have been detected in.
const SEARCHED_OPACITY = 0.7;

const channels = (colour) => [1, 3, 5].map((at) => parseInt(colour.slice(at, at + 2), 16));
const searchedColour = (share) => `rgb(${channels(SEARCHED).join(" ")} / ${SEARCHED_OPACITY * share})`;
const colourChannels = new Map();
// The channels of a colour in any notation.
function resolved(colour) {
  if (!colourChannels.has(colour)) {
    context.fillStyle = colour;
    colourChannels.set(colour, channels(context.fillStyle));
  }
  return colourChannels.get(colour);
}

// Numbers of 12 bits, two characters each, from the South-West to the East.
function unpackNumbers({ low, high, numbers }) {
  const values = new Float32Array(numbers.length / 2);
  for (let i = 0; i < values.length; i += 1) {
    const steps = SIX_BITS.get(numbers.charCodeAt(2 * i)) * 64 + SIX_BITS.get(numbers.charCodeAt(2 * i + 1));
    values[i] = low + ((high - low) * steps) / 4095;
  }
  return values;
}

// A grid of cells: its South-West corner, the side of a cell in metres, columns and values.
function gridOf({ corner, cell, columns }, values) {
  return { corner, cell, columns, rows: values.length / columns, values, picture: null };
}

// The smallest region of highest density that holds each cell, as its probability.
function cumulative(mass) {
  const order = [...mass.keys()].sort((a, b) => mass[b] - mass[a]), levels = new Float32Array(mass.length);
  const total = mass.reduce((sum, value) => sum + value, 0);
  let sum = 0;
  for (const cell of order) { sum += mass[cell]; levels[cell] = sum / total; }
  return levels;
}

// Covariance of some places: of East, of both, of North.
function covariance(places, indices) {
  let east = 0, north = 0;
  for (const i of indices) { east += places[2 * i]; north += places[2 * i + 1]; }
  east /= indices.length; north /= indices.length;
  const sums = [0, 0, 0];
  for (const i of indices) {
    const dx = places[2 * i] - east, dy = places[2 * i + 1] - north;
    sums[0] += dx * dx; sums[1] += dx * dy; sums[2] += dy * dy;
  }
  return sums.map((sum) => sum / indices.length);
}

// The quadratic form of a covariance's inverse.
function nearness([a, b, c]) {
  const determinant = a * c - b * b;
  return (dx, dy) => (c * dx * dx - 2 * b * dx * dy + a * dy * dy) / determinant;
}

// A belief's places, spread by kernels of the shape that the cloud has about them, as raster/mod.rs does.
function heatOfPlaces(places) {
  const count = places.length / 2, SIDE = 72, LOOKS = 32, KERNEL = 3;
  const all = Array.from({ length: count }, (_, i) => i), whole = covariance(places, all), least = 1e-6 + 1e-6 * (whole[0] + whole[2]);
  const away = nearness([whole[0] + least, whole[1], whole[2] + least]), shape = [least, 0, least];
  const looks = all.filter((i) => i % Math.max(Math.ceil(count / LOOKS), 1) === 0);
  for (const look of looks) {
    const distances = Float64Array.from(all, (i) => away(places[2 * i] - places[2 * look], places[2 * i + 1] - places[2 * look + 1]));
    const farthest = distances.slice().sort()[Math.ceil(count / 4) - 1];
    covariance(places, all.filter((i) => distances[i] <= farthest)).forEach((value, i) => { shape[i] += value / looks.length; });
  }
  const kernel = shape.map((value) => value * KERNEL * count ** (-1 / 3)), distance = nearness(kernel), reach = [3 * Math.sqrt(kernel[0]), 3 * Math.sqrt(kernel[2])];
  const from = [0, 1].map((i) => all.reduce((low, k) => Math.min(low, places[2 * k + i]), Infinity) - reach[i]);
  const to = [0, 1].map((i) => all.reduce((most, k) => Math.max(most, places[2 * k + i]), -Infinity) + reach[i]);
  const cell = Math.max(to[0] - from[0], to[1] - from[1]) / SIDE;
  const [columns, rows] = [0, 1].map((i) => Math.max(Math.ceil((to[i] - from[i]) / cell), 1)), mass = new Float32Array(columns * rows);
  const within = (metres, most) => Math.min(Math.max(Math.floor(metres / cell), 0), most - 1);
  for (let i = 0; i < count; i += 1) {
    const dx = places[2 * i] - from[0], dy = places[2 * i + 1] - from[1];
    const [west, east] = [within(dx - reach[0], columns), within(dx + reach[0], columns)];
    for (let line = within(dy - reach[1], rows); line <= within(dy + reach[1], rows); line += 1) {
      for (let column = west; column <= east; column += 1) {
        mass[line * columns + column] += Math.exp(-0.5 * distance((column + 0.5) * cell - dx, (line + 0.5) * cell - dy));
      }
    }
  }
  return gridOf({ corner: from, cell, columns }, cumulative(mass));
}

// A Gaussian by the ellipse that holds 95 %.
function heatOfEllipse([east, north], [a, b, along]) {
  const SIDE = 64, reach = 1.05 * a, cell = (2 * reach) / SIDE, levels = new Float32Array(SIDE * SIDE);
  for (let i = 0; i < levels.length; i += 1) {
    const dx = ((i % SIDE) + 0.5) * cell - reach, dy = (Math.floor(i / SIDE) + 0.5) * cell - reach;
    const u = (Math.cos(along) * dx + Math.sin(along) * dy) / a, v = (Math.cos(along) * dy - Math.sin(along) * dx) / Math.max(b, 1e-6);
    levels[i] = 1 - 0.05 ** (u * u + v * v);
  }
  return gridOf({ corner: [east - reach, north - reach], cell, columns: SIDE }, levels);
}

const heats = new Map();
function forgetHeat() { heats.clear(); fields.clear(); }
function heatOf(search, belief) {
  if (!heats.has(belief)) {
    if (heats.size > 64) heats.clear();
    const isLast = belief === search.beliefs[search.beliefs.length - 1], places = cloudOf(search, belief);
    heats.set(belief, isLast && search.heat ? gridOf(search.heat, unpackNumbers(search.heat))
      : places ? heatOfPlaces(places) : belief.ellipse ? heatOfEllipse(belief.place, belief.ellipse) : null);
  }
  return heats.get(belief);
}

const fields = new Map();
// A field of the data, by its name and what is packed in it.
function fieldOf(name, packed) {
  if (!fields.has(packed)) fields.set(packed, { ...gridOf(packed, unpackNumbers(packed)), sigma: packed.sigma && unpackNumbers({ ...packed.sigma }) });
  return fields.get(packed);
}

// A grid as a picture: red, green, blue and opacity of each cell.
function painted(grid, colour) {
  if (grid.picture) return grid.picture;
  const picture = document.createElement("canvas");
  picture.width = grid.columns; picture.height = grid.rows;
  const pixels = new ImageData(grid.columns, grid.rows);
  for (let i = 0; i < grid.values.length; i += 1) {
    // Pictures begin in the North.
    const at = 4 * ((grid.rows - 1 - Math.floor(i / grid.columns)) * grid.columns + (i % grid.columns)), [r, g, b, opacity] = colour(i);
    pixels.data[at] = r; pixels.data[at + 1] = g; pixels.data[at + 2] = b; pixels.data[at + 3] = 255 * opacity;
  }
  picture.getContext("2d").putImageData(pixels, 0, 0);
  grid.picture = picture;
  return picture;
}

function drawGrid(grid, colour) {
  const picture = painted(grid, colour), [west, south] = grid.corner;
  context.drawImage(picture, x(west), y(south + grid.rows * grid.cell), grid.columns * grid.cell * view.scale, grid.rows * grid.cell * view.scale);
}

function drawFields() {
  if (state.layers.levels) {
    for (const { level_map: packed } of data.searches) {
      if (!packed) continue;
      const grid = fieldOf("level", packed), known = packed.sigma.high || 1;
      drawGrid(grid, (i) => {
        const share = Math.min(Math.max((grid.values[i] - lowest) / Math.max(highest - lowest, 1e-9), 0), 1);
        return [...resolved(shareColour(Math.round(64 * share) / 64)), 0.8 * (1 - 0.9 * Math.min(grid.sigma[i] / known, 1))];
      });
    }
  }
  if (state.layers.searched && data.searched) {
    const grid = fieldOf("searched", data.searched), colour = channels(SEARCHED);
    drawGrid(grid, (i) => [...colour, SEARCHED_OPACITY * grid.values[i]]);
  }
  if (state.layers.heat) {
    data.searches.forEach((search, index) => {
      const belief = beliefAt(search, state.time), grid = belief && heatOf(search, belief);
      if (!grid) return;
      const colour = resolved(searchColour(index));
      drawGrid(grid, (i) => [...colour, CREDIBLE.find(([share]) => grid.values[i] <= share)?.[1] ?? 0]);
    });
  }
}

// Where it is not, in the words of search and rescue.
function showSearched() {
  byId("searched").hidden = !data.searched;
  if (!data.searched) return;
  const percent = (share) => `${fixed(100 * share, 0)} %`, { silences, pos, by_range: ranges } = data.searched;
  byId("searched-text").textContent = `${silences} silences: if the transmitter is in the area that is shown, they would have found it with ${percent(pos)} (POS)${ranges.length > 1 ? ", all ranges from 10 m to 10 km being as probable" : ""}. Point at the map for the probability of detection (POD) there.`;
  const shown = ranges.filter((_, i) => ranges.length === 1 || i % 4 === 0);
  filled(byId("searched-table"), ["heard as far as", "POS", "area with a POD of 95 %"], shown.map(([range, success, area]) => [metres(range), percent(success), percent(area)]));
  // Three short columns fit on any screen.
  byId("searched-table").className = "";
}

// The value of a grid at a place; undefined outside.
function valueIn(grid, [east, north], values = grid.values) {
  const column = Math.floor((east - grid.corner[0]) / grid.cell), line = Math.floor((north - grid.corner[1]) / grid.cell);
  return column >= 0 && column < grid.columns && line >= 0 && line < grid.rows ? values[line * grid.columns + column] : undefined;
}

// What the fields say of a place, as text.
function valueAt(place) {
  const parts = [];
  if (state.layers.levels) {
    for (const { level_map: packed } of data.searches) {
      const grid = packed && fieldOf("level", packed), level = grid && valueIn(grid, place);
      if (level !== undefined && level !== null) parts.push(`${fixed(level, 1)} ± ${fixed(valueIn(grid, place, grid.sigma), 1)} ${levelUnit}`);
    }
  }
  if (state.layers.searched && data.searched) {
    const share = valueIn(fieldOf("searched", data.searched), place);
    if (share !== undefined) parts.push(`POD ${fixed(100 * share, 0)} %`);
  }
  if (state.layers.heat) {
    for (const search of data.searches) {
      const belief = beliefAt(search, state.time), grid = belief && heatOf(search, belief), share = grid && valueIn(grid, place);
      const held = share && CREDIBLE.find(([most]) => share <= most);
      if (held) parts.push(`${data.searches.length > 1 ? `${search.name} ` : ""}within ${100 * held[0]} %`);
    }
  }
  return parts.length ? `  ${parts.join(", ")}` : "";
}
