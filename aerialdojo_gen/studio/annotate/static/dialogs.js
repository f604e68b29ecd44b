// The dialogs: a conflict, the history, the keys.
import { byId, h, same } from "./dom.js";

// As many as the server tells.
const MOST_LINES = 200;
const LABELS = { name: "Name", category: "Category", description: "Description", node: "Node", anchor: "Anchor" };

const shown = (value) => {
  if (value == null || value === "") return "—";
  return typeof value === "object" ? `${value.position_m.map((v) => v.toFixed(2)).join(", ")} m, ${value.yaw_deg}°` : value;
};

/** Show both sides of a conflict; resolves to "mine" or "theirs". Closing the dialog keeps theirs. */
export function askConflict({ operation, base, theirs, who, time }) {
  const { do: what, kind, id, fields } = operation;
  const thing = kind === "landmarks" ? "landmark" : "object";
  const mine = what === "remove" ? null : { ...(base ?? {}), ...fields };
  const keys = Object.keys(LABELS).filter((key) => (theirs && key in theirs) || (mine && key in mine));
  const when = time ? ` at ${new Date(time).toLocaleTimeString()}` : "";
  const story = !theirs ? `${who} removed ${thing} ${id}${when} while you were changing it.`
    : what === "add" ? `${who} has made ${thing} ${theirs.id} of the same thing${when}.`
      : what === "remove" ? `${who} changed ${thing} ${id}${when}; you are about to remove it.`
        : `${who} changed ${thing} ${id}${when} while you were changing it.`;
  const row = (key) => {
    const a = theirs ? theirs[key] : undefined, b = mine ? mine[key] : undefined;
    const differs = what === "change" && key in fields && !same(a, b) ? "differs" : null;
    return h("tr", {}, h("th", { scope: "row" }, LABELS[key]),
      h("td", { class: differs }, theirs ? shown(a) : "(removed)"),
      h("td", { class: differs }, mine ? (what === "change" && !(key in fields) ? "(as theirs)" : shown(b)) : "(removed)"));
  };
  const dialog = byId("conflict");
  return new Promise((resolve) => {
    const answer = (choice) => { dialog.returnValue = choice; dialog.close(choice); };
    dialog.replaceChildren(
      h("h2", { id: "conflict-title" }, "Two people, one entry"),
      h("p", {}, `${story} Nothing has been overwritten. Which do you want to keep?`),
      h("table", {}, h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Field"), h("th", { scope: "col" }, `${who}: on disk now`),
        h("th", { scope: "col" }, "You"))), h("tbody", {}, ...keys.map(row))),
      h("div", { class: "row" },
        h("button", { id: "keep-theirs", onclick: () => answer("theirs"), autofocus: true }, "Keep theirs"),
        h("button", { id: "use-mine", class: "main", onclick: () => answer("mine") },
          what === "remove" ? "Remove it" : theirs ? "Use mine" : "Put mine back")));
    dialog.addEventListener("close", () => resolve(dialog.returnValue === "mine" ? "mine" : "theirs"), { once: true });
    dialog.returnValue = "";
    dialog.showModal();
  });
}

export function showHistory(lines) {
  const words = { undo: "undone: ", redo: "redone: ", import: "taken over from a file: ", do: "", outside: "" };
  const dialog = byId("history");
  dialog.replaceChildren(
    h("h2", { id: "history-title" }, lines.length < MOST_LINES ? "History" : `History: the last ${MOST_LINES} changes`),
    lines.length ? h("table", {}, h("thead", {}, h("tr", {}, ...["When", "Who", "What"].map((t) => h("th", { scope: "col" }, t)))),
      h("tbody", {}, ...lines.map((line) => h("tr", {}, h("td", {}, new Date(line.time).toLocaleString()),
        h("td", {}, line.who), h("td", {}, words[line.action] + line.what)))))
      : h("p", {}, "Nothing has been changed with this tool yet."),
    closing(dialog));
  dialog.showModal();
}

const KEYS = [
  ["O", "make the picked thing an object"], ["L", "make it a landmark"], ["N", "next unfinished object, then next anchor to choose"],
  ["J", "next in the list"], ["K", "one before in the list"], ["1 2 3", "choose an anchor (Alt+1 … in a field)"],
  ["B", "box out a thing (imported scenes)"],
  ["V", "place an anchor from this view"], ["G", "go to the selection"], ["F", "fly or orbit"], ["T", "look from above"],
  ["H", "the whole scene"], ["Space", "pick what is in the middle of the view"], ["/", "find"], ["Enter", "to the fields"],
  ["Esc", "out of a field; nothing selected"], ["Ctrl+Enter", "next unfinished, from a field"], ["Ctrl+Z", "undo (in a field: what you typed)"],
  ["Ctrl+Shift+Z", "redo"], ["Delete", "remove the entry"], ["W A S D", "move (in the view)"], ["Q E", "down, up (in the view)"],
  ["Shift", "with these: faster"], ["?", "these keys"],
];

export function showHelp() {
  const dialog = byId("help");
  dialog.replaceChildren(
    h("h2", { id: "help-title" }, "Keys"),
    h("div", { class: "keys" }, ...KEYS.map(([key, what]) => h("p", {}, h("kbd", {}, key), ` ${what}`))),
    h("p", { class: "hint" }, "Drag to look around, the wheel comes closer, the right button moves sideways; a click picks. "
      + "Every change is saved at once; undo takes back your own changes, one by one."),
    closing(dialog));
  dialog.showModal();
}

const closing = (dialog) => h("div", { class: "row" }, h("button", { class: "main", onclick: () => dialog.close() }, "Close"));
