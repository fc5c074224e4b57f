/** The shown run: the live one, or a recorded one. */

import { getAtLast, pathOf } from "../api.js";
import { History } from "./history.js";
import { RecordedRun } from "./recorded_run.js";
import { Run } from "./run.js";

/** @typedef {import("./run.js").Schedule} Schedule */

/**
 * @typedef {object} NodeFacts Facts about a node, from the task's files.
 * @property {string} path
 * @property {string} kind
 * @property {string} file
 * @property {number} line
 * @property {string} called_at
 * @property {Record<string, string>} ports
 */

const DRY_RUN = "dry run: nothing moves";
const MOST_EVENTS = 20_000; // largest number of events of the live run; then old frames are dropped
const FREQUENT = new Set(["sent", "measured", "feedback", "log"]);

/**
 * Events: `open` when another run is shown, `change` then and when the run has new data, `error` when
 * its data cannot be loaded.
 */
export class ShownRun extends EventTarget {
  /** The run of the newest live events. */
  live = new Run();
  run = this.live;
  /** The values of the shown run over time. */
  history = new History();
  #liveHistory = this.history;
  /** @type {Map<string, NodeFacts>} by path */
  facts = new Map();
  /** @type {RecordedRun | null} the recorded run, if one is shown */
  recorded = null;
  /** True to show the recorded run also when a goal begins. */
  #held = false;
  /** @type {any[]} */
  #liveEvents = [];
  #asked = "";
  /** @type {RecordedRun | null} the run that is being loaded; it is not shown if another one is opened meanwhile */
  #opening = null;

  /** @returns {boolean} True if the shown run is the live one */
  get isLive() {
    return this.run === this.live;
  }

  /**
   * @returns {boolean} True if the page itself, not the user, has opened the recording, because no
   *   run is under way
   */
  get isLast() {
    return Boolean(this.recorded?.name) && !this.#held;
  }

  /** @returns {boolean} True for a dry run, in which nothing moves */
  get planned() {
    return this.recorded?.kind === DRY_RUN;
  }

  /** @returns {Schedule[]} all motions of a dry run, or the newest one of a run */
  get motions() {
    if (this.recorded && this.planned) return this.recorded.motions;
    return this.run.schedule ? [this.run.schedule] : [];
  }

  /** @returns {string} title and kind of the shown run; empty for the live one */
  get label() {
    return this.recorded ? `${this.run.title}, ${this.recorded.kind}` : "";
  }

  /**
   * Update the live run with an event.
   * @param {any} event
   */
  update(event) {
    const begins = this.live.update(event);
    this.#keep(event, begins);
    if (begins) {
      this.#liveHistory = new History();
      if (!this.#held) return this.follow();
    }
    if (this.live.active) this.#liveHistory.add(event, event.time_s - this.live.began);
    this.#findFacts();
    this.#changed();
  }

  /** Report that the run has new data. */
  #changed() {
    this.run.addNodes(this.facts.values());
    this.dispatchEvent(new Event("change"));
  }

  /** Show the live run. */
  follow() {
    this.#opening = this.recorded = null;
    this.#held = false;
    this.#show(this.live, this.#liveHistory);
  }

  /**
   * Show a recorded run.
   * @param {string} name of the recording
   * @param {number} [time] moment to show; default: the end [s]
   * @param {boolean} [held] False to show the live run when a goal begins
   */
  async open(name, time, held = true) {
    const recorded = (this.#opening = new RecordedRun(name));
    await recorded.open(time);
    if (this.#opening !== recorded) return;
    this.#held = held;
    this.#showRecorded(recorded);
  }

  /**
   * Show a dry run.
   * @param {any[]} events in the form of a run's events
   */
  preview(events) {
    this.#opening = null;
    this.#held = false;
    this.#showRecorded(RecordedRun.of(events, DRY_RUN));
  }

  /** Show the events of the live run so far, so that the cursor can show any moment of it. */
  rewind() {
    if (!this.live.goalId) return;
    this.#held = false;
    this.#showRecorded(RecordedRun.of(this.#liveEvents, "an earlier moment"));
  }

  /**
   * Keep an event of the live run, for `rewind`.
   * @param {any} event
   * @param {boolean} begins True if it begins a run
   */
  #keep(event, begins) {
    if (begins) this.#liveEvents = [];
    else if (!this.live.goalId || event.event === "goal" || event.event === "received") return;
    if (this.#liveEvents.length >= MOST_EVENTS) {
      const older = this.#liveEvents.splice(0, MOST_EVENTS / 2);
      this.#liveEvents.unshift(...older.filter((each) => !FREQUENT.has(each.event)));
    }
    this.#liveEvents.push(event);
  }

  /** @returns {number} length of the known part of the run [s] */
  get length() {
    return this.recorded ? this.recorded.duration : this.live.length;
  }

  /** @param {RecordedRun} recorded */
  #showRecorded(recorded) {
    recorded.addEventListener("change", () => this.#changed());
    recorded.addEventListener("error", (event) => {
      const { detail } = /** @type {CustomEvent} */ (event);
      this.dispatchEvent(new CustomEvent("error", { detail }));
    });
    this.recorded = recorded;
    this.#show(recorded.run, recorded.history);
  }

  /**
   * @param {Run} run
   * @param {History} history
   */
  #show(run, history) {
    this.run = run;
    this.history = history;
    this.dispatchEvent(new Event("open"));
    this.#findFacts();
    this.dispatchEvent(new Event("change"));
  }

  /** Request the facts about the nodes, once for each goal. */
  async #findFacts() {
    const { goalId, task } = this.run;
    if (this.#asked === goalId) return;
    this.#asked = goalId;
    this.facts = new Map();
    if (task < 0) return; // a move has no file
    const path = this.recorded?.name ? pathOf(this.recorded.name) : `api/tasks/${task}`;
    const { nodes } = await getAtLast(`${path}/nodes`).catch(() => ({ nodes: [] }));
    if (this.#asked !== goalId) return;
    for (const node of nodes) this.facts.set(node.path, node);
    for (const node of this.run.nodes.values()) this.run.changed.add(node);
    this.#changed();
  }
}
