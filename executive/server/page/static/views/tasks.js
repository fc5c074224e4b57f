/** The tasks, each with a form of its parameters and the state of its last goal. */

import { Refused, isSignedIn, post, sendGoal, wordsOf } from "../api.js";
import { byId, element, isNew, reveal, setAttribute, setChildren, setText, setUsable } from "../dom.js";
import { stateWords } from "./header.js";

/** @typedef {import("../model/run.js").Goal} Goal */
/** @typedef {import("../connection.js").Status} Status */

/**
 * @typedef {object} Input A parameter.
 * @property {string} type
 * @property {string} unit of the limits
 * @property {Record<string, number>} units factor of each unit that a value may have, to the unit of the limits
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

/** Units for people, by type. Other types have their first unit. */
const PEOPLE = /** @type {Record<string, string>} */ ({ angle: "deg", length: "mm" });
const QUANTITY = /^([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?) ?([a-z]*)$/i;

const POLICIES = /** @type {Record<string, string>} */ ({
  reject: "While a goal runs, another one is refused.",
  queue: "While a goal runs, others wait for its end.",
  preempt: "A new goal stops the running one and replaces it.",
});

/** Lists the tasks. Events: `preview` with the events of a dry run. */
export class TasksView extends EventTarget {
  #list = byId("tasks", HTMLElement);
  /** @type {Map<string, ReturnType<typeof taskItem>>} by their content */
  #items = new Map();

  /**
   * @param {Task[]} tasks
   * @param {Goal[]} goals newest first
   * @param {Status | null} status
   * @param {boolean} idle True if no goal is under way
   */
  draw(tasks, goals, status, idle) {
    this.#drawArm(status);
    if (isNew(this.#list, JSON.stringify(tasks))) {
      this.#items = new Map(tasks.map((task) => this.#item(task)));
      setChildren(this.#list, [...this.#items.values()].map((each) => each.element));
    }
    setText(byId("policy", HTMLElement), POLICIES[status?.policy ?? ""] ?? "");
    const active = status?.arm === "active";
    for (const [index, item] of [...this.#list.children].entries()) {
      const last = goals.find((goal) => goal.task === tasks[index].task);
      const state = /** @type {HTMLElement} */ (item.querySelector("[data-state]"));
      setText(state, last ? stateWords(last.state) : "");
      state.dataset.state = last?.state ?? "";
      const [run, dry] = item.querySelectorAll("button");
      setUsable(run, isSignedIn() && active);
      setUsable(dry, isSignedIn() && idle);
    }
    for (const item of this.#items.values()) item.settle(goals);
  }

  /**
   * Return the item of a task, with its content as key. An unchanged item stays, with its typed text.
   * @param {Task} task
   * @returns {[string, ReturnType<typeof taskItem>]}
   */
  #item(task) {
    const key = JSON.stringify(task);
    return [key, this.#items.get(key) ?? taskItem(task, (events) => this.#preview(events))];
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
  let own = ""; // identity of the last goal of this form, until it ends

  /**
   * Show a mistake, at the field of the argument if it is in an argument.
   * @param {string} words
   * @param {string} argument empty for none
   */
  function refuse(words, argument) {
    const wrong = fields.find((each) => each.name === argument);
    const at = wrong?.note ?? note;
    setText(at, words.replace(`arguments: ${argument}: `, ""));
    if (wrong) setAttribute(wrong.control, "aria-invalid", "true");
    reveal(at);
  }

  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    for (const each of [note, found]) setText(each, "");
    for (const each of fields) each.clear();
    const values = fields.map((each) => [each.name, each.control.value]).filter(([, value]) => value !== "");
    const goal = { task: task.task, arguments: Object.fromEntries(values) };
    try {
      own = "";
      if (event.submitter !== dry) return void (own = await sendGoal("api/goals", goal));
      const { events, unknown } = await post("api/plan", goal);
      setText(found, dryRunWords(events, unknown));
      preview(events);
      reveal(found);
    } catch (error) {
      refuse(wordsOf(error), error instanceof Refused ? error.argument : "");
    }
  });
  const title = element("span", { class: "name" }, `${task.task} ${task.name}`);
  const head = element("summary", {}, title, element("span", { "data-state": "" }));
  const about = element("p", { class: "quiet" }, task.description);
  return {
    element: element("li", {}, element("details", {}, head, about, form)),
    /**
     * Show the mistake of the form's last goal at the field of the wrong argument.
     * @param {Goal[]} goals
     */
    settle(goals) {
      const result = goals.find((each) => each.goal_id === own)?.result;
      if (!result) return;
      own = "";
      if (result.cause?.argument) refuse(result.cause.message, result.cause.argument);
    },
  };
}

/**
 * @param {any[]} events of a dry run
 * @param {string[]} unknown
 */
function dryRunWords(events, unknown) {
  const cause = events.find((each) => each.event === "status")?.result?.cause;
  if (cause) return `Dry run: the task would fail. ${cause.message}`;
  const plans = events.filter((each) => each.event === "schedule");
  const seconds = plans.reduce((sum, each) => sum + each.duration_s, 0).toFixed(1);
  const motions = plans.length === 1 ? "1 motion" : `${plans.length} motions`;
  return [`Dry run: ${motions}, ${seconds} s. Nothing moves.`, ...unknown.map((each) => `Known only in a run: ${each}.`)].join(" ");
}

/**
 * Return a field of a form.
 * @param {number} task
 * @param {string} name
 * @param {Input} input
 */
function field(task, name, input) {
  const choices = input.type === "boolean" ? ["true", "false"] : input.choices;
  const id = `task-${task}-${name}`;
  const note = element("p", { id: `${id}-note`, class: "failed", role: "alert" });
  const attributes = { id, "aria-describedby": note.id };
  const control = choices.length
    ? element("select", attributes, ...["", ...choices].map((each) => element("option", {}, each)))
    : element("input", { ...attributes, ...limits(input), required: input.needed });
  /** Clear the server's message about an earlier value. */
  function clear() {
    setText(note, "");
    control.removeAttribute("aria-invalid");
  }
  control.addEventListener("input", () => {
    clear();
    control.setCustomValidity(mistakeIn(control.value.trim(), input));
  });
  const help = [input.description, range(input), input.default && `default ${input.default}`].filter(Boolean).join("; ");
  const label = element("label", { for: id }, name, element("span", { class: "quiet" }, ` ${help}`));
  return { name, control, note, clear, row: element("div", { class: "field" }, label, control, note) };
}

/** @param {Input} input @returns {Record<string, string | number | boolean>} attributes */
function limits(input) {
  if (input.type !== "number" && input.type !== "integer") return { type: "text" };
  const step = input.type === "integer" ? 1 : "any";
  return { type: "number", step, min: input.least ?? false, max: input.most ?? false };
}

/** @param {Input} input @returns {string} the limits, in units for people */
function range({ type, least, most, unit, units }) {
  const name = PEOPLE[type] ?? unit;
  const [low, high] = [least, most].map((each) => each !== null && Number((each / (units[name] ?? 1)).toPrecision(6)));
  if (low === false && high === false) return "";
  if (high === false) return `from ${low} ${name}`.trim();
  return (low === false ? `up to ${high} ${name}` : `${low} to ${high} ${name}`).trim();
}

/**
 * Return the mistake in a quantity; empty if there is none, or if its type has no units.
 * @param {string} text
 * @param {Input} input
 */
function mistakeIn(text, input) {
  const { type, least, most, units } = input;
  const names = Object.keys(units);
  if (!text || names.length === 0) return "";
  const [, number, unit] = QUANTITY.exec(text) ?? [];
  if (number === undefined) return `Write a number and a unit, such as 10 ${PEOPLE[type] ?? names[0]}.`;
  const factor = units[unit || names[0]];
  if (factor === undefined) return `There is no unit ${unit}; there are ${names.join(", ")}.`;
  const value = Number(number) * factor;
  const right = value >= (least ?? -Infinity) && value <= (most ?? Infinity);
  return right ? "" : `${text}${unit ? "" : ` ${names[0]}`} is not within the limits: ${range(input)}.`;
}
