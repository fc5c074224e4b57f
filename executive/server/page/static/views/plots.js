/** Plots over time: positions, velocities with their limits, frames and their lateness. */

import { byId, element, setText } from "../dom.js";
import { loadLibraries } from "../libraries/load.js";

/** @typedef {import("../libraries/load.js").Libraries} Libraries */
/** @typedef {import("uplot")} Plot */
/** @typedef {import("uplot").AlignedData} Data */
/** @typedef {import("../arm/model.js").Joint} Joint */
/** @typedef {import("../model/cursor.js").Cursor} Cursor */
/** @typedef {import("../model/history.js").History} History */
/** @typedef {import("../model/history.js").Series} Series */

const PERIOD = 250; // time between two drawings of a running goal [ms]
const GROWTH = 1.25; // factor by which the time axis grows when a run reaches its end
const HEIGHT = 120; // height of a plot [px]
const AXIS = 56; // width of the axis on the left [px]
const COLORS = 8; // number of colours --series-1, --series-2 ... in the style sheet
const MEASURED = [4, 3]; // dashes of lines of measured values [px]
const OTHER = [1, 3]; // dashes of lines of the compared run [px]
const SHORTEST = 0.05; // shortest time range of a plot [s]

/** Shows the plots of one robot's runs. */
export class PlotsView {
  #box = byId("plots", HTMLElement);
  #band = byId("phases", HTMLElement);
  #keys = byId("plot-joints", HTMLElement);
  #cursor;
  /** @type {Libraries | null} */
  #libraries = null;
  /** @type {Joint[]} the drawn joints */
  #joints = [];
  /** @type {Joint[]} the joints of the newest robot */
  #wanted = [];
  /** @type {Set<string>} joints that the user has switched off */
  #off = new Set();
  /** @type {Plot[]} positions, velocities, lateness */
  #plots = [];
  /** @type {History | null} the drawn values */
  #history = null;
  /** @type {History | null} the values of the last call of `draw` */
  #newest = null;
  /** @type {History | null} the values of the compared run */
  #other = null;
  #layout = ""; // kinds of lines that the plots have
  /** @type {[number, number] | null} the time range that the user has chosen [s]; null for all */
  #range = null;
  #grows = false;
  /** False while the plots are outside of the window. They are then not drawn. */
  #visible = false;
  #end = 1; // end of the time axis if no range is chosen [s]
  #drawn = "";
  #second = 0; // length of the run when its phases were drawn, in whole seconds
  #time = -1;
  #last = 0;
  #timer = 0;

  /** @param {Cursor} cursor */
  constructor(cursor) {
    this.#cursor = cursor;
    new IntersectionObserver((seen) => {
      this.#visible = seen.at(-1)?.isIntersecting ?? false;
      this.#drawAgain();
    }).observe(byId("time-panel", HTMLElement));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#build());
    new ResizeObserver(() => this.#resize()).observe(this.#box);
    byId("zoom-in", HTMLElement).addEventListener("click", () => this.#zoom(0.5));
    byId("zoom-out", HTMLElement).addEventListener("click", () => this.#zoom(2));
  }

  /**
   * Show a robot; the libraries are loaded first.
   * @param {Joint[]} joints
   * @param {() => void} changed called when there is something to draw
   */
  async show(joints, changed) {
    const moved = joints.filter((each) => each.type !== "fixed" && !each.mimic);
    this.#wanted = moved;
    this.#libraries = await loadLibraries();
    if (!this.#libraries || this.#wanted !== moved || JSON.stringify(moved) === JSON.stringify(this.#joints)) return;
    this.#joints = moved;
    this.#keys.replaceChildren(...this.#joints.map((joint, index) => this.#key(joint, index)));
    for (const plot of this.#plots) plot.destroy();
    this.#plots = [];
    this.#history = null;
    changed();
  }

  /**
   * @param {History} history of the shown run
   * @param {boolean} grows True while the run continues
   * @param {History | null} other of the compared run; null for none
   */
  draw(history, grows, other) {
    this.#newest = history;
    this.#grows = grows;
    if (other !== this.#other) this.#drawn = ""; // two recordings may have equal version numbers
    this.#other = other;
    if (!this.#libraries || !this.#visible) return;
    this.#drawCursor();
    const changed = history !== this.#history;
    const second = Math.floor(this.#cursor.end);
    if (second !== this.#second && !changed) this.#drawBand(history);
    this.#second = second;
    const now = `${versions(history)} ${other && versions(other)} ${this.#shown()}`;
    if (!changed && now === this.#drawn) return;
    const wait = this.#last + PERIOD - performance.now();
    if (!changed && wait > 0) {
      this.#timer ||= setTimeout(() => {
        this.#timer = 0;
        this.#drawAgain();
      }, wait);
      return;
    }
    clearTimeout(this.#timer);
    this.#timer = 0;
    if (changed) this.#range = null;
    this.#history = history;
    this.#drawn = now;
    const layout = this.#layers().join(" ");
    if (this.#plots.length === 0 || layout !== this.#layout) this.#build();
    else this.#fill();
    this.#last = performance.now();
  }

  #drawAgain() {
    if (this.#newest) this.draw(this.#newest, this.#grows, this.#other);
  }

  /** @returns {number[][]} dashes of each kind of line: commanded, measured, other run */
  #layers() {
    const measures = (this.#history?.measured.times.length ?? 0) > 0;
    return [[], ...(measures ? [MEASURED] : []), ...(this.#other ? [OTHER] : [])];
  }

  /** Make the plots, in the colours of the page. */
  #build() {
    if (!this.#history || !this.#libraries) return;
    for (const plot of this.#plots) plot.destroy();
    const style = getComputedStyle(this.#box);
    const colors = [...this.#keys.querySelectorAll(".swatch")].map((each) => getComputedStyle(each).color);
    /** @param {number[]} dash */
    const lines = (dash) =>
      this.#joints.map((joint, index) => ({
        label: joint.name,
        show: !this.#off.has(joint.name),
        stroke: colors[index],
        width: 1.5,
        dash,
        spanGaps: true,
        points: { show: false },
      }));
    const joints = this.#layers().flatMap(lines);
    this.#layout = this.#layers().join(" ");
    const others = this.#other ? "; dotted: the other run" : "";
    const ink = style.color;
    const dots = { label: "frame", stroke: ink, paths: () => null, points: { show: true, size: 3, fill: ink } };
    this.#plots = [
      this.#plot(`Position [${this.#units("")}]${others}`, joints, { range: (_plot, low, high) => this.#positionRange(low, high) }, style),
      this.#plot(`Velocity [${this.#units("/s")}]${others}`, joints, { range: () => this.#velocityRange() }, style),
      this.#plot("Frames, lateness [ms]", [dots], { range: (_plot, low, high) => [Math.min(low, 0), Math.max(high, 1)] }, style),
    ];
    this.#plots[0].hooks.draw?.push((plot) => drawLimits(plot, this.#limits((joint) => joint.limits), ink));
    this.#plots[1].hooks.draw?.push((plot) => drawLimits(plot, this.#velocityLimits(), ink));
    this.#fill();
  }

  /**
   * @param {string} title
   * @param {import("uplot").Series[]} lines
   * @param {import("uplot").Scale} scale of the values
   * @param {CSSStyleDeclaration} style of the page
   */
  #plot(title, lines, scale, style) {
    const { uPlot } = /** @type {Libraries} */ (this.#libraries);
    const axis = { stroke: style.color, font: `12px ${style.fontFamily}`, ticks: { show: false } };
    const grid = { stroke: style.borderTopColor, width: 1 };
    const caption = element("figcaption", {}, element("span", {}, title), element("span", { class: "beyond" }));
    const holder = element("figure", {}, caption);
    this.#box.append(holder);
    const plot = new uPlot(
      {
        width: Math.max(this.#box.clientWidth, 100),
        height: HEIGHT,
        padding: [6, 16, 0, 0],
        legend: { show: false },
        cursor: { y: false, points: { show: false }, drag: { x: true, y: false, dist: 5 }, sync: { key: "run" } },
        scales: { x: { time: false, range: () => this.#shown() }, y: scale },
        axes: [
          { ...axis, grid, size: 22, values: (_plot, times) => times.map((time) => `${time} s`) },
          { ...axis, grid, size: AXIS },
        ],
        series: [{}, ...lines],
        hooks: { draw: [(plot) => this.#drawLine(plot)], setSelect: [(plot) => this.#select(plot)], destroy: [() => holder.remove()] },
      },
      /** @type {any} */ ([[], ...lines.map(() => [])]),
      holder,
    );
    plot.over.append(element("div", { class: "time-line" }));
    plot.over.addEventListener("click", () => this.#cursor.seek(plot.posToVal(plot.cursor.left ?? 0, "x")));
    plot.over.addEventListener("dblclick", () => this.#setRange(null));
    return plot;
  }

  /** @param {Plot} plot with the range that the user has selected */
  #select(plot) {
    const { left, width } = plot.select;
    if (width > 0) this.#setRange([plot.posToVal(left, "x"), plot.posToVal(left + width, "x")]);
    plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
  }

  /** @param {[number, number] | null} range */
  #setRange(range) {
    this.#range = range;
    this.#fill();
  }

  /**
   * Show a longer or shorter time around the cursor.
   * @param {number} factor
   */
  #zoom(factor) {
    const [from, to] = this.#shown();
    const length = Math.max((to - from) * factor, SHORTEST);
    const middle = factor < 1 ? this.#cursor.time : (from + to) / 2;
    const begin = Math.max(0, middle - length / 2);
    this.#setRange(length >= this.#cursor.end ? null : [begin, begin + length]);
  }

  /** @returns {[number, number]} start and end of the time axis [s] */
  #shown() {
    const { end } = this.#cursor;
    // The axis of a running goal grows in steps, so that the lines do not move all the time.
    if (!this.#grows) this.#end = Math.max(end, 0.1);
    else if (end > this.#end || end * GROWTH ** 2 < this.#end) this.#end = Math.max(end * GROWTH, 1);
    return this.#range ?? [0, this.#end];
  }

  /** Show the newest values. */
  #fill() {
    const history = this.#history;
    if (!history || !this.#libraries || this.#plots.length === 0) return;
    const [positions, velocities, lateness] = this.#plots;
    positions.setData(this.#aligned("commanded", "measured"));
    velocities.setData(this.#aligned("velocity", "measuredVelocity"));
    const late = history.lateness.columns.get("frame") ?? [];
    lateness.setData([history.lateness.times, late.map((each) => (each ?? 0) * 1000)]);
    this.#drawBand(history);
    this.#drawCursor(true);
  }

  /**
   * Return the values of all joints in all layers, over common times.
   * @param {"commanded" | "velocity"} commanded
   * @param {"measured" | "measuredVelocity"} measured
   * @returns {Data}
   */
  #aligned(commanded, measured) {
    const { uPlot } = /** @type {Libraries} */ (this.#libraries);
    const own = /** @type {History} */ (this.#history);
    const tables = this.#layers().map((dash) => {
      if (dash === OTHER) return this.#table(/** @type {History} */ (this.#other)[commanded]);
      return this.#table(own[dash === MEASURED ? measured : commanded]);
    });
    return tables.length === 1 ? tables[0] : uPlot.join(tables);
  }

  /** @param {Series} series @returns {any} */
  #table(series) {
    const columns = this.#joints.map((joint) => {
      const column = series.columns.get(joint.name) ?? series.times.map(() => 0);
      return column.map((value) => (value === null ? null : value * scaleOf(joint)));
    });
    return [series.times, ...columns];
  }

  /**
   * @param {number | null} low
   * @param {number | null} high null if there is no value
   * @returns {import("uplot").Range.MinMax}
   */
  #positionRange(low, high) {
    if (low === null || high === null || !this.#libraries) return [-1, 1];
    return this.#libraries.uPlot.rangeNum(low, high, 0.1, true);
  }

  /** @returns {[number, number]} */
  #velocityRange() {
    const most = Math.max(0, ...this.#velocityLimits()) * 1.1 || 1;
    return [-most, most];
  }

  /** @returns {Set<number>} */
  #velocityLimits() {
    return this.#limits((joint) => {
      const limit = this.#history?.limits.get(joint.name);
      return limit === undefined ? [] : [-limit, limit];
    });
  }

  /**
   * Return the limits of the shown joints, in the units of the plots.
   * @param {(joint: Joint) => number[]} limitsOf returns the limits of a joint
   */
  #limits(limitsOf) {
    const shown = this.#joints.filter((joint) => !this.#off.has(joint.name));
    return new Set(shown.flatMap((joint) => limitsOf(joint).map((limit) => limit * scaleOf(joint))));
  }

  /** @param {History} history */
  #drawBand({ phases }) {
    const [from, to] = this.#shown();
    const bars = phases.map(({ time, phase }, index) => {
      const begin = Math.max(time, from);
      const end = Math.min(phases[index + 1]?.time ?? Math.max(this.#cursor.end, time), to);
      if (end <= begin) return "";
      const bar = element("span", { class: "phase", title: `${phase}, from ${time.toFixed(2)} s` }, phase);
      bar.style.setProperty("left", `${(100 * (begin - from)) / (to - from)}%`);
      bar.style.setProperty("width", `${(100 * (end - begin)) / (to - from)}%`);
      return bar;
    });
    this.#band.replaceChildren(...bars.filter((each) => each !== ""));
  }

  /**
   * Show the time of the cursor, and the values at it.
   * @param {boolean} [always] True to draw also if the time is the same
   */
  #drawCursor(always = false) {
    const { time } = this.#cursor;
    if (time === this.#time && !always) return;
    this.#time = time;
    setText(byId("plot-time", HTMLElement), `${time.toFixed(2)} s`);
    for (const plot of this.#plots) this.#drawLine(plot);
    if (!this.#history) return;
    const { commanded } = this.#history;
    const row = commanded.indexAt(time);
    for (const [index, joint] of this.#joints.entries()) {
      const value = commanded.columns.get(joint.name)?.[row];
      const output = /** @type {HTMLElement} */ (this.#keys.children[index].lastElementChild);
      setText(output, value === undefined || value === null ? "" : `${(value * scaleOf(joint)).toFixed(1)} ${unitOf(joint)}`);
    }
  }

  /** @param {Plot} plot */
  #drawLine(plot) {
    const line = /** @type {HTMLElement} */ (plot.over.lastElementChild);
    line.style.setProperty("left", `${plot.valToPos(this.#cursor.time, "x") - 0.5}px`);
  }

  /**
   * Return a checkbox that shows or hides a joint, with the joint's colour.
   * @param {Joint} joint
   * @param {number} index
   */
  #key(joint, index) {
    const box = element("input", { type: "checkbox", checked: true });
    box.addEventListener("change", () => {
      if (box.checked) this.#off.delete(joint.name);
      else this.#off.add(joint.name);
      this.#build();
    });
    const swatch = element("span", { class: `swatch series-${(index % COLORS) + 1}` });
    return element("label", {}, box, swatch, joint.name, element("output", { class: "quiet" }));
  }

  /** @param {string} per */
  #units(per) {
    return [...new Set(this.#joints.map((joint) => `${unitOf(joint)}${per}`))].join(", ");
  }

  #resize() {
    const width = this.#box.clientWidth;
    if (width) for (const plot of this.#plots) plot.setSize({ width, height: HEIGHT });
    this.#drawCursor(true);
  }
}

/**
 * Draw dotted lines at limits, and show the nearest limits outside of the plot as text.
 * @param {Plot} plot
 * @param {Set<number>} limits
 * @param {string} color
 */
function drawLimits(plot, limits, color) {
  const { ctx, bbox } = plot;
  const { min = 0, max = 0 } = plot.scales.y;
  ctx.save();
  ctx.strokeStyle = color;
  ctx.setLineDash([2 * devicePixelRatio, 4 * devicePixelRatio]);
  for (const limit of limits) {
    if (limit < min || limit > max) continue;
    const y = plot.valToPos(limit, "y", true);
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
  }
  ctx.restore();
  const below = Math.max(...[...limits].filter((limit) => limit < min));
  const above = Math.min(...[...limits].filter((limit) => limit > max));
  const beyond = [below, above].filter(Number.isFinite).map((limit) => Number(limit.toFixed(1)));
  const words = beyond.length ? `next limit${beyond.length > 1 ? "s" : ""} ${beyond.join(" and ")}` : "";
  const note = plot.root.parentElement?.querySelector(".beyond");
  if (note) setText(note, words);
}

/** @param {History} history */
function versions({ commanded, measured, velocity, lateness, version }) {
  return [commanded, measured, velocity, lateness].map((each) => each.version).join(" ") + ` ${version}`;
}

/** @param {Joint} joint */
function scaleOf(joint) {
  return joint.unit === "m" ? 1000 : 180 / Math.PI;
}

/** @param {Joint} joint */
function unitOf(joint) {
  return joint.unit === "m" ? "mm" : "deg";
}
