/**
 * A run from its recording: the state at any moment.
 *
 * The server sends windows: the events around a moment, and the state before them. While a window is
 * being loaded, the pose of the arm comes from samples of the whole run.
 */

import { Refused, get, getAtLast, pathOf } from "../api.js";
import { History } from "./history.js";
import { Run } from "./run.js";

/**
 * @typedef {object} Window Times are from the beginning of the goal [s].
 * @property {number} from_s
 * @property {number} to_s
 * @property {any[]} state events that give the state before the window
 * @property {any[]} events
 * @property {number | null} previous_s last step before the window
 * @property {number | null} next_s first step after it
 */

/**
 * @typedef {object} Samples
 * @property {number[]} times_s
 * @property {Record<string, (number | null)[]>} positions by joint [rad or m]
 */

const MOST_WINDOWS = 16; // largest number of windows to keep; the oldest are dropped
const PAUSE = 100; // pause between two requests for windows, to spare the server of the arm [ms]
const ROUNDING = 1e-6; // largest rounding error of a time [s]
const STEPS = new Set(["goal", "node", "plan", "schedule", "status"]);

/** Events: `change` when the state has changed, `error` when a window cannot be loaded. */
export class RecordedRun extends EventTarget {
  /** The state at the shown moment. */
  run = new Run();
  /** The values of the run over time. */
  history = new History();
  /** From the beginning of the goal to the end of the recording [s]. */
  duration = 0;
  #began = 0;
  #path;
  /** @type {Samples} */
  #samples = { times_s: [], positions: {} };
  /** @type {Window[]} the oldest first */
  #windows = [];
  /** @type {Window | null} window of the state in `run` */
  #window = null;
  /** Number of this window's events that are in `run`. */
  #taken = 0;
  #time = 0;
  #loading = false;
  #gone = false; // True if the server no longer has the recording
  /** @type {Promise<import("../arm/model.js").Robot> | undefined} */
  #robot;

  /**
   * @param {string} name of the recording; empty if all events are loaded
   * @param {string} [kind] kind of run, in words
   */
  constructor(name, kind = "recorded") {
    super();
    this.kind = kind;
    this.name = name;
    this.#path = pathOf(name);
  }

  /**
   * Return a run from all its events.
   * @param {any[]} events the goal first
   * @param {string} kind kind of run, in words
   */
  static of(events, kind) {
    const made = new RecordedRun("", kind);
    const times = events.map((event) => event.time_s ?? 0);
    made.#began = times[0];
    made.duration = Math.max(...times) - made.#began;
    const end = made.#began + made.duration;
    const timed = events.map((event) => ({ time_s: end, ...event })); // the last state has no time
    inOrder(timed); // a new stream repeats the current state
    made.#windows = [{ from_s: 0, to_s: made.duration, state: [], events: timed, previous_s: null, next_s: null }];
    for (const event of timed) made.history.add(event, event.time_s - made.#began);
    made.seek(made.duration);
    return made;
  }

  /**
   * Load the data for a moment, and show it.
   * @param {number} [time] the moment; default: the end [s]
   */
  async open(time) {
    const about = await get(this.#path, null);
    this.duration = about.duration_s;
    this.#began = about.began_s;
    if (!about.ended) this.kind = "recorded, incomplete";
    const at = Math.min(time ?? this.duration, this.duration);
    const [series] = await Promise.all([get(`${this.#path}/series`, null), this.#load(at)]);
    this.#samples = series.commanded;
    this.history.setSeries(series);
    for (const event of series.events) this.history.add(event, event.time_s - this.#began);
    this.seek(at);
  }

  /**
   * Show a moment, at once or after its window is loaded.
   * @param {number} time from the beginning of the goal [s]
   */
  seek(time) {
    this.#time = time;
    const window = this.#find(time);
    if (window) this.#show(window);
    else this.#showSample();
    const wanted = window ? window.to_s : time; // while the run plays, the next window is needed soon
    if (!this.#loading && !this.#gone && !this.#find(Math.min(wanted, this.duration))) this.#loadAll(wanted);
    this.dispatchEvent(new Event("change"));
  }

  /** @returns {Promise<import("../arm/model.js").Robot>} robot of the recording, requested once */
  get robot() {
    return (this.#robot ??= getAtLast(`${this.#path}/robot`));
  }

  /** @returns {import("./run.js").Schedule[]} the motions of the loaded windows */
  get motions() {
    return this.#windows.flatMap(({ events }) => events.filter((each) => each.event === "schedule"));
  }

  /** @returns {boolean} True while the window of the shown moment is not loaded */
  get waits() {
    return this.#window === null;
  }

  /**
   * Return the time of the next or the previous step of the run [s]; undefined if there is none.
   * @param {1 | -1} direction
   * @returns {number | undefined}
   */
  step(direction) {
    const window = this.#find(this.#time);
    if (!window) return undefined;
    const times = window.events
      .filter((event) => STEPS.has(event.event))
      .map((event) => Math.max(0, event.time_s - this.#began));
    if (direction > 0)
      return times.find((time) => time > this.#time + ROUNDING) ?? window.next_s ?? undefined;
    return times.reverse().find((time) => time < this.#time - ROUNDING) ?? window.previous_s ?? undefined;
  }

  /**
   * @param {number} time
   * @returns {Window | undefined}
   */
  #find(time) {
    const at = time + ROUNDING; // a window contains events at its beginning
    return this.#windows.find(({ from_s, to_s }) => from_s <= at && (at < to_s || to_s >= this.duration));
  }

  /**
   * Load a window, and then the window of the moment that is shown after that.
   * @param {number} time a time in the window [s]
   */
  async #loadAll(time) {
    this.#loading = true;
    try {
      await this.#load(time);
      while (!this.#find(this.#time)) {
        await new Promise((done) => setTimeout(done, PAUSE));
        await this.#load(this.#time);
      }
    } catch (error) {
      this.#gone = error instanceof Refused && error.status === 404;
      this.dispatchEvent(new CustomEvent("error", { detail: error }));
      return; // the next `seek` tries again
    } finally {
      this.#loading = false;
    }
    if (!this.#window) this.seek(this.#time);
  }

  /** @param {number} time */
  async #load(time) {
    const window = await get(`${this.#path}/events?at=${time}`);
    inOrder(window.events); // a frame is recorded after its write, and may follow later events
    this.#windows = [...this.#windows.slice(1 - MOST_WINDOWS), window];
  }

  /** @param {Window} window */
  #show(window) {
    const forward = window === this.#window && this.#takes(this.#taken - 1);
    const run = forward ? this.run : new Run();
    if (!forward) {
      run.began = this.#began;
      for (const event of window.state) run.update(event);
      this.#taken = 0;
    }
    this.#window = window;
    for (; this.#taken < window.events.length && this.#takes(this.#taken); this.#taken += 1)
      run.update(window.events[this.#taken]);
    if (!forward) this.run.become(run);
  }

  /**
   * Return true if an event of the window is not after the shown moment.
   * @param {number} index
   */
  #takes(index) {
    const event = this.#window?.events[index];
    return !event || event.time_s - this.#began <= this.#time + ROUNDING;
  }

  #showSample() {
    this.#window = null; // only the positions are of the shown moment
    const { times_s: times, positions } = this.#samples;
    const after = times.findIndex((time) => time > this.#time);
    const row = (after < 0 ? times.length : after) - 1;
    if (row < 0) return;
    const known = Object.entries(positions).flatMap(([joint, values]) => {
      const value = values[row];
      return value === null ? [] : [[joint, value]];
    });
    this.run.positions = Object.fromEntries(known);
  }
}

/**
 * Sort events by their time. Those of one time keep their order.
 * @param {any[]} events
 */
function inOrder(events) {
  events.sort((one, other) => one.time_s - other.time_s);
}
