/** The poses: moves to poses, saves the pose of the arm, and removes poses. */

import { getAtLast, isSignedIn, post, sendGoal, wordsOf } from "../api.js";
import { byId, element, setAttribute, setText, setUsable } from "../dom.js";

/** @typedef {import("../connection.js").Status} Status */

/**
 * @typedef {object} Pose What the server answers at `/api/poses`.
 * @property {string} pose name
 * @property {Record<string, number>} positions by joint [rad or m]
 * @property {string} source
 */

/** Lists the poses, with a form to save one. */
export class PosesView {
  #list = byId("poses", HTMLElement);
  #form = byId("pose-form", HTMLFormElement);
  #name = byId("pose-name", HTMLInputElement);
  #group = byId("pose-group", HTMLSelectElement);
  #replace = byId("pose-replace", HTMLInputElement);
  #note = byId("move-error", HTMLElement);

  constructor() {
    this.#form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#save();
    });
  }

  /**
   * List the poses, and the groups of joints that can be saved.
   * @param {string[]} groups
   */
  async show(groups) {
    this.#group.replaceChildren(...[...groups, "all"].map((group) => element("option", {}, group)));
    await this.#refresh();
  }

  /**
   * @param {Status | null} status
   * @param {boolean} idle True if no goal is under way
   */
  draw(status, idle) {
    const active = isSignedIn() && status?.arm === "active";
    for (const button of this.#list.querySelectorAll("button"))
      setUsable(button, button.className === "remove" ? isSignedIn() : active && idle);
    const save = this.#form.querySelector("button");
    if (save) setUsable(save, active);
  }

  async #refresh() {
    const poses = /** @type {Pose[]} */ ((await getAtLast("api/poses")).poses);
    this.#list.replaceChildren(...poses.map((pose) => this.#item(pose)));
  }

  /** @param {Pose} pose */
  #item({ pose, positions, source }) {
    const joints = Object.keys(positions).join(", ");
    const go = element("button", { type: "button", title: `${joints}; ${source}` }, pose);
    go.addEventListener("click", () => this.#act(() => sendGoal("api/move", { to: [pose] })));
    const isOwn = /:\d+$/.test(source);
    return element("li", {}, go, ...(isOwn ? [this.#removal(pose)] : []));
  }

  /**
   * Return a button that removes a pose when it is pressed twice.
   * @param {string} pose
   */
  #removal(pose) {
    const button = element("button", { type: "button", class: "remove" });
    /** @param {boolean} asks */
    const ask = (asks) => {
      setText(button, asks ? "Remove?" : "×");
      setAttribute(button, "aria-label", asks ? `Remove ${pose}? Press again` : `Remove ${pose}`);
    };
    ask(false);
    button.addEventListener("blur", () => ask(false));
    button.addEventListener("click", () => {
      if (button.textContent === "×") return ask(true);
      this.#act(async () => {
        const { source } = await post("api/poses/remove", { name: pose });
        await this.#refresh();
        this.#name.focus();
        setText(byId("pose-saved", HTMLElement), `${pose} is removed from ${source}.`);
      });
    });
    return button;
  }

  async #save() {
    const body = { name: this.#name.value, group: this.#group.value, replace: this.#replace.checked };
    await this.#act(async () => {
      const { source } = await post("api/poses", body);
      this.#form.reset();
      await this.#refresh();
      setText(byId("pose-saved", HTMLElement), `${body.name} is saved in ${source}.`);
    });
  }

  /** @param {() => Promise<unknown>} act */
  async #act(act) {
    setText(this.#note, "");
    setText(byId("pose-saved", HTMLElement), "");
    try {
      await act();
    } catch (error) {
      setText(this.#note, wordsOf(error));
    }
  }
}
