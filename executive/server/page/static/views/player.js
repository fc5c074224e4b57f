/** The player of a recorded run: the shown moment, and actions on the recording. */

import { isSignedIn, pathOf, post, request, wordsOf } from "../api.js";
import { byId, element, setAttribute, setText, setUsable } from "../dom.js";

/** @typedef {import("../model/shown_run.js").ShownRun} ShownRun */
/** @typedef {import("../model/cursor.js").Cursor} Cursor */
/** @typedef {import("./runs.js").Recording} Recording */

const AT_END = 0.05; // a moment less than this before the end counts as the end [s]
const LONGEST_FRAME = 0.25; // longest time that is played in one frame of the screen; a hidden tab has no frames [s]

/** Events: `delete` with the name of a recording, `change` when a recording was pinned. */
export class Player extends EventTarget {
  #shown;
  #cursor;
  #panel = byId("player", HTMLElement);
  #play = byId("play", HTMLButtonElement);
  #moment = byId("moment", HTMLInputElement);
  #speed = byId("speed", HTMLSelectElement);
  #note = byId("player-note", HTMLElement);
  #pin = byId("pin", HTMLButtonElement);
  #recording = "";
  #pinned = false;
  #playing = false;
  #frame = 0;

  /**
   * @param {ShownRun} shown
   * @param {Cursor} cursor
   */
  constructor(shown, cursor) {
    super();
    this.#shown = shown;
    this.#cursor = cursor;
    this.#play.addEventListener("click", () => this.#setPlaying(!this.#playing));
    this.#moment.addEventListener("input", () => {
      this.#setPlaying(false);
      cursor.seek(Number(this.#moment.value));
    });
    on("step-back", () => this.#step(-1));
    on("step-on", () => this.#step(1));
    on("live", () => shown.follow());
    on("verify", () => this.#act(() => this.#verify()));
    on("pin", () => this.#act(() => this.#switchPin()));
    on("download", () => this.#act(() => this.#download()));
    on("link", () => this.#act(() => this.#copyLink()));
    on("delete", () => this.dispatchEvent(new CustomEvent("delete", { detail: this.#recording })));
    document.addEventListener("keydown", (event) => this.#key(event));
  }

  /**
   * Show a message.
   * @param {unknown} error
   */
  say(error) {
    setText(this.#note, wordsOf(error));
  }

  /** @param {Recording[]} recordings the listed recordings */
  draw(recordings) {
    const { recorded } = this.#shown;
    this.#panel.hidden = !recorded;
    if (recorded?.name !== this.#recording) this.#begin(recorded?.name ?? "");
    if (!recorded) return;
    const { time } = this.#cursor;
    this.#pinned = recordings.find((each) => each.name === recorded.name)?.pinned ?? this.#pinned;
    setText(this.#pin, this.#pinned ? "Unpin" : "Pin");
    for (const id of ["verify", "pin", "delete"]) setUsable(byId(id, HTMLButtonElement), isSignedIn());
    setAttribute(this.#moment, "max", recorded.duration);
    setAttribute(this.#moment, "step", "any");
    if (Number(this.#moment.value) !== time) this.#moment.value = String(time);
    const words = `${time.toFixed(2)} of ${recorded.duration.toFixed(2)} s`;
    setAttribute(this.#moment, "aria-valuetext", words);
    setText(byId("moment-words", HTMLElement), words);
    setText(byId("player-name", HTMLElement), recorded.name);
    byId("player-acts", HTMLElement).hidden = !recorded.name; // a dry run has no recording
  }

  /** @param {string} recording */
  #begin(recording) {
    this.#recording = recording;
    this.#pinned = false;
    this.#setPlaying(false);
    setText(this.#note, "");
  }

  /** @param {boolean} playing */
  #setPlaying(playing) {
    if (playing === this.#playing) return;
    this.#playing = playing;
    setText(this.#play, playing ? "Pause" : "Play");
    cancelAnimationFrame(this.#frame);
    if (!playing) return;
    if (this.#cursor.time > this.#cursor.end - AT_END) this.#cursor.seek(0);
    let before = performance.now();
    /** @param {number} now */
    const next = (now) => {
      const passed = Math.min((now - before) / 1000, LONGEST_FRAME);
      before = now;
      if (!this.#shown.recorded?.waits) this.#cursor.seek(this.#cursor.time + passed * Number(this.#speed.value));
      if (this.#cursor.time >= this.#cursor.end) this.#setPlaying(false);
      else this.#frame = requestAnimationFrame(next);
    };
    this.#frame = requestAnimationFrame(next);
  }

  /** @param {1 | -1} direction */
  #step(direction) {
    this.#setPlaying(false);
    const time = this.#shown.recorded?.step(direction);
    if (time !== undefined) this.#cursor.seek(time);
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    if (this.#panel.hidden || isTyping(event.target) || event.ctrlKey || event.metaKey || event.altKey) return;
    const acts = /** @type {Record<string, () => void>} */ ({
      ",": () => this.#step(-1),
      ".": () => this.#step(1),
      k: () => this.#setPlaying(!this.#playing),
    });
    // Outside of the player, these keys have another meaning.
    if (event.target instanceof Node && this.#panel.contains(event.target)) {
      acts.Home = () => this.#cursor.seek(0);
      acts.End = () => this.#cursor.seek(this.#cursor.end);
    }
    if (!acts[event.key]) return;
    event.preventDefault();
    acts[event.key]();
  }

  /**
   * Call a function, and show its result unless another recording is shown meanwhile.
   * @param {() => Promise<string | Node>} act
   */
  async #act(act) {
    const recording = this.#recording;
    const result = await act().catch(wordsOf);
    if (recording === this.#recording) this.#note.replaceChildren(result);
  }

  async #verify() {
    setText(this.#note, "Verifying: the run is planned again…");
    const { verdicts, error } = await post(`${pathOf(this.#recording)}/verify`);
    const lines = verdicts.map((/** @type {any} */ each) =>
      element(
        "li",
        { class: each.holds ? "" : "failed" },
        `${each.question}${each.empty ? "" : each.holds ? " holds" : " differs"}: ${each.words}`,
        ...(each.source ? [`, because of ${each.source}`] : []),
      ),
    );
    if (error) lines.push(element("li", { class: "failed" }, error));
    return element("ul", {}, ...lines);
  }

  async #switchPin() {
    const recording = this.#recording;
    const { pinned } = await post(`${pathOf(recording)}/pin`, { on: !this.#pinned });
    if (recording === this.#recording) this.#pinned = pinned;
    this.dispatchEvent(new Event("change"));
    return pinned ? "Pinned: it is never deleted." : "No longer pinned.";
  }

  async #download() {
    const name = this.#recording;
    const file = await (await request(`${pathOf(name)}/file`, {})).blob();
    const address = URL.createObjectURL(file);
    element("a", { href: address, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(address), 60_000);
    return "";
  }

  async #copyLink() {
    const link = `${location.origin}${location.pathname}${recordingHash(this.#recording, this.#cursor.time)}`;
    history.replaceState(null, "", link);
    // Browsers allow the clipboard only on this machine and over HTTPS.
    if (!navigator.clipboard) return "Copy the address of this page: it opens this moment.";
    await navigator.clipboard.writeText(link);
    return "The address of this moment is copied.";
  }
}

/**
 * Return true if an element uses keys itself: a text field or a list.
 * @param {EventTarget | null} target
 */
function isTyping(target) {
  return target instanceof HTMLElement && target.matches("select, input:not([type=range], [type=checkbox])");
}

/**
 * Return the part of the address with a recording and a moment.
 * @param {string} recording
 * @param {number} [time] from the run's beginning [s]; default: its end
 */
export function recordingHash(recording, time) {
  return `#${new URLSearchParams({ recording, ...(time === undefined ? {} : { t: time.toFixed(3) }) })}`;
}

/**
 * @param {string} id
 * @param {() => void} act
 */
function on(id, act) {
  byId(id, HTMLButtonElement).addEventListener("click", act);
}
