/** The tasks: each with a form of its parameters, and what its last run did. */

import { isSignedIn, post } from "../api.js";
import { byId, element, setText } from "../dom.js";
import { stateWords } from "./header.js";

/** @typedef {import("../model/run.js").Goal} Goal */
/** @typedef {import("../connection.js").Status} Status */

/**
 * @typedef {object} Input A parameter.
 * @property {string} type
 * @property {string} unit of the limits
 * @property {boolean} needed
 * @property {string} default as in a task file; empty for none
 * @property {number | null} least
 * @property {number | null} most
 * @property {string[]} choices
 * @property {string} description
 */

/**
 * @typedef {object} Task
 * @property {number} task
 * @property {string} name
 * @property {string} description
 * @property {string} wrong
 * @property {Record<string, Input>} inputs
 */

/** Lists the tasks. */
export class TasksView {
  #list = byId("tasks", HTMLElement);
  #key = "";

  /**
   * @param {Task[]} tasks
   * @param {Goal[]} goals newest first
   * @param {Status | null} status
   */
  draw(tasks, goals, status) {
    this.#drawArm(status);
    const key = JSON.stringify(tasks);
    if (key !== this.#key) {
      this.#key = key;
      this.#list.replaceChildren(...tasks.map(taskItem));
    }
    const usable = isSignedIn() && status?.arm === "active";
    for (const [index, item] of [...this.#list.children].entries()) {
      const last = goals.find((goal) => goal.task === tasks[index].task);
      const state = /** @type {HTMLElement} */ (item.querySelector("[data-state]"));
      setText(state, last ? stateWords(last.state) : "");
      state.dataset.state = last?.state ?? "";
      const button = item.querySelector("button");
      if (button) button.disabled = !usable;
    }
  }

  /** @param {Status | null} status */
  #drawArm(status) {
    const words = !status || status.arm === "active" ? "" : `The arm is ${status.arm}, so goals fail.`;
    setText(byId("arm-note", HTMLElement), words);
    const hidden = !(isSignedIn() && status?.arm === "inactive");
    byId("activate", HTMLButtonElement).hidden = hidden;
    byId("opening", HTMLElement).hidden = hidden;
  }
}

/** @param {Task} task */
function taskItem(task) {
  const fields = Object.entries(task.inputs).map(([name, input]) => field(task.task, name, input));
  const note = element("p", { class: "failed", role: "alert" }, task.wrong);
  const run = element("button", { type: "submit" }, "Run");
  const form = element("form", {}, ...fields.map((each) => each.row), run, note);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    setText(note, "");
    const values = fields.map((each) => [each.name, each.value()]).filter(([, value]) => value !== "");
    try {
      await post("api/goals", { task: task.task, arguments: Object.fromEntries(values) });
    } catch (error) {
      setText(note, error instanceof Error ? error.message : String(error));
    }
  });
  const title = element("span", { class: "name" }, `${task.task} ${task.name}`);
  const head = element("summary", {}, title, element("span", { "data-state": "" }));
  const about = element("p", { class: "quiet" }, task.description);
  return element("li", {}, element("details", {}, head, about, form));
}

/**
 * Return a field of a form, and a function that returns what was typed.
 * @param {number} task
 * @param {string} name
 * @param {Input} input
 */
function field(task, name, input) {
  const choices = input.type === "boolean" ? ["true", "false"] : input.choices;
  const id = `task-${task}-${name}`;
  const control = choices.length
    ? element("select", { id }, ...["", ...choices].map((each) => element("option", {}, each)))
    : element("input", { id, ...limits(input), required: input.needed });
  const help = [input.description, range(input), input.default && `default ${input.default}`].filter(Boolean).join("; ");
  const label = element("label", { for: id }, name, element("span", { class: "quiet" }, ` ${help}`));
  return { name, row: element("div", { class: "field" }, label, control), value: () => control.value };
}

/** @param {Input} input @returns {Record<string, string | number | boolean>} attributes */
function limits(input) {
  if (input.type !== "number" && input.type !== "integer") return { type: "text" };
  const step = input.type === "integer" ? 1 : "any";
  return { type: "number", step, min: input.least ?? false, max: input.most ?? false };
}

/** @param {Input} input */
function range({ least, most, unit }) {
  if (least === null && most === null) return "";
  if (most === null) return `from ${least} ${unit}`.trim();
  return (least === null ? `up to ${most} ${unit}` : `${least} to ${most} ${unit}`).trim();
}
