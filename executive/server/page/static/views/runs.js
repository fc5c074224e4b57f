/** The list of runs, newest first. */

import { get } from "../api.js";
import { byId, element } from "../dom.js";
import { goalTitle } from "../model/run.js";
import { stateWords } from "./header.js";

/** @typedef {import("../model/run.js").Goal} Goal */

const SHOWN = 50; // runs

/** Events: `open` with the Goal to show. */
export class RunsView extends EventTarget {
  #list = byId("runs", HTMLElement);
  /** @type {Goal[]} newest first */
  goals = [];
  /** @type {import("./tasks.js").Task[]} */
  tasks = [];

  /** Ask for the runs and the tasks again. */
  async refresh() {
    const [{ goals }, { tasks }] = await Promise.all([get(`api/goals?limit=${SHOWN}`), get("api/tasks")]);
    this.goals = goals.reverse();
    this.tasks = tasks;
  }

  /** @returns {Goal | undefined} the newest run */
  get newest() {
    return this.goals[0];
  }

  /** @param {string} shown id of the goal that is shown */
  draw(shown) {
    const key = JSON.stringify([shown, this.goals.map((goal) => goal.goal_id + goal.state)]);
    if (this.#list.dataset.key === key) return;
    this.#list.dataset.key = key;
    const items = this.goals.map((goal) => this.#item(goal, goal.goal_id === shown));
    this.#list.replaceChildren(...(items.length ? items : [element("li", { class: "quiet" }, "none yet")]));
  }

  /**
   * Return how people call a goal.
   * @param {string} identity
   */
  titleOf(identity) {
    const goal = this.goals.find((each) => each.goal_id === identity);
    return goal ? this.#title(goal) : "a goal";
  }

  /** @param {Goal} goal */
  #title({ task }) {
    return goalTitle(task, this.tasks.find((each) => each.task === task)?.name);
  }

  /**
   * @param {Goal} goal
   * @param {boolean} current
   */
  #item(goal, current) {
    const button = element(
      "button",
      { type: "button", class: "run", "aria-current": current ? "true" : false },
      element("span", { class: "name" }, this.#title(goal)),
      element("span", { "data-state": goal.state }, stateWords(goal.state)),
      element("span", { class: "quiet" }, when(goal.stamp_ns)),
    );
    button.addEventListener("click", () => this.dispatchEvent(new CustomEvent("open", { detail: goal })));
    return element("li", {}, button);
  }
}

/**
 * Return a time of this day, or a day and a time.
 * @param {number} stamp [ns since 1970]
 */
function when(stamp) {
  const date = new Date(stamp / 1e6);
  const today = date.toDateString() === new Date().toDateString();
  return today ? date.toLocaleTimeString() : `${date.toLocaleDateString()} ${date.toLocaleTimeString()}`;
}
