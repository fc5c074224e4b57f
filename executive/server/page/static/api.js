/**
 * Requests to the server, and the token of this tab.
 *
 * The token is in the storage of this tab. Browsers send cookies to every port of a machine, so
 * another program on it could read one; this storage belongs to this address with its port. The
 * token survives a reload, and is of no use after the server has ended.
 */

const KEY = "armtree-token";
const TIMEOUT = 10_000; // a request fails after this time without an answer [ms]
const RETRY = 1000; // pause after a request without an answer [ms]

/** No cookies: those of other programs on this machine could make a stop too long to be served first. */
const isLocal = ["localhost", "127.0.0.1", "[::1]"].includes(location.hostname);
/** @type {RequestCredentials} */
const CREDENTIALS = isLocal ? "omit" : "same-origin";

/**
 * @typedef {object} Cause Why a goal or a request failed.
 * @property {string} code
 * @property {string} message
 * @property {string} node path of the node; empty if the cause is outside the tree
 * @property {string} joint name of the joint; empty if the cause concerns no joint
 * @property {string} hint
 * @property {string} place lines of a node that was refused before the run; else empty
 * @property {string} argument name of the task's argument with a wrong value; else empty
 */

/** Hints for this page, by code. The hints of the server name commands. */
const HINTS = /** @type {Record<string, string>} */ ({
  "goal.bad_arguments": "", // the form shows the limits
  "goal.busy": "wait, or press STOP",
  "goal.too_many_breakpoints": "clear one in the tree",
  "hw.not_active": "press Activate beside the tasks; if there is no such button, start the server again",
  "task.failed": "", // the page shows the node and its line
  "request.token": "open the link that armtree serve printed, or type: armtree view",
});

/**
 * Return the hint for a cause; empty if there is none.
 * @param {Cause} cause
 */
export function hintOf({ code, hint }) {
  return HINTS[code] ?? hint;
}

/**
 * Return a message of the server without identities of goals, which mean nothing to people.
 * @param {string} message
 */
export function withoutIds(message) {
  return message.replace(/ \([0-9a-f]{32}\)|\bgoal [0-9a-f]{32} for /g, "");
}

/** A request that the server refused. */
export class Refused extends Error {
  /**
   * @param {number} status HTTP status
   * @param {Cause} cause
   */
  constructor(status, cause) {
    const message = withoutIds(cause.message);
    const hint = hintOf(cause);
    super(plain(message.includes(hint) ? message : `${message}. ${sentence(hint)}`));
    this.status = status;
    this.code = cause.code;
    this.argument = cause.argument;
  }
}

/**
 * Return the message of an error, for people.
 * @param {unknown} error
 */
export function wordsOf(error) {
  return error instanceof Error ? error.message : String(error);
}

/** @param {string} words of the server, with code between backticks */
function plain(words) {
  return words.replaceAll("`", "");
}

/** @param {string} hint */
function sentence(hint) {
  return hint.charAt(0).toUpperCase() + hint.slice(1);
}

/**
 * Events of this tab: `change` when it signs in or out, `goal` when the server accepted one of its
 * goals, `stop` when it stops the arm.
 */
export const session = new EventTarget();

/** @returns {boolean} True if this tab has a token. */
export function isSignedIn() {
  return sessionStorage.getItem(KEY) !== null;
}

/** @param {string | null} token */
function setToken(token) {
  if (token === null) sessionStorage.removeItem(KEY);
  else sessionStorage.setItem(KEY, token);
  session.dispatchEvent(new Event("change"));
}

/**
 * Sign in with the code in the address, and remove the code from the address. Without a code, check
 * the token, which may be from an earlier run of the server.
 */
export async function signIn() {
  const words = new URLSearchParams(location.hash.slice(1));
  const code = words.get("code");
  if (code === null) return checkSession();
  words.delete("code");
  history.replaceState(null, "", `${location.pathname}${words.size ? `#${words}` : ""}`);
  const { token } = await post("api/session", { code });
  setToken(token);
}

/** Sign out if the token is from an earlier run of the server. */
export async function checkSession() {
  if (isSignedIn()) await get("api/session").catch(() => undefined);
}

/**
 * @param {string} path
 * @param {AbortSignal | null} [signal] null for no timeout, for answers that take the server long
 * @param {"json" | "arrayBuffer"} [kind]
 * @returns {Promise<any>} the JSON, or the bytes
 */
export async function get(path, signal = AbortSignal.timeout(TIMEOUT), kind = "json") {
  return (await request(path, { signal }))[kind]();
}

/**
 * Repeat a request until the server answers.
 * @param {string} path
 * @returns {Promise<any>} the JSON; throws Refused if the server refuses it
 */
export async function getAtLast(path) {
  for (;;) {
    try {
      return await get(path);
    } catch (error) {
      if (error instanceof Refused) throw error;
      await new Promise((done) => setTimeout(done, RETRY));
    }
  }
}

/**
 * @param {string} path
 * @param {object} [body]
 * @param {AbortSignal} [signal]
 * @returns {Promise<any>} the JSON
 */
export async function post(path, body = {}, signal) {
  const headers = { "content-type": "application/json" };
  /** @type {RequestPriority} */
  const priority = path === "api/stop" ? "high" : "auto";
  const options = { method: "POST", body: JSON.stringify(body), headers, signal, priority };
  return (await request(path, options)).json();
}

/** @type {number | undefined} stops of the arm in the newest status */
let stops;

/**
 * Store the number of stops in a new status.
 * @param {number} count
 */
export function setStops(count) {
  stops = count;
}

/** @returns {number | undefined} stops of the arm in the newest status */
export function knownStops() {
  return stops;
}

/**
 * Send a goal. The server refuses it if the arm was stopped after the newest status.
 * @param {"api/goals" | "api/move"} path
 * @param {object} body
 * @returns {Promise<string>} identity of the goal
 */
export async function sendGoal(path, body) {
  const { goal_id } = await post(path, { ...body, stops });
  session.dispatchEvent(new Event("goal"));
  return goal_id;
}

/**
 * Send a request; throw Refused if the server refuses it, another error if it does not answer.
 * @param {string} path
 * @param {RequestInit} options
 */
export async function request(path, options) {
  const headers = new Headers(options.headers);
  const token = sessionStorage.getItem(KEY);
  if (token !== null) headers.set("authorization", `Bearer ${token}`);
  const all = { ...options, headers, cache: /** @type {const} */ ("no-store"), credentials: CREDENTIALS };
  const response = await fetch(path, all).catch((cause) => {
    throw new Error("The server does not answer.", { cause });
  });
  if (response.ok) return response;
  const cause = await response.json();
  if (cause.code === "request.token" && token !== null) setToken(null);
  throw new Refused(response.status, cause);
}

/**
 * Return the path of a recording on the server.
 * @param {string} name
 */
export function pathOf(name) {
  return `api/recordings/${encodeURIComponent(name)}`;
}
