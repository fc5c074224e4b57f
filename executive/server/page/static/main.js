/** Starts the page: connects the server's events to the model, and the model to the views. */

import { get, session, signIn } from "./api.js";
import { Connection } from "./connection.js";
import { byId, oncePerFrame, setText } from "./dom.js";
import { Run } from "./model/run.js";
import { drawHeader } from "./views/header.js";
import { showStop } from "./views/stop.js";

const connection = new Connection();
const run = new Run();
/** @type {import("./connection.js").Status | null} */
let status = null;

const drawStop = showStop(() => connection.alive || connection.heard === 0);
const draw = oncePerFrame(() => {
  drawStop();
  drawHeader(connection, run, status);
});

connection.addEventListener("event", (event) => {
  run.update(/** @type {CustomEvent} */ (event).detail);
  draw();
});
connection.addEventListener("status", (event) => {
  status = /** @type {CustomEvent} */ (event).detail;
  if (status?.goal) run.updateGoal(status.goal);
  draw();
});
connection.addEventListener("begin", async () => {
  const robot = await get("api/robot");
  setText(byId("robot", HTMLElement), robot.name);
  document.title = `${robot.name}, armtree`;
});
connection.addEventListener("change", draw);
session.addEventListener("change", () => connection.refresh().then(draw));
setInterval(draw, 1000); // the age of what is shown

connection.start();
signIn().catch((error) => setText(byId("sign-in-error", HTMLElement), error.message));
draw();
