// The page of `aerialdojo-gen build-scenes --watch`: a plan's scene, again whenever the file is saved.
import { addCompass } from "./compass.js";
import { Busy, facts, make, number, words } from "./dom.js";
import { frameNode } from "./frame.js";
import { SceneView } from "./scene.js";

const POLL_MS = 700;
const $ = (id) => document.getElementById(id);
const busy = new Busy($("busy"));
let view = null, shown = null, state = {};

/** Replace the scene; the camera stays where it was. */
async function show() {
  const element = make("div", { class: "scene-view" });
  const camera = view && { eye: view.camera.position.toArray(), target: view.controls.orbit.target.toArray() };
  $("scene").replaceChildren(element);
  view?.renderer.dispose();
  view = await SceneView.load(element, `api/scene?version=${state.version}`);
  if (camera) view.controls.lookFrom(camera.eye, camera.target);
  addCompass(view, view.overlay);
  view.onPick(picked);
  window.view = view;
}

function picked(hit) {
  const node = hit?.kind === "node" ? hit : null;
  frameNode(view, node?.node ?? null);
  if (!node) return;
  const { category, variant, attributes } = node.instance, entry = state.entries[node.node];
  $("picked").replaceChildren(make("h2", {}, node.node), facts([
    ["category", words(category)], ...(variant ? [["variant", words(variant)]] : []),
    ...(entry ? [["entry", `${entry.entry}, line ${entry.line}`]] : []),
    ...Object.entries(attributes).map(([key, value]) => [words(key), value]),
    ["point", node.point.map((v) => number(v, 2)).join(", ") + " m"],
  ]));
}

function tell() {
  document.title = `${state.name} · aerialdojo-gen build-scenes`;
  $("title").textContent = state.name;
  $("subtitle").textContent = state.n_triangles === undefined ? ""
    : `${state.n_triangles.toLocaleString("en")} triangles · ${state.n_instances} things · built in ${state.seconds} s`;
  $("error").hidden = !state.error;
  $("error").textContent = state.error;
}

async function follow() {
  try {
    const response = await fetch("api/state");
    const next = await response.json();
    if (!response.ok) throw new Error(next.error);
    if (next.version !== state.version) {
      state = next;
      tell();
      // What cannot be built leaves the last scene in place.
      if (!state.error || (!view && state.n_triangles)) await show();
      document.body.dataset.version = state.version;
    }
  } catch (error) {
    $("error").hidden = false;
    $("error").textContent = error instanceof TypeError ? "The command has ended: start it again." : String(error.message);
  }
  busy.hide();
  setTimeout(follow, POLL_MS);
}

$("home").addEventListener("click", () => view?.home());
$("top").addEventListener("click", () => view?.top());
follow();
