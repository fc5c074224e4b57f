/** Loads the libraries of 3D and plots, once for all views. */

import { byId, setText } from "../dom.js";

/** @typedef {typeof import("../../libraries.js")} Libraries */

const FAILED = "The page could not load 3D and plots. It tries again with the next connection; or reload the page.";

/** @type {Promise<Libraries | null> | null} */
let loading = null;
let failures = 0;

/** @returns {Promise<Libraries | null>} null if they cannot be loaded; the next call tries again */
export function loadLibraries() {
  loading ??= load();
  return loading;
}

/** @returns {Promise<Libraries | null>} */
async function load() {
  const note = byId("no-3d", HTMLElement);
  try {
    // A browser may keep a module that failed, so each attempt has its own address.
    const libraries = await import(`./libraries.js${failures ? `?attempt=${failures}` : ""}`);
    if (note.textContent === FAILED) setText(note, ""); // another error stays
    return libraries;
  } catch {
    failures += 1;
    loading = null;
    setText(note, FAILED);
    return null;
  }
}
