/** The arm in 3D: commanded pose, planned path, bodies, and the links of a refused plan. */

import { addBodies, pathOf } from "../arm/motion.js";
import { ArmModel } from "../arm/model.js";
import { Stage } from "../arm/stage.js";
import { byId, element, setText } from "../dom.js";

/** @typedef {import("../arm/model.js").Robot} Robot */
/** @typedef {import("../model/run.js").Run} Run */

/** Shows one robot. */
export class ArmView {
  #box = byId("arm", HTMLElement);
  #positions = byId("positions", HTMLElement);
  /** @type {Robot | null} */
  #robot = null;
  /** @type {import("../arm/model.js").Libraries | null} */
  #three = null;
  /** @type {Stage | null} */
  #stage = null;
  /** @type {ArmModel | null} */
  #model = null;
  /** @type {ArmModel | null} the arm where a refused plan ends */
  #ghost = null;
  /** @type {import("three").Object3D[]} */
  #drawn = [];
  /** @type {unknown[]} what was drawn last */
  #last = [];

  constructor() {
    for (const button of document.querySelectorAll("#views button"))
      button.addEventListener("click", () => this.#stage?.look(button.id.replace("view-", "")));
    // The floor and the path have colours of the page.
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
      this.#stage?.setColors();
      this.#last = [];
    });
  }

  /**
   * Show a robot; the libraries are loaded first.
   * @param {Robot} robot
   * @param {() => void} changed called when there is something to draw
   */
  async show(robot, changed) {
    if (this.#robot) return;
    this.#robot = robot;
    // @ts-ignore: the bundle has the types of libraries.js
    const three = /** @type {import("../arm/model.js").Libraries} */ (await import("../libraries.js"));
    try {
      this.#stage = new Stage(three, this.#box, sizeOf(robot));
    } catch {
      setText(byId("no-3d", HTMLElement), "This browser shows no 3D, because WebGL is off.");
      return;
    }
    this.#three = three;
    this.#model = new ArmModel(three, robot, () => this.#stage?.draw());
    this.#stage.scene.add(this.#model.root);
    changed();
  }

  /**
   * @param {Run} run
   * @param {Record<string, number> | null} commanded position by joint [rad or m]
   */
  draw(run, commanded) {
    const pose = run.positions ?? commanded;
    this.#drawPositions(pose);
    const now = [JSON.stringify(pose), run.schedule, run.world, run.outcome];
    if (!this.#model || !this.#stage || !this.#three) return;
    if (now.every((each, index) => each === this.#last[index])) return;
    if (now.slice(1).some((each, index) => each !== this.#last[index + 1])) this.#drawMotion(run);
    this.#last = now;
    this.#model.setPose(pose ?? {});
    this.#stage.draw();
  }

  /** @param {Run} run */
  #drawMotion(run) {
    if (!this.#model || !this.#stage || !this.#three) return;
    for (const object of this.#drawn) object.removeFromParent();
    this.#drawn = addBodies(this.#three, this.#model, run.world);
    if (run.schedule) {
      const color = getComputedStyle(this.#box).getPropertyValue("outline-color");
      const path = pathOf(this.#three, this.#model, run.schedule, color);
      this.#stage.scene.add(path);
      this.#drawn.push(path);
    }
    this.#drawRefusal(run);
  }

  /** Show where a refused plan would end, with the links of the message in red. @param {Run} run */
  #drawRefusal({ outcome, refused }) {
    if (!this.#model || !this.#stage || !this.#three || !this.#robot) return;
    const cause = outcome?.cause;
    const words = new Set(cause?.code.startsWith("plan.") ? cause.message.split(/[^\w.-]+/) : []);
    const links = this.#robot.links.filter((link) => words.has(link));
    const atGoal = cause?.code === "plan.goal_in_collision" && refused !== null;
    setText(byId("ghost-note", HTMLElement), atGoal ? ", and the refused goal" : "");
    if (atGoal) {
      this.#ghost ??= new ArmModel(this.#three, this.#robot, () => this.#stage?.draw(), 0.7);
      this.#ghost.setPose(refused);
      this.#ghost.mark(new Set(links));
      this.#stage.scene.add(this.#ghost.root);
    } else this.#ghost?.root.removeFromParent();
    this.#model.mark(new Set(atGoal ? [] : links));
  }

  /** @param {Record<string, number> | null} pose */
  #drawPositions(pose) {
    const joints = this.#robot?.joints.filter((each) => each.type !== "fixed" && !each.mimic) ?? [];
    const key = joints.map((joint) => valueOf(joint, pose)).join(" ");
    if (this.#positions.dataset.key === key) return;
    this.#positions.dataset.key = key;
    this.#positions.replaceChildren(
      ...joints.map((joint) =>
        element("div", {}, element("dt", {}, joint.name), element("dd", {}, valueOf(joint, pose))),
      ),
    );
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
 * Return about how large a robot is [m].
 * @param {Robot} robot
 */
function sizeOf(robot) {
  const reach = robot.joints.reduce((sum, joint) => sum + Math.hypot(...joint.xyz), 0);
  return Math.max(reach, 0.05);
}
