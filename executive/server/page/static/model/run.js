/** The state of a run, computed from events. It is independent of the page's elements. */

/** @typedef {import("../api.js").Cause} Cause */

/**
 * @typedef {object} Outcome How a goal ended.
 * @property {string} state SUCCEEDED, CANCELED or ABORTED
 * @property {string} message
 * @property {number} duration_s
 * @property {number} frames
 * @property {string} recording
 * @property {Cause | null} cause
 */

/**
 * @typedef {object} Goal
 * @property {string} goal_id
 * @property {number} task
 * @property {string} state
 * @property {number} stamp_ns
 * @property {Outcome | null} result
 */

/**
 * @typedef {object} TreeNode
 * @property {string} path
 * @property {string} name
 * @property {number} level from 1
 * @property {TreeNode | null} parent
 * @property {TreeNode[]} children
 * @property {string} status RUNNING, SUCCESS, FAILURE, INVALID, or HALTED for INVALID after RUNNING
 * @property {string} message
 * @property {number | null} began time of the last start [s]
 * @property {number | null} ended time of the last end [s]
 * @property {number} starts number of its starts
 * @property {Record<string, string>} inputs values that it has read from keys and parameters, by port
 */

/**
 * @typedef {object} Schedule The frames of a motion.
 * @property {Record<string, number>} start position by joint [rad or m]
 * @property {number[]} times due time of each frame, from the start of the motion [s]
 * @property {string[]} frames
 * @property {number[]} sample_times [s]
 * @property {number[][]} samples positions of the joints of `start`
 */

/**
 * @typedef {object} Body Around the arm, or in its gripper.
 * @property {string} name
 * @property {string} link empty for the root
 * @property {[number, number, number]} position [m]
 * @property {[number, number, number, number]} rotation x, y, z, w
 * @property {{ size: number[] }} [box]
 * @property {{ radius: number }} [sphere]
 * @property {{ radius: number, length: number }} [cylinder]
 * @property {{ path: string, scale: number[] }} [mesh]
 */

const MOVE = -1; // task number of a move
const LONGEST = 4000; // largest number of characters of a message

const UNKNOWN = {
  status: "INVALID",
  message: "",
  began: /** @type {number | null} */ (null),
  ended: /** @type {number | null} */ (null),
  starts: 0,
  inputs: /** @type {Record<string, string>} */ ({}),
};

/** One run, or none yet. */
export class Run {
  goalId = "";
  title = "";
  task = 0;
  /** State of the goal; empty if there is none. */
  state = "";
  /** @type {number | null} */
  percentage = null;
  phase = "";
  attempt = 1;
  /** @type {Record<string, number> | null} last commanded position by joint [rad or m] */
  positions = null;
  /** @type {Record<string, number> | null} last measured position by joint [rad or m] */
  measured = null;
  /** @type {Schedule | null} the newest motion */
  schedule = null;
  /** @type {Body[]} of the newest plan */
  world = [];
  /** @type {Map<string, any>} newest plan by group, in the order of time */
  plans = new Map();
  /** Time at which the goal began [s]. */
  began = 0;
  /** Time from the beginning of the goal to the newest event [s]. */
  length = 0;
  /** @type {Outcome | null} */
  outcome = null;
  /** True when the event of its end has arrived. */
  complete = false;
  /** @type {Map<string, TreeNode>} by path, parents first */
  nodes = new Map();
  /** @type {Set<TreeNode>} nodes that have changed since they were drawn */
  changed = new Set();

  /**
   * Update the state with an event.
   * @param {any} event as the server sends it
   * @returns {boolean} True if another goal began
   */
  update(event) {
    if (event.event === "goal") {
      if (event.goal_id === this.goalId) return false;
      this.#begin(event);
      return true;
    }
    switch (event.event) {
      case "node":
        this.#updateNode(event);
        break;
      case "feedback":
        this.percentage = event.percentage;
        this.phase = event.phase;
        this.attempt = event.attempt;
        break;
      case "sent":
        if (event.joints.length) this.positions = zip(event.joints, whereItLeads(event, this.schedule));
        break;
      case "measured":
        this.measured = zip(event.joints, event.position);
        break;
      case "plan":
        this.world = event.world;
        this.positions ??= event.start;
        this.plans.delete(event.group);
        this.plans.set(event.group, event);
        break;
      case "schedule":
        this.schedule = event;
        break;
      case "status":
        if (event.result && event.goal_id === this.goalId) this.end(event);
        else this.updateGoal(event);
        this.complete ||= event.goal_id === this.goalId && event.result !== null;
        break;
    }
    if (this.active && "time_s" in event) this.length = Math.max(this.length, event.time_s - this.began);
    return false;
  }

  /**
   * Update the state of the goal, and the state of the arm if no event of a goal has set it.
   * @param {import("../connection.js").Status} status
   */
  updateStatus({ commanded, measured, goal, time_s }) {
    if (goal) this.updateGoal(goal);
    if (this.active) this.length = Math.max(this.length, time_s - this.began); // also while nothing happens
    const idle = !goal && !this.active; // nothing moves, so no event is newer
    if (idle || !this.positions) this.positions = commanded;
    if (idle || !this.measured) this.measured = measured;
  }

  /**
   * Update the state of the goal. Ignore other goals, and all states after the end: a status from
   * before the end may arrive later.
   * @param {Goal} goal
   */
  updateGoal(goal) {
    if (goal.goal_id !== this.goalId || this.outcome) return;
    this.state = goal.state;
    this.outcome = goal.result;
    if (goal.result) this.phase = "";
  }

  /**
   * End the goal without its last events. Mark its running nodes as stopped.
   * @param {Goal} goal
   */
  end(goal) {
    this.updateGoal(goal);
    for (const node of this.nodes.values())
      if (node.status === "RUNNING") this.#change(node, { ...node, status: "HALTED" });
    this.#markRefused();
  }

  /**
   * Add the nodes of the task, if the goal was refused before its tree had any nodes.
   * @param {Iterable<{ path: string }>} nodes parents first
   */
  addNodes(nodes) {
    if (this.nodes.size || !this.outcome) return;
    for (const { path } of nodes) this.#newNode({ path, name: path.slice(path.lastIndexOf("/") + 1) });
    this.#markRefused();
  }

  /** Mark the node that was refused before the run as failed, and all nodes above it. */
  #markRefused() {
    const { node: path = "", message = "" } = this.outcome?.cause ?? {};
    const refused = this.nodes.get(path);
    if (!refused || [...this.nodes.values()].some(({ starts }) => starts)) return;
    for (let node = /** @type {TreeNode | null} */ (refused); node; node = node.parent)
      this.#change(node, { ...UNKNOWN, status: "FAILURE", message: node === refused ? cut(message) : "" });
  }

  /** @returns {TreeNode[]} the running leaves */
  get running() {
    return [...this.nodes.values()].filter(
      (node) => node.status === "RUNNING" && !node.children.some((child) => child.status === "RUNNING"),
    );
  }

  /** @returns {Record<string, number> | null} goal of the newest plans that were refused; null for none */
  get refused() {
    const plans = [...this.plans.values()].filter((plan) => plan.code);
    const starts = plans.map((plan) => plan.start);
    return plans.length ? Object.assign({}, ...starts, ...plans.map((plan) => zip(plan.joints, plan.goal))) : null;
  }

  /** @returns {boolean} True while the goal is under way */
  get active() {
    return this.goalId !== "" && this.outcome === null;
  }

  /**
   * Copy the state of another run of the same goal. Nodes stay the same objects.
   * @param {Run} other
   */
  become(other) {
    const { nodes, changed } = this;
    Object.assign(this, other, { nodes, changed });
    for (const node of nodes.values())
      if (!other.nodes.has(node.path)) this.#change(node, { ...UNKNOWN });
    for (const { path, name, status, message, began, ended, starts, inputs } of other.nodes.values())
      this.#change(nodes.get(path) ?? this.#newNode({ path, name }), { status, message, began, ended, starts, inputs });
    this.#markRefused();
  }

  /**
   * @param {TreeNode} node
   * @param {typeof UNKNOWN} state
   */
  #change(node, state) {
    if (Object.entries(state).every(([key, value]) => node[/** @type {"status"} */ (key)] === value)) return;
    Object.assign(node, state);
    this.changed.add(node);
  }

  /** @param {any} event */
  #begin(event) {
    Object.assign(this, new Run(), { positions: this.positions, measured: this.measured });
    this.goalId = event.goal_id;
    this.task = event.task;
    this.title = goalTitle(event.task, event.name);
    this.state = "EXECUTING";
    this.began = event.time_s;
    if (Object.keys(event.start).length) this.positions = event.start;
  }

  /** @param {any} event */
  #updateNode(event) {
    const node = this.nodes.get(event.path) ?? this.#newNode(event);
    if ("starts" in event) return this.#change(node, stateOf(event));
    const before = node.status;
    // A new stream repeats the current state.
    const known = event.time_s === (event.status === "RUNNING" ? node.began : node.ended);
    node.message = cut(event.message);
    node.inputs = event.inputs;
    node.status = event.status === "INVALID" && before === "RUNNING" ? "HALTED" : event.status;
    if (known) return void this.changed.add(node);
    if (event.status === "RUNNING") {
      node.began = event.time_s;
      node.ended = null;
      node.starts += 1;
    } else if (event.status !== "INVALID" || before === "RUNNING") {
      if (before !== "RUNNING") {
        node.began = event.time_s; // it started and ended within one tick
        node.starts += 1;
      }
      node.ended = event.time_s;
    }
    this.changed.add(node);
  }

  /**
   * @param {any} event
   * @returns {TreeNode}
   */
  #newNode(event) {
    const above = event.path.slice(0, Math.max(0, event.path.lastIndexOf("/")));
    const parent = this.nodes.get(above) ?? null;
    /** @type {TreeNode} */
    const node = {
      path: event.path,
      name: event.name,
      level: (parent?.level ?? 0) + 1,
      parent,
      children: [],
      ...UNKNOWN,
    };
    parent?.children.push(node);
    this.nodes.set(node.path, node);
    return node;
  }
}

/**
 * Return the title of a goal, for people.
 * @param {number} task
 * @param {string} [name]
 */
export function goalTitle(task, name = "") {
  return task === MOVE ? name || "move" : `task ${task} ${name}`.trimEnd();
}

/**
 * Return the target of a frame. The target of the last frame is the end of its motion, because its
 * positions may be only near to that.
 * @param {any} sent event of the frame
 * @param {Schedule | null} schedule newest motion
 * @returns {number[]} positions of its joints [rad or m]
 */
export function whereItLeads({ data, scheduled_s, positions }, schedule) {
  const isLast = scheduled_s !== null && data === schedule?.frames.at(-1);
  return (isLast && schedule?.samples.at(-1)) || positions;
}

/**
 * Return the state of a node from an event that contains all of it.
 * @param {any} event
 */
function stateOf({ status, message, began_s, ended_s, starts, inputs }) {
  return { status, message: cut(message), began: began_s, ended: ended_s, starts, inputs };
}

/** @param {string} message */
function cut(message) {
  return message.length > LONGEST ? `${message.slice(0, LONGEST)} …` : message;
}

/**
 * @param {string[]} names
 * @param {number[]} values
 * @returns {Record<string, number>}
 */
function zip(names, values) {
  return Object.fromEntries(names.map((name, index) => [name, values[index]]));
}
