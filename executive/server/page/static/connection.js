/**
 * The connection to the server: one stream of events, and its status once a second.
 *
 * A browser opens at most six connections to a server, in all its tabs. At most four tabs have a
 * stream, and a hidden tab closes its stream, so a stop always gets a connection.
 */

import { checkSession, get, request, setStops } from "./api.js";
import { readEvents } from "./event_stream.js";

const PERIOD = 1000; // time between two requests for the status [ms]
const TIMEOUT = 1500; // longest time for an answer [ms]
const MAX_STREAMS = 4; // largest number of streams in all tabs of a browser

/**
 * @typedef {object} Status What the server answers at `/api/status`.
 * @property {string} arm state of the lifecycle
 * @property {import("./api.js").Cause | null} fault
 * @property {string} port
 * @property {Record<string, number> | null} commanded
 * @property {Record<string, number> | null} measured
 * @property {import("./model/run.js").Goal | null} goal
 * @property {number | null} percentage
 * @property {string} phase
 * @property {string} node
 * @property {number} attempt
 * @property {string[]} waiting
 * @property {string} policy
 * @property {boolean} paused
 * @property {string[]} breakpoints
 * @property {number} stops
 * @property {number} time_s time of the answer, on the clock of the events
 */

/**
 * Events: `event` with an event of the server as `detail`, `begin` before the first event of a
 * stream, `status` with a Status, `change` when the connection is lost or back.
 */
export class Connection extends EventTarget {
  /** Time of the last answer [ms since 1970]; 0 before the first. */
  heard = 0;
  /** False if the last request had no answer. */
  alive = false;
  /** Reason that the server refuses to show its state; empty if it shows it. */
  refusal = "";
  /** @type {boolean | undefined} false if the server has only recordings; undefined before its first answer */
  hasArm;
  /** True if too many other tabs have a stream. */
  crowded = false;

  #stream = new AbortController();
  #streaming = false;
  #timer = 0;

  /** Begin to watch. */
  start() {
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.#stream.abort();
      else this.refresh();
    });
    this.refresh();
  }

  /** Request the status now, and then once a period. First find out if the server has an arm. */
  async refresh() {
    clearTimeout(this.#timer);
    try {
      this.hasArm ??= (await get("api/health", AbortSignal.timeout(TIMEOUT))).arm;
      const path = this.hasArm ? "api/status" : "api/health";
      const status = await get(path, AbortSignal.timeout(TIMEOUT));
      this.#setAlive(true, "");
      if (!this.hasArm) return this.#beginOnce();
      setStops(status.stops);
      this.dispatchEvent(new CustomEvent("status", { detail: status }));
      if (!this.#streaming && !document.hidden) this.#follow();
    } catch (error) {
      const refused = error instanceof Error && "status" in error;
      this.#setAlive(refused, refused ? error.message : "");
    }
    this.#refreshLater();
  }

  #refreshLater() {
    clearTimeout(this.#timer);
    if (!document.hidden) this.#timer = setTimeout(() => this.refresh(), PERIOD);
  }

  /** Dispatch `begin` once, for a server without an arm, which has no events. */
  #beginOnce() {
    if (!this.#streaming) this.dispatchEvent(new Event("begin"));
    this.#streaming = true;
    this.#refreshLater();
  }

  /**
   * @param {boolean} alive
   * @param {string} refusal
   */
  #setAlive(alive, refusal) {
    if (alive) this.heard = Date.now();
    if (alive === this.alive && refusal === this.refusal) return;
    this.alive = alive;
    this.refusal = refusal;
    if (!alive) this.#stream.abort();
    this.dispatchEvent(new Event("change"));
  }

  /** @param {boolean} crowded */
  #setCrowded(crowded) {
    if (crowded === this.crowded) return;
    this.crowded = crowded;
    this.dispatchEvent(new Event("change"));
  }

  /** Read events until the stream ends, if this tab may have a stream. */
  async #follow() {
    this.#streaming = true;
    const follows = await withSlot(() => {
      this.#setCrowded(false);
      return this.#read();
    });
    this.#streaming = false;
    this.#setCrowded(!follows);
    if (follows && !document.hidden) this.refresh();
  }

  async #read() {
    const stream = (this.#stream = new AbortController());
    if (document.hidden) return; // since this tab asked for a slot
    const timer = setTimeout(() => stream.abort(), TIMEOUT);
    try {
      const response = await request("api/events", { signal: stream.signal });
      clearTimeout(timer);
      checkSession(); // the server may be another one
      this.dispatchEvent(new Event("begin"));
      for await (const detail of readEvents(response))
        this.dispatchEvent(new CustomEvent("event", { detail }));
    } catch {
      // The stream broke or was closed. The next request for the status shows which.
    }
  }
}

/**
 * Call a function while this tab holds one of the browser's slots for streams.
 * @param {() => Promise<void>} act
 * @returns {Promise<boolean>} false if all slots are taken
 */
async function withSlot(act) {
  if (!navigator.locks) return act().then(() => true); // browsers have no locks over plain HTTP from another machine
  for (let slot = 0; slot < MAX_STREAMS; slot++) {
    const acted = await navigator.locks.request(`stream ${slot}`, { ifAvailable: true }, (lock) =>
      lock ? act().then(() => true) : false,
    );
    if (acted) return true;
  }
  return false;
}
