/** The STOP button. It needs no sign-in. The key Esc presses it from anywhere on the page. */

import { Refused, get, post, session } from "../api.js";
import { byId, setText } from "../dom.js";

const TIMEOUT = 2000; // longest time for the answer to a stop [ms]
const SAFETY = "software stop, not an emergency stop";

const LOST = "STOP cannot reach the server. Switch the servo power off.";
const UNPLUGGED = "The arm has no connection; switch off the power of its servos.";

/**
 * @param {() => boolean} isReachable returns true if the server answers
 * @param {() => boolean} isPlugged returns true if the server can reach the arm
 * @param {() => void} stopped called after the answer to a stop, or after its timeout
 * @returns {() => void} draws the button again
 */
export function showStop(isReachable, isPlugged, stopped) {
  const button = byId("stop", HTMLButtonElement);
  const note = byId("stop-note", HTMLElement);
  /** Result of the last stop; empty if there was none. */
  let answer = "";
  let stops = 0;

  function draw() {
    const lost = isReachable() ? "" : LOST;
    if (lost) answer = ""; // the result is old when the server is back
    const alarm = lost || (isPlugged() ? "" : UNPLUGGED);
    setText(note, alarm || answer || SAFETY);
    note.classList.toggle("alarm", Boolean(alarm) || answer.startsWith("STOP"));
  }

  async function stop() {
    const number = ++stops;
    session.dispatchEvent(new Event("stop"));
    answer = `stopping… (${SAFETY})`;
    button.classList.add("busy");
    draw();
    const result = await sendStop(stopped);
    if (number !== stops) return; // only the latest stop shows its result
    answer = result;
    button.classList.remove("busy");
    draw();
    setTimeout(() => {
      if (number !== stops) return;
      answer = "";
      draw();
    }, 10_000);
  }

  button.addEventListener("click", stop);
  window.addEventListener(
    "keydown",
    (event) => {
      if (event.key !== "Escape" || event.repeat || button.hidden) return;
      event.preventDefault();
      stop();
    },
    { capture: true },
  );
  draw();
  return draw;
}

/**
 * Stop the arm, and wait until every goal has ended.
 * @param {() => void} stopped called after the answer, or after its timeout
 * @returns {Promise<string>} the result, for people
 */
async function sendStop(stopped) {
  try {
    const answer = post("api/stop", {}, AbortSignal.timeout(TIMEOUT));
    answer.then(stopped, stopped);
    const { goals } = await answer;
    await Promise.all(goals.map(untilEnded));
    return `stopped at ${new Date().toLocaleTimeString()} (${SAFETY})`;
  } catch (error) {
    if (error instanceof Refused) return `STOP is not confirmed: ${error.message}`;
    return "STOP had no answer from the server. Switch the servo power off.";
  }
}

/** @param {string} goal */
async function untilEnded(goal) {
  await get(`api/goals/${goal}/result?timeout=5`, AbortSignal.timeout(6000));
}
