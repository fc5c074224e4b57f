/** Beside the tree: what runs now, why the goal failed, and the selected node. */

import { hintOf, post } from "../api.js";
import { byId, element, isNew, setText } from "../dom.js";
import { recordingHash } from "./player.js";
import { mark } from "./tree.js";

/** @typedef {import("../connection.js").Status} Status */
/** @typedef {import("../model/shown_run.js").ShownRun} ShownRun */
/** @typedef {import("./runs.js").RunsView} RunsView */

/**
 * Return the place of a node in the task's files, and the places that use its subtree.
 * @param {ShownRun} shown
 * @param {string} path
 */
function places(shown, path) {
  const facts = shown.facts.get(path);
  if (!facts) return "";
  const found = [`${facts.file}:${facts.line}`];
  for (let node = shown.run.nodes.get(path) ?? null; node; node = node.parent) {
    const call = shown.facts.get(node.path)?.called_at;
    if (call) found.push(call);
  }
  return found.join(", used by ");
}

/**
 * Return a button that selects a node.
 * @param {string} path
 * @param {string} text
 */
function link(path, text) {
  const button = element("button", { type: "button", class: "link" }, text);
  button.dataset.path = path;
  return button;
}

/** @param {ShownRun} shown */
export function drawRunning(shown) {
  const list = byId("running", HTMLElement);
  const now = shown.live.active || shown.isLive; // the page never hides a running goal
  const { running } = now ? shown.live : shown.run;
  setText(byId("running-title", HTMLElement), now ? "Running now" : "Running at this moment");
  const key = running.map((node) => `${node.path}\n${node.message}`).join("\n\n");
  if (!isNew(list, key)) return;
  const items = running.map((node) => {
    const message = element("span", { class: "message" }, node.message);
    return element("li", {}, link(node.path, node.name), message);
  });
  list.replaceChildren(...(items.length ? items : [element("li", { class: "quiet" }, "nothing")]));
}

/**
 * Show the waiting goals, each with a button that cancels it.
 * @param {Status | null} status
 * @param {RunsView} runs
 */
export function drawWaiting(status, runs) {
  const list = byId("waiting", HTMLElement);
  const waiting = status?.waiting ?? [];
  const titles = waiting.map((identity) => runs.titleOf(identity)); // titles are known after the goals are loaded
  if (!isNew(list, [...waiting, ...titles].join(" "))) return;
  const items = waiting.map((identity, index) => {
    const cancel = element("button", { type: "button" }, "Cancel");
    cancel.addEventListener("click", () => post(`api/goals/${identity}/cancel`).catch(() => undefined));
    return element("li", {}, element("span", { class: "name" }, `${titles[index]}, waiting`), cancel);
  });
  list.replaceChildren(...items);
}

/**
 * @param {ShownRun} shown
 * @returns {boolean} True if it shows another failure than before
 */
export function drawFailure(shown) {
  const { run } = shown;
  const card = byId("failure", HTMLElement);
  const cause = run.state === "ABORTED" ? run.outcome?.cause : null;
  card.hidden = !cause;
  const place = cause ? cause.place || places(shown, cause.node) : "";
  const hint = cause ? hintOf(cause) : "";
  const recording = run.outcome?.recording.split("/").at(-1) ?? "";
  const failure = `${run.goalId} ${cause?.message}`;
  const hasNode = cause ? run.nodes.has(cause.node) : false;
  if (!cause || !isNew(card, `${failure} ${place} ${hasNode}`)) return false;
  const isOther = card.dataset.failure !== failure; // the place and node of the same failure may arrive later
  card.dataset.failure = failure;
  card.replaceChildren(
    element("h2", {}, `${run.title} ${shown.planned ? "would fail" : "failed"}`),
    element("p", { class: "cause" }, cause.message),
    ...(hint && !cause.message.includes(hint) ? [element("p", {}, "What to do: ", ...withCode(hint))] : []),
    facts([
      ["Node", hasNode ? link(cause.node, cause.node) : cause.node],
      ["Joint", cause.joint],
      ["Line", place],
      ["Code", cause.code],
      ["Recording", recording && element("a", { href: recordingHash(recording) }, recording)],
    ]),
  );
  return isOther;
}

/**
 * Return a text with its parts in backticks as code.
 * @param {string} text
 */
function withCode(text) {
  return text.split("`").map((part, index) => (index % 2 ? element("code", {}, part) : part));
}

/**
 * @param {ShownRun} shown
 * @param {string} path of the selected node; empty for none
 */
export function drawNode(shown, path) {
  const card = byId("node", HTMLElement);
  const node = shown.run.nodes.get(path);
  card.hidden = !node;
  if (!node) return;
  const known = shown.facts.get(path);
  const key = JSON.stringify([path, node.status, node.message, node.began, node.inputs, known?.line, shown.run.goalId]);
  if (!isNew(card, key)) return;
  const began = node.began === null ? "" : `${(node.began - shown.run.began).toFixed(2)} s after the goal began`;
  card.replaceChildren(
    element("h2", {}, node.name),
    facts([
      ["Status", mark(node.status)[1]],
      ["Message", node.message],
      ["Kind", known?.kind ?? ""],
      ["Started", began],
      ["Starts", node.starts > 1 ? String(node.starts) : ""],
      ["Line", places(shown, path)],
      ["Path", path],
    ]),
    ...ports(known?.ports ?? {}, node.inputs),
  );
}

/**
 * @param {Record<string, string>} written values and keys in the files, by port
 * @param {Record<string, string>} read values in the run, by port
 */
function ports(written, read) {
  const names = Object.keys({ ...written, ...read });
  const rows = names.map((name) => /** @type {[string, string]} */ ([name, portWords(written[name] ?? "", read[name])]));
  if (rows.length === 0) return [];
  return [element("h3", {}, "Ports"), facts(rows)];
}

/**
 * @param {string} written a value or a key in the files; the run may replace a value that is a default
 * @param {string | undefined} read
 */
function portWords(written, read) {
  if (read === undefined) return written;
  return written.startsWith("$") ? `${written} = ${read}` : read;
}

/**
 * Return a list of names and values, without empty values.
 * @param {[string, string | Node][]} rows
 */
function facts(rows) {
  const known = rows.filter(([, value]) => value);
  const parts = known.map(([name, value]) =>
    element("div", {}, element("dt", {}, name), element("dd", {}, value)),
  );
  return element("dl", { class: "table" }, ...parts);
}

/**
 * @param {ShownRun} shown
 * @param {boolean} paused
 */
export function drawPause(shown, paused) {
  const note = byId("paused", HTMLElement);
  note.hidden = !(paused && shown.isLive);
  const next = shown.run.running.at(-1)?.name;
  setText(note, next ? `Paused at ${next}. Step or resume.` : "Paused. Step or resume.");
}
