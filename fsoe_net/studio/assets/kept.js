// Entries of a test record that the file does not have yet: in the page's storage, until it has.
import { post } from "./server.js";

/** @typedef {import("./types").Kept} Kept */
/** @typedef {import("./types").Fields} Fields */
/** @typedef {{ step: string, subdevice: string }} Part */

const PREFIX = "fsoe-net test record ";
const NAME = "fsoe-net name";

/** @param {Part} part */
export const idOf = (part) => (part.step ? `step ${part.step}` : `device ${part.subdevice}`);

/**
 * @param {(name: string) => boolean} isOne
 * @returns {Kept[]}
 */
function stored(isOne) {
  return Object.keys(localStorage)
    .filter((name) => name.startsWith(PREFIX) && isOne(name.slice(PREFIX.length)))
    .flatMap((name) => {
      try {
        return [JSON.parse(localStorage.getItem(name) ?? "")];
      } catch {
        return []; // another page of this address wrote it: no entry
      }
    });
}

/**
 * All that is kept of a test record, by part.
 * @param {string} key
 */
export const allKept = (key) =>
  Object.fromEntries(stored((name) => name.startsWith(`${key} `)).map((kept) => [idOf(kept), kept]));

/**
 * What is kept of other test records: of an earlier configuration, or of another network.
 * @param {string} key
 */
export const othersKept = (key) => stored((name) => !name.startsWith(`${key} `));

/**
 * Keeps an entry; false: this browser keeps nothing.
 * @param {string} key
 * @param {Kept} kept
 */
export function keep(key, kept) {
  try {
    localStorage.setItem(`${PREFIX}${key} ${idOf(kept)}`, JSON.stringify(kept));
    return true;
  } catch {
    return false;
  }
}

/**
 * @param {string} key
 * @param {Part} part
 */
export const forget = (key, part) => localStorage.removeItem(`${PREFIX}${key} ${idOf(part)}`);

export const lastName = () => localStorage.getItem(NAME) ?? "";

/** @param {string} name */
export const keepName = (name) => localStorage.setItem(NAME, name);

/** @param {Kept} kept */
export const waits = (kept) => kept.done && !kept.problem && kept.theirs === null;

/**
 * Whether the file has what was sent: then only the answer was lost.
 * @param {Fields} present
 * @param {Fields | null} sent
 */
const isSent = (present, sent) =>
  sent !== null &&
  Object.keys(present).every((key) =>
    key === "remark" ? present[key].startsWith(sent[key]) : present[key] === sent[key],
  );

/**
 * Sends what waits; what was not taken stays, with the reason.
 * @param {string} key
 * @param {number} file
 * @returns {Promise<string>} Why nothing could be sent; empty: all has been answered.
 */
export async function send(key, file) {
  for (const [id, kept] of Object.entries(allKept(key))) {
    if (!waits(kept)) continue;
    const { step, subdevice, before, now } = kept;
    // Noted before sending: if the answer is lost, the page can tell its own entry from another one.
    keep(key, { ...kept, sent: now });
    const answer = await post("test-record/enter", { file, key, step, subdevice, before, now });
    const later = allKept(key)[id];
    if (later === undefined) continue; // thrown away meanwhile
    // The person may have continued to type while the answer was on its way.
    const isSame = JSON.stringify(later.now) === JSON.stringify(now) && later.done;
    if ("present" in answer && !answer.error) {
      if (isSame) forget(key, kept);
      else keep(key, { ...later, before: answer.present });
    } else if ("present" in answer) {
      // The file has what was sent: the entry is not in conflict with itself.
      if (isSent(answer.present, kept.sent)) keep(key, { ...later, before: answer.present, sent: null });
      else keep(key, { ...later, theirs: answer.present });
    // The server refused the content; sending it again would not help.
    } else if (answer.status === 422) {
      if (isSame) keep(key, { ...later, problem: answer.error });
    } else {
      // Anything else is a fault of the server or of the network: the rest is sent later.
      return answer.error;
    }
  }
  return "";
}
