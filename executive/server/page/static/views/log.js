/** The lines of the run's log: filtered, and led by the time cursor. */

import { byId, element } from "../dom.js";

/** @typedef {import("../model/cursor.js").Cursor} Cursor */
/** @typedef {import("../model/history.js").History} History */

const SHOWN = 500; // newest lines
const LONGEST = 2000; // characters of a line
const LEVELS = /** @type {[number, string][]} */ ([[40, "error"], [30, "warning"], [20, "info"], [0, "debug"]]);

/** Shows the log of the run. */
export class LogView {
  #list = byId("log", HTMLElement);
  #search = byId("log-search", HTMLInputElement);
  #level = byId("log-level", HTMLSelectElement);
  #cursor;
  /** @type {History | null} */
  #history = null;
  #key = "";
  #marked = -1; // number of lines up to the cursor

  /** @param {Cursor} cursor */
  constructor(cursor) {
    this.#cursor = cursor;
    for (const control of [this.#search, this.#level])
      control.addEventListener("input", () => this.#history && this.draw(this.#history));
  }

  /** @param {History} history of the run that is shown */
  draw(history) {
    const wanted = this.#search.value.trim().toLowerCase();
    const key = `${history.version} ${this.#level.value} ${wanted}`;
    if (history === this.#history && key === this.#key) return this.#markTime();
    const atEnd = this.#list.scrollTop + this.#list.clientHeight >= this.#list.scrollHeight - 4;
    this.#history = history;
    this.#key = key;
    const least = Number(this.#level.value);
    const lines = history.lines.filter((line) => line.level >= least && passes(line.message, wanted));
    this.#list.replaceChildren(...lines.slice(-SHOWN).map((line) => this.#line(line)));
    if (atEnd) this.#list.scrollTop = this.#list.scrollHeight;
    this.#marked = -1;
    this.#markTime();
  }

  /** @param {History["lines"][number]} line */
  #line({ time, level, message }) {
    const [, name] = LEVELS.find(([least]) => level >= least) ?? [0, "debug"];
    const at = element("button", { type: "button", class: "at" }, `${time.toFixed(2)} s`);
    at.addEventListener("click", () => this.#cursor.seek(time));
    const text = message.length > LONGEST ? `${message.slice(0, LONGEST)} …` : message;
    const item = element("li", { "data-level": name }, at, element("span", {}, level >= 30 ? `${name}: ${text}` : text));
    item.dataset.time = String(time);
    return item;
  }

  /** Lines that come after the cursor are quiet. */
  #markTime() {
    const items = /** @type {HTMLElement[]} */ ([...this.#list.children]);
    const after = items.findIndex((item) => Number(item.dataset.time) > this.#cursor.time + 1e-6);
    const count = after < 0 ? items.length : after;
    if (count === this.#marked) return;
    this.#marked = count;
    for (const [index, item] of items.entries()) item.classList.toggle("later", index >= count);
  }
}

/**
 * Return whether a text has all words that are wanted, and none that follows a minus.
 * @param {string} text
 * @param {string} wanted in lower case
 */
function passes(text, wanted) {
  const lower = text.toLowerCase();
  return wanted
    .split(/\s+/)
    .every((word) => (word.startsWith("-") && word.length > 1 ? !lower.includes(word.slice(1)) : lower.includes(word)));
}
