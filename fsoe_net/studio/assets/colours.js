// Colours of the style sheet for drawing on a canvas, which cannot read its variables.

/** @type {Map<string, string>} */
const known = new Map();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => known.clear());

/** The colour that a variable of the style sheet has now. @param {string} name */
export function colour(name) {
  let found = known.get(name);
  if (found === undefined) {
    const probe = document.createElement("span");
    probe.style.color = `var(--${name})`;
    document.body.append(probe);
    found = getComputedStyle(probe).color;
    probe.remove();
    known.set(name, found);
  }
  return found;
}
