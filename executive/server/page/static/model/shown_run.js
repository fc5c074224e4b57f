/** The run that is shown: the live one, or one that has ended, read from its recording. */

import { get } from "../api.js";
import { RecordedRun } from "./recorded_run.js";
import { Run } from "./run.js";

/**
 * @typedef {object} NodeFacts What the task's files say of a node.
 * @property {string} path
 * @property {string} kind
 * @property {string} file
 * @property {number} line
 * @property {string} called_at
 * @property {Record<string, string>} ports
 */

/** Events: `open` when another run is shown, `change` then and when more is known of it. */
export class ShownRun extends EventTarget {
  /** The run of the newest live events. */
  live = new Run();
  run = this.live;
  /** @type {Map<string, NodeFacts>} by path */
  facts = new Map();
  /** @type {RecordedRun | null} the recorded run, if one is shown */
  recorded = null;
  #asked = "";
  /** @type {RecordedRun | null} what is being read; it is not shown if another run was asked for */
  #opening = null;

  /** @returns {boolean} True if the run that is shown is the live one */
  get isLive() {
    return this.run === this.live;
  }

  /**
   * Take a live event.
   * @param {any} event
   */
  update(event) {
    if (this.live.update(event)) return this.follow();
    this.#findFacts();
    this.dispatchEvent(new Event("change"));
  }

  /** Show the live run. */
  follow() {
    this.#opening = this.recorded = null;
    this.#show(this.live);
  }

  /**
   * Show a recorded run.
   * @param {string} name of the recording
   * @param {number} [time] the moment to show; default: the end [s]
   */
  async open(name, time) {
    const recorded = (this.#opening = new RecordedRun(name));
    await recorded.open(time);
    if (this.#opening !== recorded) return;
    recorded.addEventListener("change", () => this.dispatchEvent(new Event("change")));
    this.recorded = recorded;
    this.#show(recorded.run);
  }

  /** @returns {number} the length of what is known of the run [s] */
  get length() {
    return this.recorded ? this.recorded.duration : this.live.length;
  }

  /** @param {Run} run */
  #show(run) {
    this.run = run;
    this.dispatchEvent(new Event("open"));
    this.#findFacts();
    this.dispatchEvent(new Event("change"));
  }

  /** Ask once for each goal what its files say. */
  async #findFacts() {
    const { goalId, task } = this.run;
    if (this.#asked === goalId) return;
    this.#asked = goalId;
    this.facts = new Map();
    if (task < 0) return; // a move has no file
    const { nodes } = await get(`api/tasks/${task}/nodes`).catch(() => ({ nodes: [] }));
    if (this.#asked !== goalId) return;
    for (const node of nodes) this.facts.set(node.path, node);
    for (const node of this.run.nodes.values()) this.run.changed.add(node);
    this.dispatchEvent(new Event("change"));
  }
}
