/** The run that is shown: the live one, or one that has ended, read from its recording. */

import { get, request } from "../api.js";
import { readEvents } from "../event_stream.js";
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
  #asked = "";

  /** @returns {boolean} True if the run that is shown is the live one */
  get isLive() {
    return this.run === this.live;
  }

  /**
   * Take a live event.
   * @param {any} event
   */
  update(event) {
    if (this.live.update(event)) return this.#show(this.live);
    this.#findFacts();
    this.dispatchEvent(new Event("change"));
  }

  /**
   * Show a goal. One that has ended is read from its recording.
   * @param {import("./run.js").Goal} goal
   */
  async open(goal) {
    if (goal.goal_id === this.live.goalId) return this.#show(this.live);
    const run = new Run();
    const kinds = "goal,node,feedback,sent,plan,schedule,status";
    const response = await request(`api/goals/${goal.goal_id}/events?events=${kinds}`, {});
    for await (const event of readEvents(response)) run.update(event);
    this.#show(run);
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
