// Tabs: one of several sections at a time, by click or by the arrows.

export class Tabs {
  /** Sections by their ids; the tab of one is "tab-" and its id. shown(id) is told which one is. */
  constructor(ids, shown) {
    this.ids = ids;
    this.shown = shown;
    ids.forEach((id, k) => {
      const tab = this.tab(id);
      tab.addEventListener("click", () => this.show(id));
      tab.addEventListener("keydown", (event) => {
        const by = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        if (!by) return;
        const next = ids[(k + by + ids.length) % ids.length];
        this.show(next);
        this.tab(next).focus();
      });
    });
  }

  tab(id) { return document.getElementById(`tab-${id}`); }

  show(chosen) {
    for (const id of this.ids) {
      document.getElementById(id).hidden = id !== chosen;
      this.tab(id).setAttribute("aria-selected", String(id === chosen));
      this.tab(id).tabIndex = id === chosen ? 0 : -1;
    }
    this.shown(chosen);
  }
}
