/** Questions of tasks, and buttons to answer them. */

import { post, wordsOf } from "../api.js";
import { byId, element, reveal, setText } from "../dom.js";

/**
 * @typedef {object} Question
 * @property {string} question_id
 * @property {string} text
 * @property {string[]} choices empty if any text is allowed
 * @property {boolean} open
 */

/** Shows the open questions. */
export class QuestionsView {
  #box = byId("questions", HTMLElement);
  /** @type {Map<string, HTMLElement>} */
  #open = new Map();

  /** Forget all questions. */
  clear() {
    this.#open.clear();
    this.#box.replaceChildren();
  }

  /** @param {Question} question as it is now */
  update(question) {
    this.#open.get(question.question_id)?.remove();
    this.#open.delete(question.question_id);
    if (!question.open) return;
    const card = questionCard(question);
    this.#open.set(question.question_id, card);
    this.#box.append(card);
    reveal(card);
  }
}

/** @param {Question} question */
function questionCard(question) {
  const note = element("p", { class: "failed", role: "alert" });
  /** @param {string} answer */
  async function send(answer) {
    try {
      await post(`api/questions/${question.question_id}/answer`, { answer });
    } catch (error) {
      setText(note, wordsOf(error));
    }
  }
  const input = element("input", { type: "text", required: true, "aria-label": "Answer" });
  const form = element("form", {}, input, element("button", { type: "submit" }, "Answer"));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    send(input.value);
  });
  const buttons = question.choices.map((choice) => {
    const button = element("button", { type: "button" }, choice);
    button.addEventListener("click", () => send(choice));
    return button;
  });
  const given = buttons.length ? element("div", { class: "buttons" }, ...buttons) : form;
  const controls = element("div", { class: "signed-in-only" }, given);
  const help = element("p", { class: "quiet signed-out-only" }, "Sign in to answer.");
  const title = element("h2", {}, question.text);
  return element("section", { class: "panel question" }, title, controls, help, note);
}
