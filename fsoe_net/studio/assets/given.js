// Files and folders that a person drops or chooses.

/** @typedef {import("./types").Given} Given */

/**
 * The files of a drop, those of folders with their names below it. The list of a drop is gone after
 * the event, so that it is taken at once.
 * @param {DataTransfer} data
 * @returns {Promise<Given[]>}
 */
export async function dropped(data) {
  const entries = [...data.items].map((item) => item.webkitGetAsEntry?.());
  const files = [...data.files].map((file) => ({ name: file.name, file }));
  if (!entries.some((entry) => entry?.isDirectory)) return files;
  const found = await Promise.all(entries.map((entry) => (entry ? inside(entry) : [])));
  return found.flat();
}

/**
 * @param {FileSystemEntry} entry
 * @returns {Promise<Given[]>}
 */
async function inside(entry) {
  const name = entry.fullPath.replace(/^\//, "");
  if (entry.isFile) {
    const own = /** @type {FileSystemFileEntry} */ (entry);
    return [{ name, file: await new Promise((good, bad) => own.file(good, bad)) }];
  }
  const reader = /** @type {FileSystemDirectoryEntry} */ (entry).createReader();
  /** @type {Given[]} */
  const found = [];
  for (;;) {
    /** @type {FileSystemEntry[]} */
    const some = await new Promise((good, bad) => reader.readEntries(good, bad));
    if (!some.length) return found; // a browser gives a long folder in pieces
    for (const one of some) found.push(...(await inside(one)));
  }
}

/**
 * @param {HTMLInputElement} input
 * @returns {Given[]}
 */
export const chosen = (input) =>
  [...(input.files ?? [])].map((file) => ({ name: file.webkitRelativePath || file.name, file }));
