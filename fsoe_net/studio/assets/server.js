// Requests to the server, and its word that something has changed.

/**
 * @param {string} act
 * @param {Record<string, unknown>} body
 */
export function post(act, body) {
  return send(act, JSON.stringify(body), "application/json");
}

/**
 * @param {string} path
 * @param {BodyInit} body
 * @param {string} type
 */
async function send(path, body, type) {
  try {
    const headers = { "content-type": type, "x-fsoe-net": "1" };
    return await read(await fetch(`/api/${path}`, { method: "POST", headers, body }));
  } catch {
    return { error: GONE };
  }
}

/** @param {string} path */
export async function ask(path) {
  try {
    return await read(await fetch(`/api/${path}`));
  } catch {
    return { error: GONE };
  }
}

/** @returns {Promise<import("./types").Uploads | { error: string }>} */
export const offers = () => ask("offers");

/**
 * @param {import("./types").Given} given
 * @returns {Promise<import("./types").Uploads | { error: string }>}
 */
export const upload = ({ name, file }) =>
  send(`files?name=${encodeURIComponent(name)}`, file, "application/octet-stream");

/** @returns {Promise<import("./types").Uploads | { error: string }>} */
export const putAway = () => post("files/clear", {});

/** @returns {Promise<import("./types").Targets | { error: string }>} */
export const targets = () => ask("targets");

/**
 * @param {string} target
 * @param {number} version
 * @returns {Promise<import("./types").Export | { error: string }>}
 */
export const preview = (target, version) => ask(`export/${target}?version=${version}`);

/**
 * @param {string} act
 * @param {Record<string, unknown>} body
 * @returns {Promise<import("./types").State | { error: string }>}
 */
export const request = (act, body) => post(act, body);

/** @returns {Promise<import("./types").Tried | { error: string }>} */
export const tryIt = () => post("try", {});

export const GONE = "fsoe-net studio does not answer; start it again, and open the address it prints";

/** @returns {Promise<import("./types").State | { error: string }>} */
export const state = () => ask("state");

/** @param {Response} answer */
export async function read(answer) {
  const type = answer.headers.get("content-type") ?? "";
  const { status } = answer;
  return type.startsWith("application/json")
    ? { status, ...(await answer.json()) }
    : { status, error: (await answer.text()).trim() };
}

/**
 * Calls back at each new version, and when the server has gone or come back. A hidden page listens
 * to nothing.
 * @param {(version: number) => void} onVersion
 * @param {(there: boolean) => void} onServer
 */
export function listen(onVersion, onServer) {
  /** @type {EventSource | null} */
  let source = null;
  const follow = () => {
    if (document.hidden) {
      source?.close();
      source = null;
    } else if (source === null || source.readyState === EventSource.CLOSED) {
      source?.close();
      source = new EventSource("/api/events");
      source.onmessage = (event) => onVersion(Number(event.data));
      source.onopen = () => onServer(true);
      source.onerror = () => onServer(false);
    }
  };
  document.addEventListener("visibilitychange", follow);
  const again = setInterval(follow, 2000);
  follow();
  return () => {
    document.removeEventListener("visibilitychange", follow);
    clearInterval(again);
    source?.close();
  };
}
