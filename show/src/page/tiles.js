// ---------------------------------------------------------------- the map below all else

const { zooms, attribution } = embedded || data.live.tiles;
const KEPT_TILES = 500, MOST_SHOWN = 200, MOST_LEVELS_UP = 6;
const tiles = new Map();

// Web Mercator: the whole Earth is one tile at zoom 0.
const toColumn = (lon, zoom) => ((lon + 180) / 360) * 2 ** zoom;
const toRow = (lat, zoom) => (0.5 - Math.asinh(Math.tan((lat * Math.PI) / 180)) / TAU) * 2 ** zoom;
const toLon = (column, zoom) => (column / 2 ** zoom) * 360 - 180;
const toLat = (row, zoom) => (Math.atan(Math.sinh(TAU * (0.5 - row / 2 ** zoom))) * 180) / Math.PI;
const corner = (column, row, zoom) => earth.toLocal(toLat(row, zoom), toLon(column, zoom));

// A tile that was requested; without an image until it came, and where there is none.
function tileOf(zoom, column, row) {
  const key = `${zoom}/${column}/${row}`;
  let tile = tiles.get(key);
  if (!tile) {
    // North-West, North-East and South-West.
    const corners = [corner(column, row, zoom), corner(column + 1, row, zoom), corner(column, row + 1, zoom)];
    tile = { zoom, column, row, corners, image: null, came: false };
    tiles.set(key, tile);
    if (tiles.size > KEPT_TILES) tiles.delete(tiles.keys().next().value);
    imageOf(key)
      .then((image) => { tile.image = image; if (image) redraw(); })
      .catch(() => {})
      .finally(() => { tile.came = true; });
  }
  return tile;
}

// The image of a tile; null where there is none. A live page gets it from the program (live.js).
let imageOf = async (key) => {
  const text = embedded.images[key];
  if (!text) return null;
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return createImageBitmap(new Blob([bytes]));
};

// Draws a part of a tile, from a corner on, so many tiles wide.
function drawPart({ image, corners: [from, east, south] }, left, top, share) {
  const ratio = window.devicePixelRatio || 1;
  const [px, py] = [x(from[0]), y(from[1])];
  context.setTransform(
    ratio * (x(east[0]) - px), ratio * (y(east[1]) - py), ratio * (x(south[0]) - px), ratio * (y(south[1]) - py), ratio * px, ratio * py,
  );
  // Half a pixel more, so that no line of ground shows between two of them.
  const more = 0.5 / Math.max(Math.hypot(x(east[0]) - px, y(east[1]) - py), 1);
  context.drawImage(
    image, left * image.width, top * image.height, share * image.width, share * image.height, left, top, share + more, share + more,
  );
}

// A tile, or what a coarser level has of it.
function drawTile(zoom, column, row) {
  for (let up = 0; up <= MOST_LEVELS_UP && zoom - up >= zooms[0]; up += 1) {
    const parts = 2 ** up, tile = tileOf(zoom - up, Math.floor(column / parts), Math.floor(row / parts));
    if (tile.image) {
      drawPart(tile, (column % parts) / parts, (row % parts) / parts, 1 / parts);
      return;
    }
  }
}

drawTiles = () => {
  const ratio = window.devicePixelRatio || 1;
  const pixels = TAU * 6378137 * Math.cos((data.origin[0] * Math.PI) / 180) * view.scale * ratio;
  const zoom = Math.min(Math.max(Math.round(Math.log2(pixels / 256)), zooms[0]), zooms[1]);
  const corners = [[0, 0], [view.width, 0], [0, view.height], [view.width, view.height]].map((at) => earth.toDegrees(toPlace(...at)));
  const most = 2 ** zoom - 1, within = (value) => Math.min(Math.max(Math.floor(value), 0), most);
  const columns = corners.map(([, lon]) => within(toColumn(lon, zoom))), rows = corners.map(([lat]) => within(toRow(lat, zoom)));
  const [west, east, north, south] = [Math.min(...columns), Math.max(...columns), Math.min(...rows), Math.max(...rows)];
  if (!((east - west + 1) * (south - north + 1) <= MOST_SHOWN)) return;
  context.save();
  for (let row = north; row <= south; row += 1) for (let column = west; column <= east; column += 1) drawTile(zoom, column, row);
  context.restore();
  // Fainter than what is drawn on it, and more so for a phone in the sun.
  context.fillStyle = look.veil; context.fillRect(0, 0, view.width, view.height);
};

// Whose map it is; as text alone, as it may be HTML of anybody.
const owner = new DOMParser().parseFromString(attribution || "", "text/html").body.textContent.trim();
if (owner) byId("map-box").append(element("p", { id: "attribution" }, `Map: ${owner}`));
window.foxhunt.tiles = tiles;
