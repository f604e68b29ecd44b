// The side panel: what was picked, told in words and figures.
import { clearanceColour } from "./colours.js";
import { facts, make, number, words } from "./dom.js";
import { SPEEDS } from "./flight.js";

const MOST_LISTED = 12;

/** Put something else into the panel, which begins at its top. */
function put(panel, ...children) {
  panel.replaceChildren(...children);
  panel.scrollTop = 0;
}

export function welcome(panel) {
  put(panel, make("h2", {}, "Click something"),
    make("p", {}, "An object tells its name, description, reference image and the tasks that look for it. A route tells its length, "
      + "clearance and actions. Anything else tells its node in the mesh."));
}

export function failure(panel, error) {
  put(panel, make("p", { class: "error", role: "alert" }, String(error.message ?? error)));
}

export function showNode(panel, hit) {
  const { category, variant, attributes } = hit.instance;
  put(panel, make("h2", {}, hit.node), facts([
    ["category", words(category)], ...(variant ? [["variant", words(variant)]] : []),
    ...Object.entries(attributes).map(([key, value]) => [words(key), value]),
    ["point", hit.point.map((v) => number(v, 2)).join(", ") + " m"],
  ]), make("p", { class: "soft" }, "Not a target: no task looks for it."));
}

export function showLandmark(panel, landmark, objects, actions) {
  put(panel, make("h2", {}, landmark.name), make("p", { class: "soft" }, "landmark"),
    facts([["node", landmark.node], ["centre", landmark.position.map((v) => number(v, 2)).join(", ") + " m"],
      ["nearest for", `${objects.length} objects`]]),
    make("ul", { class: "list" }, ...objects.map((object) => make("li", {}, make("button",
      { onclick: () => actions.object(object.object_id) }, object.name, make("small", {}, ` ${object.direction}`))))));
}

export function showObject(panel, object, routes, actions) {
  put(panel, ...[
    make("h2", {}, object.name),
    make("p", { class: "soft" }, `${words(object.category)} · ${object.direction} of the ${object.landmark}`),
    object.image && make("img", { src: `api/objects/${object.object_id}/image`, alt: `Reference image: ${object.name}`,
      width: 300, height: 300 }),
    make("blockquote", {}, object.description),
    facts([["object", object.object_id], ["node", object.mesh_node],
      ["centre", object.position.map((v) => number(v, 2)).join(", ") + " m"],
      ["size", object.size.map((v) => number(v, 2)).join(" × ") + " m"]]),
    make("h3", {}, `${routes.length.toLocaleString("en")} routes lead to it`),
    routes.length > 0 && make("div", { class: "buttons" },
      make("button", { id: "only-these", onclick: () => actions.only(object.object_id) }, "Show only these"),
      make("button", { id: "list-these", onclick: () => actions.list(object.object_id) }, "List them all")),
    make("ul", { class: "list" }, ...routes.slice(0, MOST_LISTED).map((route) => routeItem(route, actions))),
    routes.length > MOST_LISTED && make("p", { class: "soft" }, `and ${routes.length - MOST_LISTED} more`),
  ].filter(Boolean));
}

const routeItem = (route, actions) => make("li", {}, make("button", { onclick: () => actions.route(route.nav_id) },
  `${words(route.setting)}, ${number(route.length_m)} m `, make("small", {}, `from ${route.start}`)));

export function showRoute(panel, route, detail, actions) {
  const semantic = detail.tasks.find((task) => task.modality === "semantic");
  const task = semantic ?? detail.tasks[0];
  put(panel, ...[
    make("h2", { id: "picked-route" }, route.nav_id),
    make("p", { class: "soft" }, `${words(route.setting)} · ${route.split}`),
    make("p", {}, "From ", link(route.start, () => actions.object(route.start_object_id)), " to ",
      link(route.target, () => actions.object(route.target_object_id))),
    task && make("blockquote", {}, make("strong", {}, `${task.target_name}, ${task.direction} of the ${task.landmark}. `),
      semantic?.description ?? ""),
    facts([
      ["length L", `${number(route.length_m, 2)} m`], ["straight d_E", `${number(route.euclidean_m, 2)} m`],
      ["detour κ", number(route.detour_ratio, 3)], ["least clearance", `${number(route.min_clearance_m, 2)} m`],
      ["actions", `${route.n_actions}${task ? ` of ${task.action_budget}` : ""}`],
      ...detail.tasks.map((t) => [t.modality, t.task_id]),
    ]),
    make("h3", {}, "Height, clearance as colour"), profile(detail),
    make("h3", {}, "Fly along"),
    make("div", { class: "buttons" },
      make("button", { id: "play", title: "Space", onclick: () => actions.play() }, "Play"),
      make("label", { for: "speed", class: "soft" }, "Speed"),
      make("select", { id: "speed", onchange: (event) => actions.speed(Number(event.target.value)) },
        ...SPEEDS.map((speed) => make("option", { value: speed, selected: speed === 1 }, `${speed} ×`)))),
    make("div", { class: "buttons more" },
      make("button", { id: "ride", "aria-pressed": "false", onclick: () => actions.ride() }, "From on board"),
      make("button", { onclick: () => actions.whole() }, "Whole route")),
    make("label", { for: "step", class: "soft" }, "Pose ", make("output", { id: "pose" }, "0"), ` of ${detail.poses.length - 1}`),
    make("input", { id: "step", type: "range", min: 0, max: detail.poses.length - 1, value: 0,
      oninput: (event) => actions.step(Number(event.target.value)) }),
    make("p", { class: "mono", id: "doing" }),
    make("h3", {}, "Actions"), make("p", { class: "mono" }, runs(detail.actions)),
  ].filter(Boolean));
}

const link = (text, act) => make("button", { onclick: act }, text);

function runs(actions) {
  const out = [];
  for (const action of actions) {
    if (out.length && out.at(-1)[0] === action) out.at(-1)[1]++;
    else out.push([action, 1]);
  }
  return out.map(([action, times]) => (times > 1 ? `${action} ×${times}` : action)).join(", ");
}

function profile({ way, clearance_m: clearance }) {
  const along = [0];
  for (let k = 1; k < way.length; k++) along.push(along[k - 1] + Math.hypot(...way[k].map((v, j) => v - way[k - 1][j])));
  const heights = way.map((p) => p[2]), low = Math.min(...heights), high = Math.max(...heights), span = Math.max(2, high - low);
  const x = (s) => 30 + 262 * s / (along.at(-1) || 1), y = (z) => 76 - 62 * (z - low) / span;
  const pieces = way.slice(1).map((p, k) => make("line", { x1: x(along[k]), y1: y(way[k][2]), x2: x(along[k + 1]), y2: y(p[2]),
    stroke: clearanceColour(Math.min(clearance[k], clearance[k + 1])), "stroke-width": 4, "stroke-linecap": "round" }));
  const text = (at, up, content, anchor = "end") =>
    make("text", { x: at, y: up, "font-size": 10.5, "text-anchor": anchor }, content);
  return make("svg", { viewBox: "0 0 300 96", class: "chart", role: "img" },
    make("title", {}, `Height from ${number(low)} to ${number(high)} m over ${number(along.at(-1))} m of route`),
    text(26, y(low) + 4, number(low)), ...(high - low > 0.5 ? [text(26, y(high) + 4, number(high))] : []), ...pieces,
    text(30, 92, "0", "middle"), text(292, 92, `${number(along.at(-1))} m`));
}
