/** Small helpers for elements. Text is always set as text, never as HTML. */

/**
 * Return the element with an id, which must be of a kind.
 * @template {HTMLElement} T
 * @param {string} id
 * @param {new () => T} kind such as HTMLButtonElement
 * @returns {T}
 */
export function byId(id, kind) {
  const found = document.getElementById(id);
  if (!(found instanceof kind)) throw new Error(`index.html has no ${kind.name} ${id}`);
  return found;
}

/**
 * Return a new element.
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Record<string, string | boolean | number>} [attributes] true sets it without a value,
 *   false leaves it out
 * @param {...(Node | string)} children
 * @returns {HTMLElementTagNameMap[K]}
 */
export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) setAttribute(made, name, value);
  made.append(...children);
  return made;
}

/**
 * Set or remove an attribute, if it differs.
 * @param {Element} target
 * @param {string} name
 * @param {string | boolean | number} value
 */
export function setAttribute(target, name, value) {
  const text = value === true ? "" : String(value);
  if (value === false) target.removeAttribute(name);
  else if (target.getAttribute(name) !== text) target.setAttribute(name, text);
}

/**
 * Set the text of an element, if it differs.
 * @param {Element} target
 * @param {string} text
 */
export function setText(target, text) {
  if (target.textContent !== text) target.textContent = text;
}

/**
 * Replace the children of an element. A child that stays keeps the focus.
 * @param {Element} target
 * @param {Element[]} children
 */
export function setChildren(target, children) {
  const focused = document.activeElement;
  target.replaceChildren(...children);
  if (focused instanceof HTMLElement && target.contains(focused)) focused.focus({ preventScroll: true });
}

/**
 * Scroll just far enough to show an element.
 * @param {Element} target
 */
export function reveal(target) {
  target.scrollIntoView({ block: "nearest" });
}

/**
 * Return true if the content of an element differs from the last call, so it must be drawn again.
 * @param {HTMLElement} target
 * @param {string} key all content of the element, as text
 */
export function isNew(target, key) {
  if (target.dataset.key === key) return false;
  target.dataset.key = key;
  return true;
}

/**
 * Enable or disable a button. The button keeps the focus, unlike with `disabled`.
 * @param {HTMLButtonElement} button
 * @param {boolean} usable
 */
export function setUsable(button, usable) {
  setAttribute(button, "aria-disabled", usable ? false : "true");
}

/** Ignore clicks on buttons that are not usable. */
export function ignoreUnusable() {
  document.addEventListener(
    "click",
    (event) => {
      if (!(event.target instanceof Element) || !event.target.closest("[aria-disabled='true']")) return;
      event.preventDefault(); // the button must not submit a form
      event.stopPropagation();
    },
    { capture: true },
  );
}

/**
 * Return a function that calls another one in the next frame of the screen, at most once per frame.
 * @param {() => void} draw
 * @param {() => number} [period] shortest time between two calls [ms]; default: one frame
 * @returns {() => void}
 */
export function oncePerFrame(draw, period = () => 0) {
  let asked = false;
  let last = -Infinity; // time of the last call [ms]
  const ask = () =>
    requestAnimationFrame(() => {
      asked = false;
      last = performance.now();
      draw();
    });
  return () => {
    if (asked) return;
    asked = true;
    const wait = last + period() - performance.now();
    if (wait > 0) setTimeout(ask, wait);
    else ask();
  };
}
