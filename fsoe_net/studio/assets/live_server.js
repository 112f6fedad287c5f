// Requests of the live page, and the stream of its pictures.
import { post, read } from "./server.js";

/** @param {string} what @param {Record<string, unknown>} body @returns {Promise<any>} */
export const live = (what, body = {}) => post(`live/${what}`, body);

/** @param {string} path @returns {Promise<any>} */
export async function get(path) {
  try {
    return await read(await fetch(`/api/live${path}`));
  } catch {
    return { error: "fsoe-net studio does not answer" };
  }
}

/**
 * Calls back with each picture of a source. A hidden page has no stream, and costs nothing.
 * @param {string} source
 * @param {() => string} known what the page has, as the query of an address
 * @param {(picture: import("./types").Picture) => void} onPicture
 * @param {(there: boolean) => void} onServer
 */
export function follow(source, known, onPicture, onServer) {
  /** @type {EventSource | null} */
  let stream = null;
  const look = () => {
    if (document.hidden) {
      stream?.close();
      stream = null;
    } else if (stream === null || stream.readyState === EventSource.CLOSED) {
      stream = new EventSource(`/api/live/stream?source=${source}&${known()}`);
      stream.onmessage = (event) => onPicture(JSON.parse(event.data));
      stream.onopen = () => onServer(true);
      stream.onerror = () => onServer(false);
    }
  };
  document.addEventListener("visibilitychange", look);
  const again = setInterval(look, 2000);
  look();
  return () => {
    document.removeEventListener("visibilitychange", look);
    clearInterval(again);
    stream?.close();
  };
}
