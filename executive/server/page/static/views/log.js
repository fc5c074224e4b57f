/** The lines of the run's log: filtered, and grey after the time cursor. */

import { withoutIds } from "../api.js";
import { byId, element } from "../dom.js";

/** @typedef {import("../model/cursor.js").Cursor} Cursor */
/** @typedef {import("../model/history.js").History} History */
/** @typedef {History["lines"][number]} Line */

const SHOWN = 500; // largest number of shown lines
const LONGEST = 2000; // largest number of characters of a line
const REQUEST = /^POST \/api\//; // line about a request; other lines describe its effect
const ENDS = /** @type {Record<string, string>} */ ({ SUCCEEDED: "is done", CANCELED: "is canceled", ABORTED: "failed" });
const LEVELS = /** @type {[number, string][]} */ ([[40, "error"], [30, "warning"], [20, "info"], [0, "debug"]]);

/** Shows the log of the run. */
export class LogView {
  #list = byId("log", HTMLElement);
  #search = byId("log-search", HTMLInputElement);
  #level = byId("log-level", HTMLSelectElement);
  #cursor;
  /** @type {History | null} */
  #history = null;
  #filter = "";
  /** @type {Line | undefined} the newest line that was drawn or filtered out */
  #newest;
  /** @type {{ time: number, item: HTMLElement }[]} */
  #shown = [];
  #past = 0; // number of shown lines up to the cursor
  #grown = false; // True if lines were added since the last `scroll`
  #atEnd = true; // False if the user has scrolled away from the newest line

  /** @param {Cursor} cursor */
  constructor(cursor) {
    this.#cursor = cursor;
    for (const control of [this.#search, this.#level])
      control.addEventListener("input", () => {
        if (this.#history) this.draw(this.#history);
        this.scroll();
      });
    this.#list.addEventListener("keydown", (event) => this.#key(event));
    this.#list.addEventListener("scroll", () => {
      const { scrollTop, clientHeight, scrollHeight } = this.#list;
      this.#atEnd = scrollTop + clientHeight >= scrollHeight - 4;
    });
  }

  /** Move the focus by arrows between the times of lines. Tab reaches only the list. @param {KeyboardEvent} event */
  #key(event) {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    const times = this.#shown.map(({ item }) => /** @type {HTMLElement} */ (item.firstElementChild));
    const focused = times.findIndex((each) => each === document.activeElement);
    times.at(focused < 0 ? (step > 0 ? 0 : -1) : Math.min(Math.max(focused + step, 0), times.length - 1))?.focus();
  }

  /** @param {History} history of the run that is shown */
  draw(history) {
    const wanted = this.#search.value.trim().toLowerCase();
    const filter = `${this.#level.value} ${wanted}`;
    if (history !== this.#history || filter !== this.#filter) this.#clear();
    this.#history = history;
    this.#filter = filter;
    const least = Number(this.#level.value);
    const lines = history.lines.slice(history.lines.lastIndexOf(/** @type {Line} */ (this.#newest)) + 1);
    this.#newest = lines.at(-1) ?? this.#newest;
    this.#add(lines.map(inWords).filter((line) => line.level >= least && passes(line.message, wanted)));
    this.#markTime();
  }

  /** Show the newest line. Call this last, because it needs the layout of the page. */
  scroll() {
    if (this.#grown && this.#atEnd) this.#list.scrollTop = this.#list.scrollHeight;
    this.#grown = false;
  }

  #clear() {
    this.#list.replaceChildren();
    this.#shown = [];
    this.#past = 0;
    this.#newest = undefined;
  }

  /** @param {Line[]} lines */
  #add(lines) {
    if (lines.length === 0) return;
    const added = lines.slice(-SHOWN).map((line) => ({ time: line.time, item: this.#item(line) }));
    this.#list.append(...added.map(({ item }) => item));
    this.#shown.push(...added);
    const old = this.#shown.splice(0, this.#shown.length - SHOWN);
    for (const { item } of old) item.remove();
    this.#past = Math.max(0, this.#past - old.length);
    this.#grown = true;
  }

  /** @param {Line} line */
  #item({ time, level, message }) {
    const [, name] = LEVELS.find(([least]) => level >= least) ?? [0, "debug"];
    const at = element("button", { type: "button", class: "at", tabindex: -1 }, `${time.toFixed(2)} s`);
    at.addEventListener("click", () => this.#cursor.seek(time));
    const text = message.length > LONGEST ? `${message.slice(0, LONGEST)} …` : message;
    const words = element("span", {}, level >= 30 ? `${name}: ${text}` : text);
    return element("li", { "data-level": name, class: "later" }, at, words);
  }

  /** Grey out the lines after the cursor. */
  #markTime() {
    const after = this.#shown.findIndex(({ time }) => time > this.#cursor.time + 1e-6);
    const past = after < 0 ? this.#shown.length : after;
    const changed = this.#shown.slice(Math.min(past, this.#past), Math.max(past, this.#past));
    for (const { item } of changed) item.classList.toggle("later", past < this.#past);
    this.#past = past;
  }
}

/**
 * Return a line for people: without identities, and with the page's words for the state of a goal.
 * A line about a request gets the lowest level.
 * @param {Line} line
 * @returns {Line}
 */
function inWords(line) {
  const message = withoutIds(line.message).replace(/\bended (SUCCEEDED|CANCELED|ABORTED)\b/, (_, state) => ENDS[state]);
  return { ...line, message, level: REQUEST.test(message) ? 0 : line.level };
}

/**
 * Return true if a text has all given words, and no word that is given with a minus.
 * @param {string} text
 * @param {string} wanted the words, in lower case
 */
function passes(text, wanted) {
  const lower = text.toLowerCase();
  return wanted
    .split(/\s+/)
    .every((word) => (word.startsWith("-") && word.length > 1 ? !lower.includes(word.slice(1)) : lower.includes(word)));
}
