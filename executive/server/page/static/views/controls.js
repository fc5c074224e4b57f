/** Pause, step and resume, and breakpoints. */

import { isSignedIn, knownStops, post } from "../api.js";
import { byId, setText, setUsable } from "../dom.js";

/** @typedef {import("../model/shown_run.js").ShownRun} ShownRun */
/** @typedef {import("../connection.js").Status} Status */

/** Controls the running goal. */
export class Controls {
  #shown;
  #refresh;
  #arm = ""; // state of the arm's lifecycle
  #buttons = ["pause", "step", "resume"].map((name) => byId(name, HTMLButtonElement));

  /**
   * @param {ShownRun} shown
   * @param {() => void} refresh requests the status of the server
   */
  constructor(shown, refresh) {
    this.#shown = shown;
    this.#refresh = refresh;
    for (const button of this.#buttons)
      button.addEventListener("click", () => this.#act(`api/goals/${shown.live.goalId}/${button.id}`));
  }

  /** @param {Status | null} status */
  draw(status) {
    this.#arm = status?.arm ?? "";
    const { isLive, live } = this.#shown;
    byId("controls", HTMLElement).hidden = !isLive && !live.active;
    const usable = isSignedIn() && live.active;
    const paused = status?.paused ?? false;
    for (const button of this.#buttons) setUsable(button, usable && (button.id === "pause") !== paused);
  }

  /**
   * Set a breakpoint, or clear it.
   * @param {string} node path
   * @param {boolean} on
   */
  async setBreakpoint(node, on) {
    await this.#act("api/breakpoints", { node, on });
  }

  /** Configure the arm if needed, and activate it, which may move it. A stop meanwhile prevents this. */
  async activate() {
    const stops = knownStops();
    if (this.#arm === "unconfigured" && !(await this.#act("api/arm/configure"))) return;
    await this.#act("api/arm/activate", { stops });
  }

  /**
   * @param {string} path
   * @param {object} [body]
   * @returns {Promise<boolean>} True if the server accepted it
   */
  async #act(path, body) {
    const found = await post(path, body).then(
      () => "",
      (error) => error.message,
    );
    setText(byId("control-error", HTMLElement), found);
    this.#refresh();
    return found === "";
  }
}
