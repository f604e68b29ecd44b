// Elements from data. Text is only ever set as text: names come from files.

/** Make an element: make("button", { class: "main", onclick }, "text", child, ...). */
export function make(tag, attributes = {}, ...children) {
  const svg = ["svg", "path", "rect", "circle", "line", "text", "title"].includes(tag);
  const element = svg ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (value !== false && value != null) element.setAttribute(key, value === true ? "" : value);
  }
  element.append(...children.filter((child) => child != null && child !== false));
  return element;
}

export const facts = (pairs) =>
  make("dl", {}, ...pairs.flatMap(([term, value]) => [make("dt", {}, term), make("dd", {}, value)]));

export const number = (value, digits = 1) => value.toFixed(digits);

export const words = (text) => text.replaceAll("_", " ");

/** Whether each of some words, in small letters, begins a word of a text. */
export function hasWords(text, wish) {
  const spaced = ` ${text.toLowerCase().replace(/[^\p{L}\p{N}]+/gu, " ")}`;
  return wish.every((word) => spaced.includes(` ${word}`));
}

/** The sign over the scene that says what is waited for. */
export class Busy {
  constructor(element) { this.element = element; }

  show(text) {
    this.element.querySelector(".busy-text").textContent = text;
    this.element.hidden = false;
  }

  hide() { this.element.hidden = true; }
}
