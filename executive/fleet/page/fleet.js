/* The arms of a fleet, read once a second. Texts of the fleet never become HTML. */

const PERIOD = 1000; // time between two requests [ms]
const GOOD = ["ready", "busy", "held", "inactive", "unconfigured"];

const arms = /** @type {HTMLElement} */ (document.getElementById("arms"));
const waiting = /** @type {HTMLElement} */ (document.getElementById("waiting"));
const summary = /** @type {HTMLElement} */ (document.getElementById("summary"));

/**
 * @typedef {{arm: string, state: string, job: string, last: string, done: number, url: string,
 *   host: string}} Arm
 * @typedef {{host: string, queued: number, waiting: string[], arms: Arm[]}} Fleet
 */

/**
 * Return the URL of an arm's page, or the reason that there is no link to it.
 *
 * @param {Arm} arm
 * @param {string} here - name of the machine of this page
 */
function link(arm, here) {
  const parts = /^https?:\/\//.test(arm.url) && URL.canParse(arm.url) && new URL(arm.url);
  if (!parts) return "its URL is not the URL of a page";
  if (arm.host !== here && /^(localhost|127\..*|\[::1\])$/.test(parts.hostname))
    return `its page is only on ${arm.host}; armtree serve --bind 0.0.0.0 --expose --host ${arm.host} shows it here`;
  return parts;
}

/** @param {string} text @param {string} [style] */
function cell(text, style = "") {
  const made = document.createElement("td");
  made.textContent = text || "-";
  made.className = style;
  return made;
}

/** @param {Arm} arm @param {string} here */
function row(arm, here) {
  const name = document.createElement("td");
  const target = link(arm, here);
  if (target instanceof URL) {
    const anchor = document.createElement("a");
    anchor.href = target.href;
    anchor.textContent = arm.arm;
    name.append(anchor);
  } else {
    name.textContent = arm.arm;
    name.title = target;
  }
  const made = document.createElement("tr");
  made.append(
    name,
    cell(arm.state, arm.state === "busy" ? "busy" : GOOD.includes(arm.state) ? "" : "bad"),
    cell(arm.job),
    cell(arm.last, arm.last && arm.last !== "ok" ? "bad" : ""),
    cell(String(arm.done)),
    cell(arm.host),
  );
  return made;
}

/** @param {Fleet} fleet */
function show(fleet) {
  /** @type {Record<string, number>} */
  const counts = {};
  for (const arm of fleet.arms) counts[arm.state] = (counts[arm.state] ?? 0) + 1;
  const states = Object.entries(counts).map(([state, count]) => `${count} ${state}`);
  summary.className = "";
  const jobs = fleet.queued === 1 ? "job" : "jobs";
  summary.textContent = `${fleet.arms.length} ${fleet.arms.length === 1 ? "arm" : "arms"}: ${states.join(", ") || "none has joined"}; ${fleet.queued} ${jobs} queued`;
  waiting.textContent = fleet.waiting.join(". ");
  arms.replaceChildren(...fleet.arms.map((arm) => row(arm, fleet.host)));
}

let shown = "";
async function update() {
  try {
    const answer = await fetch("arms", { signal: AbortSignal.timeout(5 * PERIOD) });
    const text = await answer.text();
    if (!answer.ok) throw new Error(text);
    if (text !== shown) show(JSON.parse(text));
    shown = text;
  } catch (error) {
    shown = "";
    summary.className = "bad";
    summary.textContent = `The list is old: ${error instanceof Error ? error.message : error}`;
  }
  setTimeout(update, PERIOD);
}

update();
