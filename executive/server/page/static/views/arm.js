/** The arm in 3D: commanded and measured pose, planned path, bodies, and the links of a refused plan. */

import { addBodies, pathOf } from "../arm/motion.js";
import { ArmModel } from "../arm/model.js";
import { Stage } from "../arm/stage.js";
import { byId, element, isNew, setText } from "../dom.js";
import { loadLibraries } from "../libraries/load.js";

/** @typedef {import("../arm/model.js").Robot} Robot */
/** @typedef {import("../model/run.js").Run} Run */
/** @typedef {import("../model/run.js").Schedule} Schedule */
/** @typedef {import("../model/shown_run.js").ShownRun} ShownRun */

const GHOST = 0.35; // opacity of the measured arm
const TURN = Math.PI / 18; // turn of the camera by one key [rad]
const NEARER = 0.85; // distance of the camera after the key +, divided by the distance before
/** Effect of each key: turn of the camera to the left, turn up, and approach. */
const KEYS = /** @type {Record<string, [number, number, number]>} */ ({
  ArrowLeft: [1, 0, 0],
  ArrowRight: [-1, 0, 0],
  ArrowUp: [0, 1, 0],
  ArrowDown: [0, -1, 0],
  "+": [0, 0, 1],
  "-": [0, 0, -1],
});

/** Shows one robot. */
export class ArmView {
  #box = byId("arm", HTMLElement);
  #positions = byId("positions", HTMLElement);
  /** @type {Robot | null} */
  #robot = null;
  /** The robot on the stage, as JSON. */
  #staged = "";
  /** @type {import("../libraries/load.js").Libraries | null} */
  #three = null;
  /** @type {Stage | null} */
  #stage = null;
  /** @type {ArmModel | null} */
  #model = null;
  /** @type {ArmModel | null} the arm at the end of a refused plan */
  #refused = null;
  /** @type {ArmModel | null} the arm in its measured pose */
  #measured = null;
  /** @type {ArmModel | null} the arm of the compared run */
  #other = null;
  /** @type {import("three").Object3D[]} */
  #drawn = [];
  /** @type {unknown[]} values that were drawn last */
  #last = [];

  constructor() {
    for (const button of document.querySelectorAll("#views button"))
      button.addEventListener("click", () => this.#stage?.look(button.id.replace("view-", "")));
    this.#box.addEventListener("keydown", (event) => this.#key(event));
    // The floor and the path use colours of the page.
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.#stage?.setColors();
      this.#last = [];
    });
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const [left, up, nearer] = KEYS[event.key] ?? [0, 0, 0];
    if (!left && !up && !nearer) return;
    event.preventDefault();
    this.#stage?.turn(left * TURN, up * TURN, NEARER ** nearer);
  }

  /** @returns {number} shortest time between two pictures [ms]; 0 with a graphics card */
  get period() {
    return this.#stage?.period ?? 0;
  }

  /**
   * Show a robot; the libraries are loaded first.
   * @param {Robot} robot
   * @param {() => void} changed called when there is something to draw
   */
  async show(robot, changed) {
    this.#robot = robot;
    this.#three = await loadLibraries();
    const json = JSON.stringify(robot);
    if (!this.#three || this.#robot !== robot || json === this.#staged) return;
    this.#staged = json;
    if (!this.#stage) this.#begin(this.#three, sizeOf(robot));
    this.#replace();
    changed();
  }

  /**
   * Make the stage.
   * @param {import("../libraries/load.js").Libraries} three
   * @param {number} size of the robot [m]
   */
  #begin(three, size) {
    try {
      this.#stage = new Stage(three, this.#box, size);
    } catch {
      setText(byId("no-3d", HTMLElement), "This browser cannot show 3D, because WebGL is off.");
    }
  }

  /** Put the robot on the stage, in place of an earlier one. */
  #replace() {
    if (!this.#stage || !this.#three || !this.#robot) return;
    const before = [this.#model, this.#measured, this.#refused, this.#other];
    for (const model of before) model?.root.removeFromParent();
    this.#stage.forget();
    this.#measured = this.#refused = this.#other = null;
    this.#last = [];
    const model = new ArmModel(this.#three, this.#robot, () => {
      this.#stage?.include(model.root);
      this.#stage?.draw();
    });
    this.#model = model;
    this.#stage.scene.add(model.root);
  }

  /**
   * @param {ShownRun} shown
   * @param {Run} posed run with the pose to show
   */
  draw({ run, motions, planned }, { positions: pose, measured: there }) {
    const kind = planned ? "Planned" : "Commanded";
    setText(byId("pose-note", HTMLElement), pose ? `${kind} pose` : `${kind} pose unknown`);
    this.#drawPositions(pose, there);
    const now = [JSON.stringify([pose, there]), run.schedule, run.world, run.outcome];
    if (!this.#model || !this.#stage || !this.#three) return;
    if (now.every((each, index) => each === this.#last[index])) return;
    if (now.slice(1).some((each, index) => each !== this.#last[index + 1])) this.#drawMotions(run, motions);
    this.#last = now;
    if (pose) this.#model.setPose(pose);
    this.#stage.include(this.#model.root);
    this.#drawMeasured(there);
    this.#stage.draw();
  }

  /**
   * Show the arm of another run, transparent.
   * @param {Run | null} run null for none
   */
  drawOther(run) {
    setText(byId("other-note", HTMLElement), run?.positions ? ", and the other run as a ghost" : "");
    if (!this.#stage || !this.#three || !this.#robot) return;
    if (!run?.positions) {
      if (this.#other?.root.parent) this.#stage.draw();
      return void this.#other?.root.removeFromParent();
    }
    this.#other ??= new ArmModel(this.#three, this.#robot, () => this.#stage?.draw(), 0.4);
    this.#other.setPose(run.positions);
    this.#stage.scene.add(this.#other.root);
    this.#stage.draw();
  }

  /**
   * @param {Run} run
   * @param {Schedule[]} motions
   */
  #drawMotions(run, motions) {
    if (!this.#model || !this.#stage || !this.#three) return;
    for (const object of this.#drawn) object.removeFromParent();
    this.#drawn = addBodies(this.#three, this.#model, run.world, () => this.#stage?.draw());
    const color = getComputedStyle(this.#box).getPropertyValue("outline-color");
    for (const motion of motions) {
      const path = pathOf(this.#three, this.#model, motion, color);
      this.#stage.scene.add(path);
      this.#stage.include(this.#model.root, path); // the arm is at the end of the path
      this.#drawn.push(path);
    }
    this.#drawRefusal(run);
  }

  /** @param {Record<string, number> | null} pose */
  #drawMeasured(pose) {
    if (!pose || !this.#stage || !this.#three || !this.#robot) return void this.#measured?.root.removeFromParent();
    this.#measured ??= new ArmModel(this.#three, this.#robot, () => this.#stage?.draw(), GHOST);
    this.#measured.setPose(pose);
    this.#stage.scene.add(this.#measured.root);
  }

  /** Show the goal of a refused plan, with the links of the message in red. @param {Run} run */
  #drawRefusal({ outcome, refused }) {
    if (!this.#model || !this.#stage || !this.#three || !this.#robot) return;
    const cause = outcome?.cause;
    const words = new Set(cause?.code.startsWith("plan.") ? cause.message.split(/[^\w.-]+/) : []);
    const links = this.#robot.links.filter((link) => words.has(link));
    const atGoal = cause?.code === "plan.goal_in_collision" && refused !== null;
    setText(byId("refused-note", HTMLElement), atGoal ? ", and the refused goal" : "");
    if (atGoal) {
      this.#refused ??= new ArmModel(this.#three, this.#robot, () => this.#stage?.draw(), 0.7);
      this.#refused.setPose(refused);
      this.#refused.mark(new Set(links));
      this.#stage.scene.add(this.#refused.root);
      this.#stage.include(this.#refused.root);
    } else this.#refused?.root.removeFromParent();
    this.#model.mark(new Set(atGoal ? [] : links));
  }

  /**
   * @param {Record<string, number> | null} pose
   * @param {Record<string, number> | null} measured
   */
  #drawPositions(pose, measured) {
    const joints = this.#robot?.joints.filter((each) => each.type !== "fixed" && !each.mimic) ?? [];
    const key = `${joints.map(({ name }) => name).join(" ")}, ${measured ? "measured" : ""}`;
    if (isNew(this.#positions, key)) {
      setText(byId("measured-note", HTMLElement), measured ? ", and the measured one as a ghost and in grey" : "");
      const also = () => (measured ? [element("dd", { class: "quiet", title: "measured" })] : []);
      const rows = joints.map(({ name }) => element("div", {}, element("dt", {}, name), element("dd"), ...also()));
      this.#positions.replaceChildren(...rows);
    }
    for (const [index, joint] of joints.entries()) {
      const [, value, there] = this.#positions.children[index].children;
      setText(value, valueOf(joint, pose));
      if (there) setText(there, valueOf(joint, measured));
    }
  }
}

/**
 * Return the position of a joint for people.
 * @param {import("../arm/model.js").Joint} joint
 * @param {Record<string, number> | null} pose
 */
function valueOf(joint, pose) {
  const value = pose?.[joint.name];
  if (value === undefined) return "unknown";
  return joint.unit === "m" ? `${(value * 1000).toFixed(1)} mm` : `${((value * 180) / Math.PI).toFixed(1)}°`;
}

/**
 * Return the approximate size of a robot [m].
 * @param {Robot} robot
 */
function sizeOf(robot) {
  const reach = robot.joints.reduce((sum, joint) => sum + Math.hypot(...joint.xyz), 0);
  return Math.max(reach, 0.05);
}
