/** Two recordings at one moment, and their differences. */

import { byId, element, isNew, setText } from "../dom.js";
import { RecordedRun } from "../model/recorded_run.js";
import { stateWords } from "./header.js";
import { isWritten, nameOf } from "./runs.js";
import { mark } from "./tree.js";

/** @typedef {import("../model/run.js").Run} Run */
/** @typedef {import("../model/history.js").History} History */
/** @typedef {import("../model/shown_run.js").ShownRun} ShownRun */
/** @typedef {import("./runs.js").Recording} Recording */

const MOST_NODES = 20;
const LEAST = 0.001; // smallest difference that is listed [rad or m]

/** Events: `change` when the other run has changed. */
export class Comparison extends EventTarget {
  #panel = byId("comparison", HTMLElement);
  #choice = byId("compare", HTMLSelectElement);
  #table = byId("differences", HTMLElement);
  /** @type {RecordedRun | null} */
  #other = null;
  #time = 0;
  /** @type {Map<string, string>} unit by joint, `rad` or `m` */
  units = new Map();

  constructor() {
    super();
    this.#choice.addEventListener("input", () => this.#open(this.#choice.value));
  }

  /** @returns {Run | null} the other run at the same moment; null for none */
  get run() {
    return this.#other?.run ?? null;
  }

  /** @returns {History | null} values of the other run over time; null for no other run */
  get history() {
    return this.#other?.history ?? null;
  }

  /** @param {number} time from the run's beginning [s] */
  seek(time) {
    this.#time = time;
    this.#other?.seek(Math.min(time, this.#other.duration));
  }

  /**
   * @param {ShownRun} shown
   * @param {Recording[]} recordings offered for the comparison
   */
  draw(shown, recordings) {
    this.#drawChoice(shown.recorded?.name ?? "", recordings);
    if (!shown.recorded) this.#other = null;
    this.#panel.hidden = !this.#other;
    if (!this.#other) return;
    const rows = differences(shown.run, this.#other.run, this.units);
    const key = JSON.stringify(rows);
    if (!isNew(this.#table, key)) return;
    const cells = rows.map((row) =>
      element("tr", {}, element("th", { scope: "row" }, row[0]), ...row.slice(1).map((each) => element("td", {}, each))),
    );
    this.#table.replaceChildren(...cells);
    setText(byId("differences-none", HTMLElement), rows.length ? "" : "Nothing differs at this moment.");
  }

  /** @param {string} name */
  async #open(name) {
    this.#other = null;
    if (name) {
      const other = new RecordedRun(name);
      other.addEventListener("change", () => this.dispatchEvent(new Event("change")));
      try {
        await other.open(this.#time);
        if (this.#choice.value === name) this.#other = other;
      } catch (error) {
        this.#choice.value = "";
        this.dispatchEvent(new CustomEvent("error", { detail: error }));
      }
    }
    this.dispatchEvent(new Event("change"));
  }

  /**
   * @param {string} shown
   * @param {Recording[]} recordings
   */
  #drawChoice(shown, recordings) {
    const offered = recordings.filter((each) => each.name !== shown && !isWritten(each));
    const key = [shown, ...offered.map((each) => each.name)].join("\n");
    if (!isNew(this.#choice, key)) return;
    const chosen = this.#choice.value;
    const options = offered.map((each) => element("option", { value: each.name }, nameOf(each)));
    this.#choice.replaceChildren(element("option", { value: "" }, "Compare with…"), ...options);
    this.#choice.value = chosen === shown ? "" : chosen;
    if (this.#choice.value === "") this.#other = null;
  }
}

/**
 * Return the differences of two runs: name, value, other value, and difference.
 * @param {Run} one
 * @param {Run} other
 * @param {Map<string, string>} units by joint
 * @returns {string[][]}
 */
function differences(one, other, units) {
  const facts = [
    ["Goal", stateWords(one.state), stateWords(other.state)],
    ["Phase", one.phase, other.phase],
    ["Progress", percent(one), percent(other)],
    ["Attempt", String(one.attempt), String(other.attempt)],
  ];
  const rows = facts.filter(([, a, b]) => a !== b).map((row) => [...row, ""]);
  const joints = Object.entries(one.positions ?? {}).flatMap(([joint, value]) => {
    const its = other.positions?.[joint];
    if (its === undefined || Math.abs(value - its) < LEAST) return [];
    return [[joint, ...[value, its, value - its].map((each) => words(each, units.get(joint)))]];
  });
  const same = one.task === other.task; // different tasks have no common nodes
  const nodes = [...(same ? one.nodes.values() : [])].flatMap((node) => {
    const its = other.nodes.get(node.path)?.status ?? "INVALID";
    return its === node.status ? [] : [[node.name, mark(node.status)[1], mark(its)[1], ""]];
  });
  return [...rows, ...joints, ...nodes.slice(0, MOST_NODES)];
}

/** @param {Run} run */
function percent({ percentage }) {
  return percentage === null ? "" : `${percentage} %`;
}

/**
 * Return a position for people.
 * @param {number} value [rad or m]
 * @param {string} [unit]
 */
function words(value, unit) {
  return unit === "m" ? `${(value * 1000).toFixed(1)} mm` : `${((value * 180) / Math.PI).toFixed(1)}°`;
}
