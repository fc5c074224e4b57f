/** Moves in small planned steps: joints and tool. Each is a goal like any other. */

import { getAtLast, isSignedIn, sendGoal, session, wordsOf } from "../api.js";
import { byId, element, setAttribute, setText, setUsable } from "../dom.js";

/** @typedef {import("../connection.js").Status} Status */

const DEGREE = Math.PI / 180;
const AXES = ["x", "y", "z"];
const WAIT = 400; // pause after the last key on a slider [ms]

/**
 * @typedef {object} Where What the server answers at `/api/where`.
 * @property {Record<string, "rad" | "m">} units
 * @property {Record<string, [number, number] | null>} limits [rad or m]
 * @property {string[]} turns of the tool in place
 * @property {number[] | null} tool
 */

/**
 * @typedef {object} JointRow
 * @property {HTMLInputElement} slider
 * @property {HTMLElement} value
 * @property {number} scale [rad or m] per unit of the slider
 * @property {string} unit of the slider
 * @property {"" | "held" | "set" | "sent"} target empty if the slider shows the commanded position,
 *   `held` while it is dragged
 */

/** Sliders for the joints, and buttons for small steps of joints and tool. */
export class MoveView {
  #rows = byId("move-rows", HTMLElement);
  #note = byId("move-error", HTMLElement);
  #step = byId("move-step", HTMLSelectElement);
  /** @type {Map<string, JointRow>} */
  #joints = new Map();
  #timer = 0; // timer of `WAIT`; 0 if it is not running
  #usable = false;
  /** @type {Status | null} */
  #status = null;
  /** @type {Status | null} the newest status before the last move, so it does not contain the move */
  #before = null;
  /** @type {string | null} identity of the last move; null until the server answers, empty for none */
  #own = "";
  #stops = 0; // number of stops in the newest status

  constructor() {
    session.addEventListener("stop", () => this.#clear());
  }

  /** Make the rows for the joints of the robot. */
  async show() {
    const where = /** @type {Where} */ (await getAtLast("api/where"));
    this.#joints.clear();
    const joints = Object.entries(where.units).map(([name, unit]) => this.#jointRow(name, unit, where.limits[name]));
    const tool = AXES.map((axis, index) => this.#toolRow(axis, index));
    const turns = where.turns.map((name) => this.#turnRow(name));
    this.#rows.replaceChildren(...joints, ...tool, ...turns);
  }

  /**
   * @param {Status | null} status
   * @param {string | null} goal identity of the goal under way; null for none
   * @param {Record<string, number> | null} positions commanded, by joint [rad or m]
   * @param {import("../model/run.js").Goal[]} goals
   */
  draw(status, goal, positions, goals) {
    const cause = goals.find((each) => each.goal_id === this.#own)?.result?.cause;
    if (cause) {
      setText(this.#note, cause.message);
      this.#own = ""; // shows the message only once
    }
    const active = isSignedIn() && status?.arm === "active";
    const waits = active && (goal === null || this.#own === null || goal === this.#own);
    const stops = status?.stops ?? 0;
    // A target waits for the end of this tab's own move. Another goal or a stop drops it.
    if (!waits || stops !== this.#stops) this.#clear();
    this.#stops = stops;
    this.#status = status;
    this.#usable = active && goal === null && status !== this.#before;
    for (const button of this.#rows.querySelectorAll("button")) setUsable(button, this.#usable);
    if (this.#usable) this.#release();
    this.#sendTargets();
    for (const [name, { slider, value, scale, unit, target }] of this.#joints) {
      slider.disabled = !waits;
      const position = positions?.[name];
      if (target) continue;
      slider.value = String((position ?? 0) / scale);
      show(slider, value, position === undefined ? "unknown" : `${(position / scale).toFixed(1)} ${unit}`);
    }
  }

  /** Drop all targets: the sliders show the commanded position again. */
  #clear() {
    for (const joint of this.#joints.values()) joint.target = "";
  }

  /** Let the sliders that were sent show the commanded position again. */
  #release() {
    for (const joint of this.#joints.values()) if (joint.target === "sent") joint.target = "";
  }

  /** Move to the targets of all sliders, if the user has set them and no goal is under way. */
  async #sendTargets() {
    const set = [...this.#joints].filter(([, joint]) => joint.target === "set");
    if (this.#timer || !this.#usable || set.length === 0) return;
    for (const [, joint] of set) joint.target = "sent";
    const to = set.map(([name, { slider, unit }]) => `${name}=${slider.value}${unit}`);
    if (!(await this.#move(to, false))) this.#release();
  }

  /**
   * @param {string} name
   * @param {"rad" | "m"} kind
   * @param {[number, number] | null} limits
   */
  #jointRow(name, kind, limits) {
    const scale = kind === "m" ? 0.001 : DEGREE;
    const unit = kind === "m" ? "mm" : "deg";
    const [lower, upper] = limits ?? [-Math.PI, Math.PI];
    // Rounded inward, so that the ends are within the limits.
    const min = Math.ceil(lower / scale - 1e-6);
    const max = Math.floor(upper / scale + 1e-6);
    const slider = element("input", { type: "range", min, max, step: 0.5, "aria-label": `${name} [${unit}]` });
    const value = element("output", {}, "unknown");
    /** @type {JointRow} */
    const joint = { slider, value, scale, unit, target: "" };
    slider.addEventListener("input", () => {
      joint.target = "held";
      show(slider, value, `${slider.value} ${unit}`);
    });
    slider.addEventListener("blur", () => {
      if (joint.target === "held") joint.target = "";
    });
    slider.addEventListener("change", () => {
      joint.target = "set";
      clearTimeout(this.#timer);
      this.#timer = setTimeout(() => {
        this.#timer = 0;
        this.#sendTargets();
      }, WAIT);
    });
    this.#joints.set(name, joint);
    /** @param {number} sign */
    const jog = (sign) => this.#move([`${name}=${sign * Number(this.#step.value)}${unit}`], true);
    return row(name, jog, slider, value);
  }

  /**
   * @param {string} axis
   * @param {number} index
   */
  #toolRow(axis, index) {
    /** @param {number} sign */
    const jog = (sign) =>
      this.#move(AXES.map((_, each) => (each === index ? (sign * Number(this.#step.value)) / 1000 : 0)), true);
    return row(`tool ${axis}`, jog);
  }

  /** @param {string} name */
  #turnRow(name) {
    return row(`tool ${name}`, (sign) => this.#move([`${name}=${sign * Number(this.#step.value)}deg`], true));
  }

  /**
   * @param {(string | number)[]} to
   * @param {boolean} relative
   * @returns {Promise<boolean>} True if the move was accepted
   */
  async #move(to, relative) {
    if (!this.#usable) return false;
    this.#usable = false;
    this.#before = this.#status;
    this.#own = null;
    setText(this.#note, "");
    try {
      this.#own = await sendGoal("api/move", { to, relative });
      return true;
    } catch (error) {
      this.#own = "";
      setText(this.#note, wordsOf(error));
      return false;
    }
  }
}

/**
 * @param {HTMLInputElement} slider which has steps, so it does not show the exact value
 * @param {HTMLElement} value
 * @param {string} words
 */
function show(slider, value, words) {
  setText(value, words);
  setAttribute(slider, "aria-valuetext", words);
}

/**
 * @param {string} name
 * @param {(sign: number) => void} jog
 * @param {...HTMLElement} middle
 */
function row(name, jog, ...middle) {
  const less = element("button", { type: "button", "aria-label": `${name} less` }, "−");
  const more = element("button", { type: "button", "aria-label": `${name} more` }, "+");
  less.addEventListener("click", () => jog(-1));
  more.addEventListener("click", () => jog(1));
  return element("div", { class: "move-row" }, element("span", {}, name), less, ...middle, more);
}
