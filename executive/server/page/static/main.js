/** Starts the page: connects the server's events to the model, and the model to the views. */

import { getAtLast, isSignedIn, session, signIn } from "./api.js";
import { Connection } from "./connection.js";
import { byId, ignoreUnusable, oncePerFrame, reveal, setText } from "./dom.js";
import { Cursor } from "./model/cursor.js";
import { ShownRun } from "./model/shown_run.js";
import { ArmView } from "./views/arm.js";
import { Comparison } from "./views/comparison.js";
import { Controls } from "./views/controls.js";
import { drawHeader } from "./views/header.js";
import { LogView } from "./views/log.js";
import { MoveView } from "./views/move.js";
import { Player } from "./views/player.js";
import { PlotsView } from "./views/plots.js";
import { PosesView } from "./views/poses.js";
import { QuestionsView } from "./views/questions.js";
import { RunsView, isFinished } from "./views/runs.js";
import { drawFailure, drawNode, drawPause, drawRunning, drawWaiting } from "./views/side.js";
import { showStop } from "./views/stop.js";
import { TasksView } from "./views/tasks.js";
import { TreeView } from "./views/tree.js";

const connection = new Connection();
const shown = new ShownRun();
const cursor = new Cursor();
/** @type {import("./connection.js").Status | null} */
let status = null;
/** @type {import("./arm/model.js").Robot | null} the robot of the server */
let live = null;
let isLiveRobot = false; // True if the robot of the server is drawn
let empty = true; // True until a run is shown

const drawStop = showStop(
  () => connection.alive || connection.heard === 0,
  () => !(status?.arm === "unconfigured" && status.fault),
  () => connection.refresh(),
);
const tree = new TreeView(shown);
const controls = new Controls(shown, () => connection.refresh());
const runs = new RunsView();
const arm = new ArmView();
const tasks = new TasksView();
const questions = new QuestionsView();
const move = new MoveView();
const poses = new PosesView();
const plots = new PlotsView(cursor);
const log = new LogView(cursor);
const player = new Player(shown, cursor);
const comparison = new Comparison();

const drawPlayer = oncePerFrame(() => player.draw(runs.recordings));
// Without a graphics card, a playing recording would take the processor from the arm. So everything but
// the player is drawn less often.
const draw = oncePerFrame(drawAll, () => (shown.isLive ? 0 : arm.period));

function drawAll() {
  drawStop();
  drawHeader(connection, shown.live, status);
  setText(byId("shown", HTMLElement), shown.label);
  tree.draw(status?.breakpoints, cursor.time);
  drawRunning(shown);
  drawWaiting(status, runs);
  const fails = drawFailure(shown);
  drawNode(shown, tree.selected);
  drawPause(shown, status?.paused ?? false);
  controls.draw(status);
  // The page shows the current pose of the arm until the user selects a moment of the last run.
  const isNow = connection.hasArm && isLiveRobot && shown.isLast && cursor.live;
  arm.draw(shown, isNow ? shown.live : shown.run);
  arm.drawOther(comparison.run);
  runs.draw(shown.recorded?.name ?? runs.recordingOf(shown.live));
  player.draw(runs.recordings);
  comparison.draw(shown, runs.recordings);
  drawActs();
  plots.draw(shown.history, shown.isLive && shown.live.active, comparison.history);
  log.draw(shown.history);
  tree.scroll();
  log.scroll();
  if (fails && shown.run.task >= 0) bringIntoView(byId("failure", HTMLElement));
}

/** @type {unknown[]} values from which the buttons were last drawn */
let acts = [];

/** Draw tasks, moves and poses with their buttons, if anything of them has changed. */
function drawActs() {
  const { active, goalId, positions } = shown.live;
  const goal = active ? goalId : (status?.goal?.goal_id ?? null);
  const now = [status, runs.tasks, runs.goals, isSignedIn(), goal, positions];
  if (!connection.hasArm || now.every((each, index) => each === acts[index])) return;
  acts = now;
  const idle = status !== null && goal === null;
  tasks.draw(runs.tasks, runs.goals, status, idle);
  move.draw(status, goal, positions, runs.goals);
  poses.draw(status, idle);
}

connection.addEventListener("begin", async () => {
  questions.clear();
  runs.hasArm = connection.hasArm;
  document.body.classList.toggle("no-arm", !connection.hasArm);
  byId("stop", HTMLElement).hidden = !connection.hasArm;
  showRobot()
    .catch((error) => setText(byId("no-3d", HTMLElement), `The robot is not shown: ${error.message}`))
    .then(drawShownRobot);
  shown.recorded?.seek(cursor.time); // loads a window that failed to load before
  empty ||= !shown.live.goalId && !shown.recorded;
  await runs.refresh();
  await catchUp();
  draw();
});
connection.addEventListener("event", (event) => {
  const { detail } = /** @type {CustomEvent} */ (event);
  if (detail.event === "question") questions.update(detail);
  shown.update(detail);
  // A goal's recording exists when the event of the goal arrives.
  if (detail.event === "status" || detail.event === "goal") runs.refresh();
  if (detail.event === "status" && detail.result) connection.refresh(); // updates the buttons
});
connection.addEventListener("status", (event) => {
  status = /** @type {CustomEvent} */ (event).detail;
  if (status) shown.live.updateStatus(status);
  cursor.extend(shown.length);
  draw();
});
connection.addEventListener("change", draw);
shown.addEventListener("change", () => cursor.extend(shown.length));
shown.addEventListener("open", () => {
  empty = false;
  cursor.follow();
  drawShownRobot();
});
shown.addEventListener("change", draw);
shown.addEventListener("error", (event) => player.say(/** @type {CustomEvent} */ (event).detail));
cursor.addEventListener("change", () => {
  const { time, live } = cursor;
  if (shown.isLive && !live) {
    shown.rewind(); // moves the cursor to the end
    return cursor.seek(time);
  }
  shown.recorded?.seek(cursor.time);
  comparison.seek(cursor.time);
});
cursor.addEventListener("change", drawPlayer);
cursor.addEventListener("change", draw);
session.addEventListener("change", () => connection.refresh().then(draw));
session.addEventListener("goal", () => {
  shown.follow(); // shows the run that this tab started
  connection.refresh();
});
tree.addEventListener("select", draw);
tree.addEventListener("open", () => {
  drawAll();
  reveal(byId("node", HTMLElement));
});
tree.addEventListener("break", (event) => {
  const path = /** @type {CustomEvent} */ (event).detail;
  controls.setBreakpoint(path, !status?.breakpoints.includes(path));
});
byId("activate", HTMLElement).addEventListener("click", () => controls.activate());
tasks.addEventListener("preview", (event) => shown.preview(/** @type {CustomEvent} */ (event).detail));
runs.addEventListener("open", async (event) => {
  await open(/** @type {CustomEvent} */ (event).detail.name);
  drawAll();
  bringIntoView(byId(shown.run.state === "ABORTED" ? "failure" : "tree-panel", HTMLElement));
});
runs.addEventListener("change", () => {
  if (empty) openAddress();
  draw();
});
player.addEventListener("change", () => runs.refresh());
player.addEventListener("delete", (event) => deleteRecording(/** @type {CustomEvent} */ (event).detail));
comparison.addEventListener("change", draw);
comparison.addEventListener("error", (event) => player.say(/** @type {CustomEvent} */ (event).detail));
byId("skip", HTMLElement).addEventListener("click", ({ target }) => {
  const to = target instanceof HTMLElement && target.dataset.to;
  if (to) byId(to, HTMLElement).focus();
});
document.addEventListener("click", (event) => {
  const link = event.target instanceof Element ? event.target.closest(".link") : null;
  if (!(link instanceof HTMLElement) || !link.dataset.path) return;
  if (link.closest("#running") && shown.live.active && !shown.isLive) {
    shown.follow();
    tree.draw();
  }
  tree.reveal(link.dataset.path);
});
setInterval(draw, 1000); // updates the time since the last answer

/** Show how the live goal ended, if it ended while there was no connection, or with its server. */
async function catchUp() {
  const { live } = shown;
  const goal = runs.goals.find((each) => each.goal_id === live.goalId);
  if (live.complete || !goal?.result) return;
  live.end(goal);
  const recording = runs.recordings.find((each) => each.name === runs.recordingOf(live));
  if (!shown.isLive || !recording) return;
  if (isFinished(recording)) await open(recording.name, undefined, false);
  else runs.addEventListener("change", catchUp, { once: true });
}

async function showRobot() {
  if (!connection.hasArm) return; // each recording has its own robot
  const robot = await getAtLast("api/robot");
  setText(byId("robot", HTMLElement), robot.name);
  document.title = `${robot.name}, armtree`;
  setText(byId("opening", HTMLElement), `Activating opens the port; the arm then ${robot.opening}.`);
  live = robot;
  Promise.allSettled([move.show(), poses.show(Object.keys(robot.groups))]).then(() => {
    acts = [];
    draw();
  });
}

/**
 * Draw another robot, unless it is the same.
 * @param {import("./arm/model.js").Robot} robot
 */
function drawRobot(robot) {
  isLiveRobot = JSON.stringify(robot) === JSON.stringify(live);
  arm.show(robot, draw);
  plots.show(robot.joints, draw);
  for (const joint of robot.joints) comparison.units.set(joint.name, joint.unit);
}

/** Draw the robot of the run that is shown. */
async function drawShownRobot() {
  const { recorded } = shown;
  if (!recorded?.name) return live ? drawRobot(live) : undefined;
  const robot = await recorded.robot.catch(() => live); // a recording may lack its robot
  if (robot && shown.recorded === recorded) drawRobot(robot);
  if (robot && !connection.hasArm) setText(byId("robot", HTMLElement), robot.name);
}

/**
 * Show a recording.
 * @param {string} name
 * @param {number} [time] the moment [s]
 * @param {boolean} [held] False to show the next goal when it begins
 */
async function open(name, time, held) {
  if (name === runs.recordingOf(shown.live) && shown.live.active) return shown.follow();
  const error = byId("control-error", HTMLElement);
  setText(error, "");
  await shown.open(name, time, held).catch((reason) => setText(error, reason.message));
  if (time !== undefined) cursor.seek(time);
}

/** Show the moment in the address, such as `#recording=NAME&t=3.2`, or else the newest run. */
async function openAddress() {
  const words = new URLSearchParams(location.hash.slice(1));
  const newest = runs.recordings.find((each) => isFinished(each) || runs.isFinishing(each));
  const finished = newest && isFinished(newest) && newest.name; // else the next list may have it finished
  const name = words.get("recording") ?? finished;
  const time = words.has("t") ? Math.max(0, Number(words.get("t"))) || 0 : undefined;
  if (!name) return;
  empty = false;
  await open(name, time, location.hash !== "");
}

/**
 * Scroll to a part of the page if its beginning is not visible.
 * @param {HTMLElement} part
 */
function bringIntoView(part) {
  const { top } = part.getBoundingClientRect();
  const { bottom } = byId("header", HTMLElement).getBoundingClientRect();
  if (top < bottom || top > byId("player", HTMLElement).getBoundingClientRect().top) part.scrollIntoView();
}

/** @param {string} name */
async function deleteRecording(name) {
  const recording = runs.recordings.find((each) => each.name === name);
  if (!recording) return;
  try {
    await runs.delete(recording);
    if (location.hash.includes(name)) history.replaceState(null, "", location.pathname);
    shown.follow();
  } catch (error) {
    player.say(error);
  }
}

function trySignIn() {
  signIn().catch((error) => setText(byId("sign-in-error", HTMLElement), error.message));
}

ignoreUnusable();
connection.start();
trySignIn();
// A command in a terminal may have made a recording meanwhile.
window.addEventListener("focus", () => {
  if (connection.alive) runs.refresh();
});
window.addEventListener("hashchange", () => {
  trySignIn(); // a new link, opened in this tab
  if (location.hash) openAddress();
});
draw();
