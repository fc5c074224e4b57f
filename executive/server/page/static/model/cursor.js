/** The time cursor: one moment of the shown run, for all views. */

/** Events: `change` when the moment or the end has changed. */
export class Cursor extends EventTarget {
  /** The shown moment, from the run's beginning [s]. */
  time = 0;
  /** End of the known part of the run, from its beginning [s]. */
  end = 0;
  /** True if the cursor follows the end. */
  live = true;

  /**
   * Show a moment, at most the end.
   * @param {number} time from the run's beginning [s]
   */
  seek(time) {
    this.#set(Math.min(Math.max(time, 0), this.end), this.end, false);
  }

  /** Show the end, and follow it. */
  follow() {
    this.#set(this.end, this.end, true);
  }

  /**
   * Set a new end of the run.
   * @param {number} end from the run's beginning [s]
   */
  extend(end) {
    this.#set(this.live ? end : Math.min(this.time, end), end, this.live);
  }

  /**
   * @param {number} time
   * @param {number} end
   * @param {boolean} live
   */
  #set(time, end, live) {
    if (time === this.time && end === this.end && live === this.live) return;
    Object.assign(this, { time, end, live });
    this.dispatchEvent(new Event("change"));
  }
}
