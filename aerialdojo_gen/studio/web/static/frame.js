// The frame around what is selected: a tint would change the colours that one is to see.

/** The twelve edges of a box, each a flat list of two points. */
export function edges([low, high]) {
  const corner = (bits) => [0, 1, 2].map((axis) => (bits >> axis & 1 ? high[axis] : low[axis]));
  return [0, 1, 2, 3, 4, 5, 6, 7].flatMap((a) => [1, 2, 4].filter((bit) => !(a & bit)).map((bit) => [...corner(a), ...corner(a | bit)]));
}

/** Frame a node of a SceneView by its name; null takes the frame away. */
export function frameNode(view, node, { margin = 0.05, colour = "#38bdf8" } = {}) {
  const k = node ? view.index.get(node) : undefined;
  if (k === undefined) {
    view.remove("frame");
    return;
  }
  const [low, high] = [0, 3].map((at) => [...view.payload.boxes.subarray(6 * k + at, 6 * k + at + 3)]);
  const around = [low.map((v) => v - margin), high.map((v) => v + margin)];
  view.addRoutes("frame", edges(around).map((points, id) => ({ id, points, colour })), { width: 2.5, opacity: 1, pickable: false });
}
