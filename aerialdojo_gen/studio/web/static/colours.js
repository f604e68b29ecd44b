// Colours of the page: settings, and clearance from tight (red) to open (blue), told apart by the colour-blind too.

export const SETTING = { base: "#0ea5e9", standard: "#f59e0b", long_horizon: "#c026d3" };
export const OBJECT = "#facc15", LANDMARK = "#ffffff", ANCHOR = "#86efac", GOAL = "#22c55e", START = "#38bdf8";

const STOPS = [[0.25, [165, 0, 38]], [0.5, [244, 109, 67]], [1, [254, 224, 144]], [2, [116, 173, 209]], [5, [49, 54, 149]]];
const hex = (rgb) => "#" + rgb.map((v) => Math.round(v).toString(16).padStart(2, "0")).join("");

export function clearanceColour(metres) {
  if (metres <= STOPS[0][0]) return hex(STOPS[0][1]);
  for (let k = 1; k < STOPS.length; k++) {
    const [low, from] = STOPS[k - 1], [high, to] = STOPS[k];
    if (metres <= high) {
      const share = Math.log(metres / low) / Math.log(high / low);
      return hex(from.map((v, c) => v + (to[c] - v) * share));
    }
  }
  return hex(STOPS.at(-1)[1]);
}

export const clearanceStops = STOPS.map(([metres, rgb]) => [metres, hex(rgb)]);
