// Requests to the server, and its word that something has changed.

/**
 * @param {string} act
 * @param {Record<string, unknown>} body
 */
async function post(act, body) {
  try {
    const answer = await fetch(`/api/${act}`, {
      method: "POST",
      headers: { "content-type": "application/json", "x-fsoe-net": "1" },
      body: JSON.stringify(body),
    });
    return await read(answer);
  } catch {
    return { error: GONE };
  }
}

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
export async function state() {
  try {
    return await read(await fetch("/api/state"));
  } catch {
    return { error: GONE };
  }
}

/** @param {Response} answer */
async function read(answer) {
  const type = answer.headers.get("content-type") ?? "";
  return type.startsWith("application/json")
    ? answer.json()
    : { error: (await answer.text()).trim() };
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
