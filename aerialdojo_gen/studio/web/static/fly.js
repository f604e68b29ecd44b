// The page of `aerialdojo-gen fly`: what an agent sees, and its sixteen actions as keys and buttons.
import { Busy, make, number } from "./dom.js";

const POLL_MS = 500;
const $ = (id) => document.getElementById(id);
const views = [...document.querySelectorAll("[data-view]")];
const busy = new Busy($("busy"));

// By physical keys, so that the pad keeps its shape on every layout: the column is the direction, the row the distance.
const ACTIONS = [
  [0, "Enter", "Enter", "Stop", null],
  [6, "KeyQ", "Q", "Left 5 m", "pad"], [3, "KeyW", "W", "Forward 5 m", "pad"], [9, "KeyE", "E", "Right 5 m", "pad"],
  [5, "KeyA", "A", "Left 3 m", "pad"], [2, "KeyS", "S", "Forward 3 m", "pad"], [8, "KeyD", "D", "Right 3 m", "pad"],
  [4, "KeyZ", "Z", "Left 1 m", "pad"], [1, "KeyX", "X", "Forward 1 m", "pad"], [7, "KeyC", "C", "Right 1 m", "pad"],
  [14, "ArrowLeft", "←", "Turn left 15°", "turns"], [15, "ArrowRight", "→", "Turn right 15°", "turns"],
  [11, "KeyR", "R", "Up 2 m", "heights"], [13, "KeyT", "T", "Down 2 m", "heights"],
  [10, "KeyF", "F", "Up 1 m", "heights"], [12, "KeyG", "G", "Down 1 m", "heights"],
];
const SIGNS = { Left: "←", Right: "→", Forward: "↑", Up: "▲", Down: "▼", "Turn left": "↺", "Turn right": "↻" };
const named = new Map(ACTIONS.map(([action, , , name]) => [action, name]));
let state = { version: -1, phase: "busy" }, sending = false, depth = false, task = -1;

async function ask(url, body) {
  const response = await fetch(url, body && { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) });
  const found = await response.json();
  // Another tab was faster: what it led to is shown here, too.
  if (response.status === 409) return found.state;
  if (!response.ok) throw new Error(found.error ?? `${url}: ${response.status}`);
  return found;
}

/** Send what the person chose, once; what is pressed meanwhile is dropped. */
async function send(url, more = {}) {
  if (sending) return;
  sending = true;
  enable();
  const slow = setTimeout(() => busy.show("Getting ready …"), POLL_MS);
  try {
    await show(await ask(url, { version: state.version, ...more }));
  } catch (error) {
    ended(error);
  }
  clearTimeout(slow);
  sending = false;
  enable();
}

function act(action) {
  if (state.phase !== "flying" || sending) return;
  const button = document.querySelector(`[data-action="${action}"]`);
  button.classList.add("pressed");
  send("api/act", { action }).finally(() => button.classList.remove("pressed"));
}

function ended(error) {
  const gone = error instanceof TypeError;
  busy.hide();
  cover(gone ? "The command has ended" : "The flight cannot go on", [gone ? "Start it again; finished flights are kept." : String(error.message)], "", "bad");
}

const loaded = (image, url) => new Promise((resolve) => {
  image.onload = image.onerror = resolve;
  image.src = url;
});

const pictures = () => Promise.all(views.map((figure) =>
  loaded(figure.querySelector("img"), `api/${depth ? "depth" : "pictures"}/${figure.dataset.view}?version=${state.version}`)));

function cover(title, lines, button = "", kind = "") {
  $("cover").hidden = !title;
  if (!title) return;
  $("dialog").className = kind;
  $("dialog-title").textContent = title;
  $("dialog-text").replaceChildren(...lines.map((line) => make("p", {}, line)));
  $("go").hidden = !button;
  $("go").replaceChildren(make("kbd", {}, "Enter"), ` ${button}`);
  if (button) $("go").focus();
}

function enable() {
  for (const button of document.querySelectorAll("[data-action], #depth")) button.disabled = state.phase !== "flying";
}

function goal() {
  const g = state.goal, picture = $("goal-picture");
  $("target").textContent = `Find: ${g.target_name}`;
  $("where").textContent = `It is ${g.direction} of the landmark nearest to it, the ${g.landmark}.`
    + (g.heading ? ` At the start you face ${g.heading.direction} (${g.heading.heading_deg}° clockwise from north).` : "");
  $("description").textContent = g.description ?? "";
  $("description").hidden = !g.description;
  picture.hidden = !g.has_image;
  if (g.has_image) {
    $("goal-image").src = `api/pictures/goal?task=${state.flown}`;
    $("goal-image").alt = `The goal: ${g.target_name}`;
    $("goal-from").textContent = g.image_distance_m ? `Taken from ${number(g.image_distance_m, 2)} m behind the goal viewpoint.`
      : g.image_distance_m === 0 ? "Taken from the goal viewpoint." : "";
  }
  $("rule").textContent = `Stop within ${g.success_radius_m} m of the goal viewpoint, about 1 m in front of the target. A collision ends the flight.`;
  $("most").textContent = `${Math.round(g.max_depth_m)} m`;
}

function flying() {
  const { goal: g, remaining_actions: left, refused, last } = state, share = left / g.action_budget;
  $("task").textContent = `Task ${state.flown + 1} of ${state.selected}`;
  $("left").textContent = `${left} of ${g.action_budget} actions left`;
  $("meter").setAttribute("aria-valuenow", left);
  $("meter").setAttribute("aria-valuemax", g.action_budget);
  $("meter").classList.toggle("low", left <= 10);
  $("meter").firstElementChild.style.setProperty("width", `${100 * share}%`);
  $("last").textContent = last == null ? "You are at the start." : refused
    ? `${named.get(last)}: refused, it would leave the flight area. It cost an action.` : `${named.get(last)}: done.`;
  $("last").classList.toggle("wrong", refused);
  if (task !== state.flown) goal();
  task = state.flown;
}

const ENDINGS = {
  stop: (r) => (r.success ? ["Success", `You stopped ${number(r.distance_m)} m from the goal viewpoint.`]
    : ["Missed", `You stopped ${number(r.distance_m)} m from the goal viewpoint.`]),
  collision: (r) => ["Collision", `You hit something ${number(r.distance_m)} m from the goal viewpoint.`],
  budget: (r) => ["Out of actions", `You were ${number(r.distance_m)} m from the goal viewpoint, and had not stopped.`],
};

function outcome() {
  const [title, line] = ENDINGS[state.result.termination](state.result);
  return [title, [`${line} The flight took ${state.result.n_actions} actions.`,
    `${state.flown} of ${state.selected} flown, ${state.successes} with success. This flight is saved.`], state.result.success ? "good" : "bad"];
}

const COVERS = {
  consent: () => cover("Fly as an agent", [
    "You see what an agent sees: four cameras, the goal, the actions that are left. Find the target, fly to it and stop in front of it.",
    `Every finished flight is saved in ${state.log}, in the run ${state.run}, as ${state.agent}: the task, your actions, where they led and how long `
      + "they took. Nothing else about you is recorded. Whoever has the folder can share it.",
    `${state.flown} of ${state.selected} tasks are flown. A task can be flown once; a flight that you break off is not saved.`], "I agree, begin"),
  ended: () => { const [title, lines, kind] = outcome(); cover(title, lines, "Next task", kind); },
  done: () => {
    const [title, lines, kind] = state.result ? outcome() : ["", [], ""];
    cover(title || "All tasks are flown", [...lines, "There are no more tasks in this selection. Thank you! You can close this page and end the command."], "", kind);
  },
  failed: () => cover("The flight cannot go on", [state.error, "Finished flights are kept."], "", "bad"),
};

/** Show a state: pictures first, so that text and pictures change together. */
async function show(next) {
  const before = state.version;
  state = next;
  if (state.phase === "busy") {
    busy.show("Getting ready …");
    setTimeout(poll, POLL_MS);
    return;
  }
  if (state.phase === "flying" && state.version !== before) await pictures();
  busy.hide();
  (COVERS[state.phase] ?? (() => cover("")))();
  if (state.phase === "flying") flying();
  enable();
  document.body.dataset.phase = state.phase;
  document.body.dataset.version = state.version;
}

async function poll() {
  try {
    await show(await ask("api/state"));
  } catch (error) {
    ended(error);
  }
}

for (const [action, code, key, name, group] of ACTIONS) {
  if (!group) continue;
  const [, word, size] = name.match(/^(.*) (\d+ ?\S)$/);
  $(group).append(make("button", { "data-action": action, "aria-label": name, "aria-keyshortcuts": key.length === 1 ? key : code, title: name },
    make("kbd", {}, key), `${SIGNS[word]} ${size}`));
}
for (const button of document.querySelectorAll("[data-action]")) {
  button.addEventListener("click", (event) => {
    act(Number(button.dataset.action));
    // After a click by mouse the keys are the page's again.
    if (event.detail) button.blur();
  });
}
function toggleDepth() {
  depth = !depth;
  $("depth").setAttribute("aria-pressed", String(depth));
  $("scale").hidden = !depth;
  pictures();
}
$("depth").addEventListener("click", (event) => { toggleDepth(); if (event.detail) $("depth").blur(); });
$("go").addEventListener("click", () => send(state.phase === "consent" ? "api/agree" : "api/next"));
for (const figure of views) {
  figure.addEventListener("click", async (event) => {
    if (state.phase !== "flying") return;
    const box = figure.getBoundingClientRect();
    const [x, y] = [(event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height].map((v) => Math.min(0.9999, Math.max(0, v)));
    const { depth_m: metres } = await ask(`api/depth/${figure.dataset.view}/at?x=${x}&y=${y}`);
    $("reading").textContent = metres ? `${figure.dataset.view}: ${metres} m deep there` : `${figure.dataset.view}: nothing in range there`;
  });
}
addEventListener("keydown", (event) => {
  if (event.repeat || event.ctrlKey || event.altKey || event.metaKey || state.phase !== "flying") return;
  if (event.target.closest?.("button") && ["Enter", "Space"].includes(event.code)) return;
  const found = ACTIONS.find(([, code]) => code === event.code || (code === "Enter" && event.code === "NumpadEnter"));
  if (!found && event.code !== "KeyV") return;
  event.preventDefault();
  if (found) act(found[0]);
  else toggleDepth();
});
enable();
poll();
