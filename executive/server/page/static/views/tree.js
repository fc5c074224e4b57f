/** The tree of a run as an outline, with folding, search, scrolling to the running node, and keys. */

import { byId, element, setAttribute, setText } from "../dom.js";

/** @typedef {import("../model/run.js").TreeNode} TreeNode */
/** @typedef {import("../model/shown_run.js").ShownRun} ShownRun */

const OPEN_UP_TO = 60; // largest number of nodes of a tree that is shown unfolded
const ZOOM = 1.2; // factor from one size to the next
const SIZES = 3; // number of sizes below and above the first one
const MARKS = /** @type {Record<string, [string, string]>} */ ({
  RUNNING: ["▶", "running"],
  SUCCESS: ["✓", "done"],
  FAILURE: ["✕", "failed"],
  HALTED: ["■", "stopped"],
  INVALID: ["·", "to come"],
});

/** @param {string} status @returns {[string, string]} a sign, and the status in words */
export function mark(status) {
  return MARKS[status] ?? ["?", status.toLowerCase()];
}

/** Events: `select` with the path of the selected node, `open` when it was clicked, `break` with the path of a breakpoint to set or clear. */
export class TreeView extends EventTarget {
  #shown;
  #list = byId("tree", HTMLElement);
  #search = byId("search", HTMLInputElement);
  #follow = byId("follow", HTMLInputElement);
  /** @type {Map<string, HTMLElement>} */
  #rows = new Map();
  /** @type {Map<string, boolean>} nodes that were unfolded (true) or folded (false), by path */
  #opened = new Map();
  /** @type {TreeNode[]} nodes with a row, in the order of the rows */
  #visible = [];
  #folds = 0; // number of changes of `#opened`
  /** @type {unknown[]} values that were drawn last, besides the nodes */
  #last = [];
  #breakpoints = "";
  #goal = "";
  #followed = "";
  #lost = ""; // path of the row that had the focus, while the tree has no rows
  #time = 0; // the shown moment [s]
  #size = 0; // number of steps from the first size
  selected = "";

  /** @param {ShownRun} shown */
  constructor(shown) {
    super();
    this.#shown = shown;
    this.#search.addEventListener("input", () => this.draw());
    this.#list.addEventListener("click", (event) => this.#click(event));
    this.#list.addEventListener("keydown", (event) => this.#key(event));
    byId("tree-larger", HTMLElement).addEventListener("click", () => this.#zoom(1));
    byId("tree-smaller", HTMLElement).addEventListener("click", () => this.#zoom(-1));
    new ResizeObserver(() => {
      this.#followed = ""; // the running row may be hidden now
      this.scroll();
    }).observe(this.#list);
  }

  /**
   * Select a node, and unfold all nodes above it.
   * @param {string} path
   */
  reveal(path) {
    let node = this.#shown.run.nodes.get(path) ?? null;
    if (!node) return;
    for (node = node.parent; node; node = node.parent) this.#opened.set(node.path, true);
    this.#folds += 1;
    this.#search.value = "";
    this.#select(path);
  }

  /**
   * @param {string[]} [breakpoints] paths; default: as in the last call
   * @param {number} [time] the shown moment [s]; default: as in the last call
   */
  draw(breakpoints, time = this.#time) {
    const { run, facts } = this.#shown;
    this.#time = time;
    const marked = breakpoints ? breakpoints.join("\n") : this.#breakpoints;
    const now = [run, run.goalId, facts, facts.size, marked, this.#search.value, this.#folds, this.selected];
    const redraw = now.some((each, index) => each !== this.#last[index]);
    if (!redraw && run.changed.size === 0) return this.#drawTimes();
    const focused = this.#focused() ?? (document.activeElement === document.body ? this.#lost : "");
    if (run.goalId !== this.#goal) this.#begin(run.goalId);
    this.#last = now;
    this.#breakpoints = marked;
    const atWork = nodesAtWork(run.nodes.values(), this.#shown.planned);
    const visible = this.#find(atWork);
    if (visible.some((node, index) => node !== this.#visible[index]) || visible.length !== this.#visible.length) {
      this.#visible = visible;
      this.#list.replaceChildren(...visible.map((node) => this.#row(node)));
    }
    if (focused && !this.#list.contains(document.activeElement)) this.#refocus(focused);
    const points = new Set(marked.split("\n"));
    for (const node of visible)
      if (redraw || run.changed.has(node) || !this.#row(node).dataset.status)
        this.#drawRow(node, points);
    for (const node of visible) {
      const row = this.#row(node);
      row.classList.toggle("at-work", atWork.has(node));
      if (node.children.length) setAttribute(row, "aria-expanded", this.#expanded(node, atWork));
    }
    this.#drawTimes();
    run.changed.clear();
    this.#keepOneTabStop();
  }

  /** @returns {string | undefined} path of the row that has the focus */
  #focused() {
    const focused = document.activeElement;
    return focused instanceof HTMLElement && this.#list.contains(focused) ? focused.dataset.path : undefined;
  }

  /**
   * Focus a row, or else the row of its nearest visible ancestor, or else the first row.
   * @param {string} path
   */
  #refocus(path) {
    let node = this.#shown.run.nodes.get(path) ?? null;
    while (node && !this.#row(node).isConnected) node = node.parent;
    node ??= this.#visible[0] ?? null;
    if (node) this.#row(node).focus({ preventScroll: true });
    this.#lost = node ? "" : path;
  }

  /** Scroll to the running node, or to the node that failed. Call this last, because it needs the layout of the page. */
  scroll() {
    const { running, outcome } = this.#shown.run;
    const path = running.at(-1)?.path ?? outcome?.cause?.node ?? "";
    const row = this.#rows.get(path);
    if (!this.#follow.checked || path === this.#followed || !row?.isConnected) return;
    this.#followed = path;
    const { top, height } = this.#list.getBoundingClientRect();
    const offset = row.getBoundingClientRect().top - top;
    if (offset < 0 || offset > height - row.offsetHeight) this.#list.scrollTop += offset - height / 2;
  }

  /** @param {1 | -1} step */
  #zoom(step) {
    this.#size = Math.min(Math.max(this.#size + step, -SIZES), SIZES);
    this.#list.style.setProperty("--zoom", String(ZOOM ** this.#size));
    this.#followed = "";
    this.scroll();
  }

  /** @param {string} goal */
  #begin(goal) {
    this.#goal = goal;
    this.#rows.clear();
    this.#opened.clear();
    this.#visible = [];
    this.#list.replaceChildren();
    this.selected = "";
  }

  /**
   * @param {Set<TreeNode>} atWork
   * @returns {TreeNode[]}
   */
  #find(atWork) {
    const { nodes } = this.#shown.run;
    const wanted = this.#search.value.trim().toLowerCase();
    const matches = wanted ? matching(nodes.values(), wanted) : null;
    /** @type {TreeNode[]} */
    const found = [];
    /** @param {TreeNode} node */
    const add = (node) => {
      if (matches && !matches.has(node)) return;
      found.push(node);
      if (matches || this.#isOpen(node, atWork)) node.children.forEach(add);
    };
    for (const node of nodes.values()) if (!node.parent) add(node);
    return found;
  }

  /**
   * @param {TreeNode} node
   * @param {Set<TreeNode>} atWork
   */
  #isOpen(node, atWork) {
    const small = this.#shown.run.nodes.size <= OPEN_UP_TO;
    return this.#opened.get(node.path) ?? (small || node.level === 1 || atWork.has(node));
  }

  /**
   * @param {TreeNode} node
   * @param {Set<TreeNode>} atWork
   */
  #expanded(node, atWork) {
    return String(this.#search.value.trim() !== "" || this.#isOpen(node, atWork));
  }

  /** @param {TreeNode} node */
  #row(node) {
    const known = this.#rows.get(node.path);
    if (known) return known;
    const row = element(
      "div",
      { role: "treeitem", class: "row", "aria-level": node.level, tabindex: -1 },
      element("span", { class: "point", title: "Breakpoint: b", role: "img", "aria-label": "breakpoint" }),
      element("span", { class: "fold", "aria-hidden": "true" }),
      element("span", { class: "mark" }),
      element("span", { class: "name" }, node.name),
      element("span", { class: "kind" }),
      element("span", { class: "message" }),
      element("span", { class: "time" }),
    );
    row.style.setProperty("--level", String(node.level - 1));
    row.dataset.path = node.path;
    this.#rows.set(node.path, row);
    return row;
  }

  /**
   * @param {TreeNode} node
   * @param {Set<string>} points
   */
  #drawRow(node, points) {
    const row = this.#row(node);
    const [point, , sign, , kind, message, time] = /** @type {HTMLElement[]} */ ([...row.children]);
    const [text, words] = mark(node.status);
    const facts = this.#shown.facts.get(node.path);
    row.dataset.status = node.status;
    setText(point, points.has(node.path) ? "●" : "");
    setAttribute(point, "aria-hidden", points.has(node.path) ? false : "true");
    setText(sign, text);
    setAttribute(sign, "role", "img");
    setAttribute(sign, "aria-label", words);
    setText(kind, facts && facts.kind !== node.name ? facts.kind : "");
    setText(message, node.message);
    setText(time, this.#shown.planned ? "" : duration(node));
    setAttribute(row, "aria-selected", String(node.path === this.selected));
  }

  /** Show the running time of nodes. */
  #drawTimes() {
    const { run, planned } = this.#shown;
    if (planned) return;
    for (const node of this.#visible) {
      if (node.status !== "RUNNING" || node.began === null) continue;
      const seconds = Math.max(0, run.began + this.#time - node.began).toFixed(1);
      const part = run.percentage !== null && node === run.running.at(-1) ? `, ${run.percentage} %` : "";
      setText(/** @type {Element} */ (this.#row(node).lastElementChild), `${times(node)}${seconds} s${part}`);
    }
  }

  /** @param {string} path */
  #select(path) {
    const before = this.#rows.get(this.selected);
    if (before) setAttribute(before, "aria-selected", "false");
    this.selected = path;
    this.draw();
    const row = this.#rows.get(path);
    if (row) {
      setAttribute(row, "aria-selected", "true");
      row.focus({ preventScroll: true });
      row.scrollIntoView({ block: "nearest" });
    }
    this.dispatchEvent(new CustomEvent("select", { detail: path }));
  }

  /** Let Tab reach only one row. Arrows reach the other rows. */
  #keepOneTabStop() {
    const stop = this.#rows.get(this.selected);
    const first = stop?.isConnected ? stop : this.#list.firstElementChild;
    for (const row of this.#list.querySelectorAll("[tabindex='0']")) setAttribute(row, "tabindex", row === first ? 0 : -1);
    if (first) setAttribute(first, "tabindex", 0);
  }

  /** @param {MouseEvent} event */
  #click(event) {
    if (!(event.target instanceof Element)) return;
    const row = event.target.closest(".row");
    if (!(row instanceof HTMLElement) || !row.dataset.path) return;
    const { path } = row.dataset;
    if (event.target.closest(".point")) this.#break(path);
    else if (event.target.closest(".fold")) this.#fold(path, row.getAttribute("aria-expanded") !== "true");
    else this.#open(path);
  }

  /** @param {string} path */
  #open(path) {
    this.#select(path);
    this.dispatchEvent(new Event("open"));
  }

  /** @param {string} path */
  #break(path) {
    this.dispatchEvent(new CustomEvent("break", { detail: path }));
  }

  /** @param {string} path @param {boolean} open */
  #fold(path, open) {
    this.#opened.set(path, open);
    this.#folds += 1;
    this.draw();
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const path = this.#focused();
    const node = path === undefined ? undefined : this.#shown.run.nodes.get(path);
    if (!node || event.ctrlKey || event.metaKey || event.altKey) return;
    const index = this.#visible.indexOf(node);
    const expanded = this.#row(node).getAttribute("aria-expanded");
    /** @type {Record<string, () => void>} */
    const acts = {
      ArrowDown: () => this.#goTo(this.#visible[index + 1]),
      ArrowUp: () => this.#goTo(this.#visible[index - 1]),
      ArrowRight: () => (expanded === "false" ? this.#fold(node.path, true) : this.#goTo(node.children[0])),
      ArrowLeft: () => (expanded === "true" ? this.#fold(node.path, false) : this.#goTo(node.parent)),
      Home: () => this.#goTo(this.#visible[0]),
      End: () => this.#goTo(this.#visible.at(-1)),
      Enter: () => this.#open(node.path),
      b: () => this.#break(node.path),
    };
    const act = acts[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  }

  /** @param {TreeNode | null | undefined} node */
  #goTo(node) {
    if (node) this.#select(node.path);
  }
}

/**
 * Return the nodes that run or were stopped, and each failed node if all nodes above it failed too.
 * @param {Iterable<TreeNode>} nodes parents first
 * @param {boolean} planned True for a dry run, which ends at the first failure
 * @returns {Set<TreeNode>}
 */
function nodesAtWork(nodes, planned) {
  /** @type {Set<TreeNode>} */
  const found = new Set();
  for (const node of nodes) {
    const above = node.parent;
    const failed = node.status === "FAILURE" && (!above || (above.status === "FAILURE" && found.has(above)));
    if (failed || node.status === "RUNNING" || node.status === "HALTED") found.add(node);
    // A dry run has no events of the nodes above.
    if (planned && node.status === "FAILURE") addWithAncestors(node, found);
  }
  return found;
}

/**
 * Return the nodes that contain a text, and all nodes above them.
 * @param {Iterable<TreeNode>} nodes
 * @param {string} wanted in lower case
 */
function matching(nodes, wanted) {
  /** @type {Set<TreeNode>} */
  const found = new Set();
  for (const node of nodes) {
    if (!`${node.name} ${node.message} ${mark(node.status)[1]}`.toLowerCase().includes(wanted)) continue;
    addWithAncestors(node, found);
  }
  return found;
}

/**
 * @param {TreeNode | null} node
 * @param {Set<TreeNode>} found
 */
function addWithAncestors(node, found) {
  for (let each = node; each; each = each.parent) found.add(each);
}

/**
 * Return the duration of a node, and the number of its starts.
 * @param {TreeNode} node
 */
function duration(node) {
  if (node.began === null || node.ended === null) return times(node).trim();
  return `${times(node)}${(node.ended - node.began).toFixed(2)} s`;
}

/** @param {TreeNode} node */
function times({ starts }) {
  return starts > 1 ? `${starts}× ` : "";
}
