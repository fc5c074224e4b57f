/** Pause, step and resume, and breakpoints. */

import { isSignedIn, post } from "../api.js";
import { byId, setText } from "../dom.js";

/** @typedef {import("../model/shown_run.js").ShownRun} ShownRun */
/** @typedef {import("../connection.js").Status} Status */

/** Changes the run that is under way. */
export class Controls {
  #shown;
  #refresh;
  #buttons = ["pause", "step", "resume"].map((name) => byId(name, HTMLButtonElement));

  /**
   * @param {ShownRun} shown
   * @param {() => void} refresh asks the server for its status
   */
  constructor(shown, refresh) {
    this.#shown = shown;
    this.#refresh = refresh;
    for (const button of this.#buttons)
      button.addEventListener("click", () => this.#act(`api/goals/${shown.live.goalId}/${button.id}`));
  }

  /** @param {Status | null} status */
  draw(status) {
    const { isLive, live } = this.#shown;
    byId("controls", HTMLElement).hidden = !isLive && !live.active;
    const usable = isSignedIn() && live.active;
    const paused = status?.paused ?? false;
    for (const button of this.#buttons) button.disabled = !usable || (button.id === "pause") === paused;
  }

  /**
   * Set a breakpoint, or clear it.
   * @param {string} node path
   * @param {boolean} on
   */
  async setBreakpoint(node, on) {
    await this.#act("api/breakpoints", { node, on });
  }

  /** Activate the arm, which may move it. */
  async activate() {
    await this.#act("api/arm/activate");
  }

  /**
   * @param {string} path
   * @param {object} [body]
   */
  async #act(path, body) {
    const note = byId("control-error", HTMLElement);
    try {
      await post(path, body);
      setText(note, "");
    } catch (error) {
      setText(note, error instanceof Error ? error.message : String(error));
    }
    this.#refresh();
  }
}
