/** Moves in small planned steps: joints and tool. Each is a goal like any other. */

import { get, isSignedIn, post } from "../api.js";
import { byId, element, setText } from "../dom.js";

/** @typedef {import("../connection.js").Status} Status */

const DEGREE = Math.PI / 180;
const AXES = ["x", "y", "z"];

/**
 * @typedef {object} Where What the server answers at `/api/where`.
 * @property {Record<string, "rad" | "m">} units
 * @property {Record<string, [number, number] | null>} limits [rad or m]
 * @property {number[] | null} tool
 */

/** Sliders for the joints, and buttons for small steps of joints and tool. */
export class MoveView {
  #rows = byId("move-rows", HTMLElement);
  #note = byId("move-error", HTMLElement);
  #step = byId("move-step", HTMLSelectElement);
  /** @type {Map<string, { slider: HTMLInputElement, value: HTMLElement, scale: number, unit: string }>} */
  #sliders = new Map();

  /** Make the rows for the joints of the robot. */
  async show() {
    const where = /** @type {Where} */ (await get("api/where"));
    this.#sliders.clear();
    const joints = Object.entries(where.units).map(([name, unit]) => this.#jointRow(name, unit, where.limits[name]));
    const tool = AXES.map((axis, index) => this.#toolRow(axis, index));
    this.#rows.replaceChildren(...joints, ...tool);
  }

  /** @param {Status | null} status */
  draw(status) {
    const usable = isSignedIn() && status?.arm === "active" && status.goal === null;
    for (const control of this.#rows.querySelectorAll("button, input"))
      if (control instanceof HTMLButtonElement || control instanceof HTMLInputElement) control.disabled = !usable;
    for (const [name, { slider, value, scale, unit }] of this.#sliders) {
      const position = status?.commanded?.[name];
      if (position === undefined || document.activeElement === slider) continue;
      slider.value = String(position / scale);
      setText(value, `${(position / scale).toFixed(1)} ${unit}`);
    }
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
    slider.addEventListener("input", () => setText(value, `${slider.value} ${unit}`));
    slider.addEventListener("change", () => this.#move([`${name}=${slider.value}${unit}`], false));
    this.#sliders.set(name, { slider, value, scale, unit });
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

  /**
   * @param {(string | number)[]} to
   * @param {boolean} relative
   */
  async #move(to, relative) {
    setText(this.#note, "");
    try {
      await post("api/move", { to, relative });
    } catch (error) {
      setText(this.#note, error instanceof Error ? error.message : String(error));
    }
  }
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
