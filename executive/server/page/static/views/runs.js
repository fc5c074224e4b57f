/** The recordings, with search, filters and deletion; and the goals and tasks of the server. */

import { Refused, get, isSignedIn, pathOf, post, wordsOf } from "../api.js";
import { byId, element, isNew, setAttribute, setText } from "../dom.js";
import { goalTitle } from "../model/run.js";
import { stateWords } from "./header.js";

/** @typedef {import("../model/run.js").Goal} Goal */

/**
 * @typedef {object} Recording
 * @property {string} name
 * @property {number} bytes
 * @property {number} stamp_ns
 * @property {number | null} task
 * @property {string} title
 * @property {string} state SUCCEEDED, CANCELED, ABORTED, UNFINISHED, or empty
 * @property {string} code
 * @property {string} message
 * @property {number | null} duration_s
 * @property {boolean} pinned
 */

const SHOWN = 50; // number of goals to load, and of recordings to add to the list at once
const MOST = 150; // largest number of recordings in one answer
const WAIT = 200; // pause after the last key of a search [ms]
const RETRY = 500; // time until the next request if one failed or a recording is being finished [ms]
const DAY = 24 * 60 * 60 * 1000; // a day [ms]

/** Events: `open` with the Recording to show, `change` when the lists may have changed. */
export class RunsView extends EventTarget {
  #list = byId("runs", HTMLElement);
  #search = byId("runs-search", HTMLInputElement);
  #state = byId("runs-state", HTMLSelectElement);
  #task = byId("runs-task", HTMLSelectElement);
  #day = byId("runs-day", HTMLInputElement);
  #more = byId("runs-more", HTMLButtonElement);
  #note = byId("runs-note", HTMLElement);
  #timer = 0; // timer of a search
  #later = 0; // timer of a refresh
  #asked = 0;
  /** @type {Promise<void> | null} the refresh that is under way */
  #refreshing = null;
  /** @type {Promise<void> | null} the next refresh */
  #next = null;
  #wanted = SHOWN; // number of recordings to list
  #error = ""; // message if the recordings could not be listed
  /** @type {Goal[]} newest first */
  goals = [];
  /** @type {import("./tasks.js").Task[]} */
  tasks = [];
  /** @type {Recording[]} newest first */
  recordings = [];
  /** @type {boolean | undefined} true if the server has goals and tasks */
  hasArm;

  constructor() {
    super();
    for (const filter of [this.#search, this.#state, this.#task, this.#day])
      filter.addEventListener("input", () => {
        clearTimeout(this.#timer);
        this.#wanted = SHOWN;
        this.#timer = setTimeout(() => this.#reload(), WAIT);
      });
    this.#more.addEventListener("click", () => {
      this.#wanted += SHOWN;
      this.#reload();
    });
  }

  /**
   * Load the recordings, goals and tasks. Repeat this until all requests succeed and the recordings
   * of ended goals are finished. There is only one refresh at a time, also after many short goals.
   * @returns {Promise<void>} resolved after a refresh that began with this call or later
   */
  refresh() {
    if (this.#refreshing) {
      this.#next ??= this.#refreshing.then(() => {
        this.#next = null;
        return this.refresh();
      });
      return this.#next;
    }
    const goals = this.#loadGoals().catch((error) => this.#refreshLater(error));
    this.#refreshing = Promise.all([this.#load(), goals]).then(() => {
      this.#refreshing = null;
      if (this.recordings.some((each) => this.isFinishing(each))) this.#refreshLater();
      this.dispatchEvent(new Event("change"));
    });
    return this.#refreshing;
  }

  /**
   * Delete a recording, and offer to restore it.
   * @param {Recording} recording
   */
  async delete(recording) {
    await post(`${pathOf(recording.name)}/delete`);
    const undo = element("button", { type: "button" }, "Undo");
    undo.addEventListener("click", () => this.#restore(recording));
    this.#note.replaceChildren(`Deleted ${nameOf(recording)}. `, undo);
    undo.focus();
    await this.#reload();
  }

  /** @param {string} shown name of the shown recording; empty for none */
  draw(shown) {
    const key = JSON.stringify([shown, isSignedIn(), this.recordings, this.goals]);
    if (!isNew(this.#list, key)) return;
    const items = this.recordings.map((each) => this.#item(each, each.name === shown));
    const focused = this.#list.contains(document.activeElement) ? document.activeElement?.id : "";
    this.#list.replaceChildren(...(items.length ? items : [element("li", { class: "quiet" }, "none")]));
    if (focused) document.getElementById(focused)?.focus({ preventScroll: true });
    this.#drawTasks();
  }

  /**
   * Return the name of the recording of a run; empty if it is not listed.
   * @param {import("../model/run.js").Run} run
   */
  recordingOf({ outcome, active, task }) {
    if (outcome) return outcome.recording.split("/").at(-1) ?? "";
    const written = this.recordings.find((each) => isWritten(each) && each.task === task);
    return (active && written?.name) || "";
  }

  /** @param {Recording} recording */
  async #restore(recording) {
    try {
      await post(`${pathOf(recording.name)}/restore`);
      this.#search.focus(); // the focused button disappears
      setText(this.#note, `Restored ${nameOf(recording)}.`);
    } catch (error) {
      setText(this.#note, wordsOf(error));
    }
    await this.#reload();
  }

  /** Load only the recordings. */
  async #reload() {
    await this.#load();
    this.dispatchEvent(new Event("change"));
  }

  /** @param {unknown} [error] cause of a failed request. A refused request is not repeated. */
  #refreshLater(error) {
    if (error instanceof Refused) return;
    clearTimeout(this.#later);
    this.#later = setTimeout(() => this.refresh(), RETRY);
  }

  async #loadGoals() {
    if (!this.hasArm) return;
    const [{ goals }, { tasks }] = await Promise.all([get(`api/goals?limit=${SHOWN}`), get("api/tasks")]);
    this.goals = goals.reverse();
    this.tasks = tasks;
  }

  /** Load the newest recordings, as many as the list shows. */
  async #load() {
    const asked = (this.#asked += 1);
    const query = new URLSearchParams();
    if (this.#search.value.trim()) query.set("search", this.#search.value);
    if (this.#state.value) query.set("state", this.#state.value);
    if (this.#task.value) query.set("task", this.#task.value);
    const day = new Date(`${this.#day.value}T00:00`).getTime(); // in local time
    if (this.#day.value && day >= 0) {
      query.set("since", `${BigInt(day) * 1_000_000n}`);
      query.set("until", `${BigInt(day + DAY) * 1_000_000n}`);
    }
    /** @type {Recording[]} */
    const found = [];
    try {
      for (let limit = 0, got = 0; got === limit && found.length < this.#wanted; ) {
        limit = Math.min(this.#wanted - found.length, MOST);
        query.set("limit", String(limit));
        const { recordings } = await get(`api/recordings?${query}`);
        if (asked !== this.#asked) return; // a later search has replaced this one
        found.push(...recordings);
        got = recordings.length;
        query.set("before", found.at(-1)?.name ?? "");
      }
      this.recordings = found;
      this.#more.hidden = found.length < this.#wanted;
      if (this.#note.textContent === this.#error) setText(this.#note, "");
    } catch (error) {
      this.#error = wordsOf(error);
      setText(this.#note, this.#error);
      this.#refreshLater(error);
    }
  }

  /**
   * Return the title of a goal, for people.
   * @param {string} identity
   */
  titleOf(identity) {
    const goal = this.goals.find((each) => each.goal_id === identity);
    const name = this.tasks.find((each) => each.task === goal?.task)?.name;
    return goal ? goalTitle(goal.task, name) : "a goal";
  }

  /**
   * Return the state of the goal of a recording that is being written, from the list of goals.
   * @param {string} name
   */
  #stateOf(name) {
    const ended = this.goals.find((each) => each.result?.recording.split("/").at(-1) === name);
    return ended?.state ?? "EXECUTING";
  }

  /**
   * Return true if the run of a recording has ended, but the recording is still being finished.
   * @param {Recording} recording
   */
  isFinishing(recording) {
    return isWritten(recording) && this.#stateOf(recording.name) !== "EXECUTING";
  }

  /** Offer the tasks of the server and of the recordings as filters. */
  #drawTasks() {
    const names = new Map(this.tasks.map((each) => [each.task, goalTitle(each.task, each.name)]));
    for (const { task, title } of this.recordings)
      if (task !== null && !names.has(task)) names.set(task, task < 0 ? "moves" : title);
    const key = [...names].join("\n");
    if (!isNew(this.#task, key)) return;
    const chosen = this.#task.value;
    const options = [...names].map(([task, name]) => element("option", { value: task }, name));
    this.#task.replaceChildren(element("option", { value: "" }, "any task"), ...options);
    this.#task.value = chosen;
  }

  /**
   * @param {Recording} recording
   * @param {boolean} current
   */
  #item(recording, current) {
    const { bytes, pinned, task, name, duration_s, message } = recording;
    const state = isWritten(recording) ? this.#stateOf(name) : recording.state;
    const known = this.tasks.find((each) => each.task === task);
    const title = recording.state === "UNFINISHED" && known ? goalTitle(known.task, known.name) : recording.title;
    const duration = duration_s === null ? "" : `, ${duration_s.toFixed(1)} s`;
    const button = element(
      "button",
      { type: "button", class: "run", id: `run-${name}`, title: `${name}\n${message}`.trim() },
      element("span", { class: "name" }, `${pinned ? "◆ " : ""}${title || name}`),
      element("span", { "data-state": state }, stateWords(state)),
      element("span", { class: "quiet when" }, when(recording.stamp_ns)),
      element("span", { class: "quiet" }, `${size(bytes)}${duration}`),
    );
    setAttribute(button, "aria-current", current ? "true" : false);
    button.addEventListener("click", () => this.dispatchEvent(new CustomEvent("open", { detail: recording })));
    return element("li", {}, button);
  }
}

/**
 * Return true if a recording is being written.
 * @param {Recording} recording
 */
export function isWritten({ code }) {
  return code === "log.in_use";
}

/**
 * Return true if the file of a recording is finished. The run may have been cut off.
 * @param {Recording} recording
 */
export function isFinished({ state, code }) {
  return state !== "UNFINISHED" || code === "server.restarted";
}

/**
 * Return the title of a recording, for people.
 * @param {Recording} recording
 */
export function nameOf({ title, name, stamp_ns }) {
  return title ? `${title}, ${when(stamp_ns)}` : name;
}

/** @param {number} bytes */
function size(bytes) {
  return bytes < 1e6 ? `${Math.ceil(bytes / 1e3)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}

/**
 * Return a time of this day, or a day and a time.
 * @param {number} stamp [ns since 1970]
 */
function when(stamp) {
  const date = new Date(stamp / 1e6);
  const today = date.toDateString() === new Date().toDateString();
  return today ? date.toLocaleTimeString() : `${date.toLocaleDateString()} ${date.toLocaleTimeString()}`;
}
