/** Reads server-sent events from an answer, because an EventSource cannot send the token. */

/**
 * Yield the events of an answer until it ends.
 * @param {Response} response
 * @returns {AsyncGenerator<any>} the JSON of each event
 */
export async function* readEvents(response) {
  if (!response.body) return;
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  let text = "";
  for (let read = await reader.read(); !read.done; read = await reader.read()) {
    const parts = (text + read.value).split("\n\n");
    text = parts.pop() ?? "";
    for (const part of parts) {
      const data = part.split("\n").find((line) => line.startsWith("data: "));
      if (data) yield JSON.parse(data.slice("data: ".length)); // else a comment
    }
  }
}
