// Who somebody is in the history: asked for once, whatever port the server takes the next time.
import { byId } from "./dom.js";

const MOST = 80, COOKIE = "aerialdojo-annotate-who";

export class Name {
  /** warn(text) tells a person what is wrong with a name. */
  constructor(warn) {
    this.field = byId("who");
    this.button = byId("who-name");
    this.field.value = known();
    this.show(!this.field.value);
    this.field.addEventListener("change", () => this.changed(warn));
    this.field.addEventListener("blur", () => this.show(!this.value));
    this.button.addEventListener("click", () => { this.show(true); this.field.focus(); });
  }

  /** The name; empty where it is none that can be kept: it is never cut. */
  get value() {
    const name = this.field.value.trim();
    return [...name].length > MOST ? "" : name;
  }

  changed(warn) {
    const wrong = this.value !== this.field.value.trim();
    this.field.setAttribute("aria-invalid", String(wrong));
    if (wrong) warn(`A name has at most ${MOST} characters.`);
    // A cookie, because a start of the server may take another port, and a page's store belongs to one.
    else document.cookie = `${COOKIE}=${encodeURIComponent(this.value)}; Path=/; SameSite=Strict; Max-Age=31536000`;
  }

  /** Show the field, or the name that is known. */
  show(asking) {
    byId("who-field").hidden = !asking;
    this.button.hidden = asking;
    this.button.textContent = this.value;
    this.button.title = `${this.value}: who you are in the history; click to change it`;
  }
}

const known = () => {
  try {
    return decodeURIComponent(document.cookie.split("; ").find((one) => one.startsWith(`${COOKIE}=`))?.slice(COOKIE.length + 1) ?? "");
  } catch {
    return "";
  }
};
