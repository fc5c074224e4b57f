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

const POLICIES = /** @type {Record<string, string>} */ ({
  reject: "While a goal runs, another one is refused.",
  queue: "While a goal runs, others wait for its end.",
  preempt: "A new goal stops the one that runs, and takes its place.",
});

/** Lists the tasks. Events: `preview` with the events of a dry run. */
export class TasksView extends EventTarget {
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
      this.#list.replaceChildren(...tasks.map((task) => taskItem(task, (events) => this.#preview(events))));
    }
    setText(byId("policy", HTMLElement), POLICIES[status?.policy ?? ""] ?? "");
    const active = status?.arm === "active";
    for (const [index, item] of [...this.#list.children].entries()) {
      const last = goals.find((goal) => goal.task === tasks[index].task);
      const state = /** @type {HTMLElement} */ (item.querySelector("[data-state]"));
      setText(state, last ? stateWords(last.state) : "");
      state.dataset.state = last?.state ?? "";
      const [run, dry] = item.querySelectorAll("button");
      run.disabled = !isSignedIn() || !active;
      dry.disabled = !isSignedIn() || status?.goal !== null;
    }
  }

  /** @param {any[]} events */
  #preview(events) {
    this.dispatchEvent(new CustomEvent("preview", { detail: events }));
  }

  /** @param {Status | null} status */
  #drawArm(status) {
    const words = !status || status.arm === "active" ? "" : `The arm is ${status.arm}, so goals fail.`;
    setText(byId("arm-note", HTMLElement), words);
    const hidden = !isSignedIn() || !["unconfigured", "inactive"].includes(status?.arm ?? "");
    byId("activate", HTMLButtonElement).hidden = hidden;
    byId("opening", HTMLElement).hidden = hidden;
  }
}

/**
 * @param {Task} task
 * @param {(events: any[]) => void} preview
 */
function taskItem(task, preview) {
  const fields = Object.entries(task.inputs).map(([name, input]) => field(task.task, name, input));
  const note = element("p", { class: "failed", role: "alert" }, task.wrong);
  const found = element("p", { class: "quiet", role: "status" });
  const run = element("button", { type: "submit" }, "Run");
  const dry = element("button", { type: "submit", title: "Check and plan; nothing moves" }, "Dry run");
  const form = element("form", {}, ...fields.map((each) => each.row), element("div", { class: "buttons" }, run, dry), found, note);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    setText(note, "");
    setText(found, "");
    const values = fields.map((each) => [each.name, each.value()]).filter(([, value]) => value !== "");
    const goal = { task: task.task, arguments: Object.fromEntries(values) };
    try {
      if (event.submitter !== dry) return void (await post("api/goals", goal));
      const { events, unknown } = await post("api/plan", goal);
      setText(found, dryRunWords(events, unknown));
      preview(events);
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
 * @param {any[]} events of a dry run
 * @param {string[]} unknown
 */
function dryRunWords(events, unknown) {
  const plans = events.filter((each) => each.event === "schedule");
  const seconds = plans.reduce((sum, each) => sum + each.duration_s, 0).toFixed(1);
  const motions = plans.length === 1 ? "1 motion" : `${plans.length} motions`;
  return [`Dry run: ${motions}, ${seconds} s. Nothing moves.`, ...unknown.map((each) => `Known only in a run: ${each}.`)].join(" ");
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
