/** The header: robot, port, arm, goal, and the state of the connection and of the sign-in. */

import { hintOf, isSignedIn } from "../api.js";
import { byId, setAttribute, setText } from "../dom.js";

/** @typedef {import("../connection.js").Status} Status */
/** @typedef {import("../connection.js").Connection} Connection */
/** @typedef {import("../model/run.js").Run} Run */

const WORDS = /** @type {Record<string, string>} */ ({
  ACCEPTED: "accepted",
  EXECUTING: "running",
  CANCELING: "stopping…",
  SUCCEEDED: "done",
  CANCELED: "canceled",
  ABORTED: "failed",
  UNFINISHED: "cut off",
});

/**
 * Return the state of a goal for people.
 * @param {string} state
 */
export function stateWords(state) {
  return WORDS[state] ?? state.toLowerCase();
}

/**
 * @param {Connection} connection
 * @param {Run} run
 * @param {Status | null} status
 */
export function drawHeader(connection, run, status) {
  drawConnection(connection);
  drawSession();
  if (status) {
    setText(byId("port", HTMLElement), portWords(status.port));
    const arm = byId("arm-state", HTMLElement);
    setText(arm, status.fault ? `${status.arm}, fault` : status.arm);
    setAttribute(arm, "title", status.fault ? `${status.fault.message} ${hintOf(status.fault)}` : "");
    arm.classList.toggle("failed", status.fault !== null);
  }
  setText(byId("goal-title", HTMLElement), run.title || "none");
  const state = byId("goal-state", HTMLElement);
  setText(state, goalWords(run, status));
  state.dataset.state = run.state;
  const progress = byId("progress", HTMLProgressElement);
  progress.hidden = !run.active;
  if (run.percentage === null) progress.removeAttribute("value");
  else progress.value = run.percentage;
}

/** @param {string} port */
function portWords(port) {
  return port === "virtual" ? "virtual, no real arm" : port || "none";
}

/**
 * @param {Run} run
 * @param {Status | null} status
 */
function goalWords(run, status) {
  if (run.state !== "EXECUTING") return run.state ? stateWords(run.state) : "";
  const attempt = run.attempt > 1 ? `, attempt ${run.attempt}` : "";
  const waiting = status?.waiting.length ? `, ${status.waiting.length} waiting` : "";
  return `${run.phase || "running"}${attempt}${waiting}`;
}

/** @param {Connection} connection */
function drawConnection(connection) {
  const lost = !connection.alive && connection.heard > 0;
  document.body.classList.toggle("lost", !connection.alive);
  const note = byId("connection", HTMLElement);
  note.hidden = connection.alive && !connection.refusal && !connection.crowded;
  if (connection.crowded && connection.alive)
    setText(note, "Too many tabs show this arm. Close one, and this tab follows the tree.");
  else if (connection.refusal) setText(note, `The server shows nothing: ${connection.refusal}`);
  else if (lost) setText(note, `No connection for ${age(connection.heard)}. The page shows ${time(connection.heard)}.`);
  else setText(note, "Connecting…");
}

function drawSession() {
  const known = isSignedIn();
  document.body.classList.toggle("signed-in", known);
  setText(byId("session", HTMLElement), known ? "signed in" : "watching only");
  byId("sign-in-help", HTMLElement).hidden = known;
}

/** @param {number} since [ms since 1970] */
function age(since) {
  const seconds = Math.max(0, Math.round((Date.now() - since) / 1000));
  return seconds < 120 ? `${seconds} s` : `${Math.round(seconds / 60)} min`;
}

/** @param {number} at [ms since 1970] */
function time(at) {
  return new Date(at).toLocaleTimeString();
}
