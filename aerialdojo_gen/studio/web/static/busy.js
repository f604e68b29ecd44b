// The sign over the scene that says what is waited for.

export class Busy {
  constructor(element) { this.element = element; }

  show(text) {
    this.element.querySelector(".busy-text").textContent = text;
    this.element.hidden = false;
  }

  hide() { this.element.hidden = true; }
}
