/** The values of a run over time, for plots and the log: computed from events, live or recorded. */

import { whereItLeads } from "./run.js";

/** @typedef {import("./run.js").Schedule} Schedule */
/** @typedef {import("./recorded_run.js").Samples} Samples */

const MOST_ROWS = 20_000; // largest number of rows of a series; then every second row is dropped
const MOST_LINES = 2_000; // largest number of lines of the log

/** Rows of values over time, one column per name. */
export class Series {
  /** @type {number[]} from the run's beginning [s] */
  times = [];
  /** @type {Map<string, (number | null)[]>} */
  columns = new Map();
  /** Grows with every change. */
  version = 0;

  /**
   * Add a row. A row that is earlier than the last one is left out.
   * @param {number} time
   * @param {string[]} names the same in every row
   * @param {number[]} values
   */
  add(time, names, values) {
    if (values.length !== names.length || time < (this.times.at(-1) ?? -Infinity)) return;
    if (this.times.length >= MOST_ROWS) this.#thin();
    this.times.push(time);
    for (const [index, name] of names.entries()) {
      const column = this.columns.get(name);
      if (column) column.push(values[index]);
      else this.columns.set(name, [values[index]]);
    }
    this.version += 1;
  }

  /**
   * Replace all rows.
   * @param {Samples} samples
   */
  set({ times_s, positions }) {
    this.times = times_s;
    this.columns = new Map(Object.entries(positions));
    this.version += 1;
  }

  /**
   * Drop the rows from a time on.
   * @param {number} time
   */
  cut(time) {
    const length = this.indexAt(time) + 1;
    this.times.length = length;
    for (const column of this.columns.values()) column.length = length;
    this.version += 1;
  }

  /**
   * Return the last row that is not later than a time, or -1.
   * @param {number} time
   */
  indexAt(time) {
    let low = 0;
    let high = this.times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.times[middle] <= time) low = middle + 1;
      else high = middle;
    }
    return low - 1;
  }

  #thin() {
    this.times = this.times.filter((_, index) => index % 2 === 0);
    for (const [name, column] of this.columns) this.columns.set(name, column.filter((_, index) => index % 2 === 0));
  }
}

/** Series, phases and lines of one run. Times are from the run's beginning [s]. */
export class History {
  /** Commanded positions [rad or m], as sent. */
  commanded = new Series();
  /** Measured positions [rad or m]. */
  measured = new Series();
  /** Velocities of the planned motion [rad/s or m/s]. */
  velocity = new Series();
  /** Measured velocities [rad/s or m/s]. */
  measuredVelocity = new Series();
  /** Delay of each frame after its scheduled time [s], in the column `frame`. */
  lateness = new Series();
  /** @type {Map<string, number>} velocity limit by joint [rad/s or m/s] */
  limits = new Map();
  /** @type {{ time: number, phase: string }[]} when each phase began */
  phases = [];
  /** @type {{ time: number, level: number, logger: string, message: string }[]} */
  lines = [];
  /** Grows with every phase and line. */
  version = 0;
  /** @type {Schedule | null} the newest motion */
  #schedule = null;
  #begun = false; // True if the newest motion has begun

  /**
   * Add an event.
   * @param {any} event
   * @param {number} time from the run's beginning [s]
   */
  add(event, time) {
    switch (event.event) {
      case "sent":
        if (event.joints.length) this.#addFrame(event, time);
        break;
      case "measured":
        this.measured.add(time, event.joints, event.position);
        this.measuredVelocity.add(time, event.joints, event.velocity);
        break;
      case "plan":
        for (const [index, joint] of event.joints.entries()) this.limits.set(joint, event.velocity_limits[index]);
        break;
      case "schedule":
        this.#schedule = event;
        this.#begun = false;
        break;
      case "feedback":
        if (event.phase === this.phases.at(-1)?.phase) break;
        this.phases.push({ time, phase: event.phase });
        this.version += 1;
        break;
      case "log":
        if (this.lines.length >= MOST_LINES) this.lines.shift();
        this.lines.push({ time, level: event.level, logger: event.logger, message: event.message });
        this.version += 1;
        break;
    }
  }

  /**
   * Replace the series with the server's samples of a whole recording.
   * @param {object} series
   * @param {Samples} series.commanded
   * @param {Samples} series.measured
   * @param {{ times_s: number[], late_s: number[] }} series.lateness
   * @param {Record<string, number>} series.velocity_limits
   */
  setSeries({ commanded, measured, lateness, velocity_limits: limits }) {
    this.commanded.set(commanded);
    this.measured.set(measured);
    this.velocity.set(slopes(commanded));
    this.measuredVelocity.set(slopes(measured));
    this.lateness.set({ times_s: lateness.times_s, positions: { frame: lateness.late_s } });
    this.limits = new Map(Object.entries(limits));
  }

  /**
   * @param {any} event
   * @param {number} time
   */
  #addFrame(event, time) {
    this.commanded.add(time, event.joints, whereItLeads(event, this.#schedule));
    if (event.scheduled_s === null) {
      // A stop ends the motion early.
      this.velocity.cut(time);
      this.velocity.add(time, event.joints, event.joints.map(() => 0));
      return;
    }
    const late = event.time_s - event.scheduled_s;
    this.lateness.add(time, ["frame"], [late]);
    if (!this.#schedule || this.#begun) return;
    // A page that is opened during a motion has missed its first frames.
    const number = Math.max(0, this.#schedule.frames.indexOf(event.data));
    this.#addVelocities(this.#schedule, time - late - (this.#schedule.times[number] ?? 0));
    this.#begun = true;
  }

  /**
   * @param {Schedule} schedule
   * @param {number} begin start of its motion [s]
   */
  #addVelocities({ start, sample_times: times, samples }, begin) {
    const joints = Object.keys(start);
    const still = joints.map(() => 0);
    this.velocity.cut(begin);
    this.velocity.add(begin, joints, still);
    for (let row = 1; row < times.length; row += 1) {
      const step = times[row] - times[row - 1];
      if (step <= 0) continue;
      const middle = begin + (times[row] + times[row - 1]) / 2;
      this.velocity.add(middle, joints, samples[row].map((value, index) => (value - samples[row - 1][index]) / step));
    }
    this.velocity.add(begin + (times.at(-1) ?? 0), joints, still);
  }
}

/**
 * Return the velocity of each value from each sample to the next [rad/s or m/s].
 * @param {Samples} samples
 * @returns {Samples}
 */
function slopes({ times_s: times, positions }) {
  /** @param {(number | null)[]} values */
  const slope = (values) =>
    times.map((time, row) => {
      const [value, next] = [values[row], values[row + 1]];
      const step = times[row + 1] - time;
      return value === null || next === null || !(step > 0) ? 0 : (next - value) / step;
    });
  const rates = Object.entries(positions).map(([name, values]) => [name, slope(values)]);
  return { times_s: times, positions: Object.fromEntries(rates) };
}
