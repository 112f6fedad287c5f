// Ranks the pages of the search: first those that teach, last the pages of single findings.
const BONUS = { tutorial: 6, howto: 8, explanation: 4, reference: -3, diagnostics: -20, development: -5 };

var Scorer = {
  // [document, title, anchor, description, score, file name, kind]
  score: ([page, , , , score]) => {
    const words = new URLSearchParams(location.search).get("q") ?? "";
    // A reader who types a code wants its page.
    if (/^\s*FSN\d+\s*$/i.test(words)) return score;
    return score + (BONUS[page.split("/")[0]] ?? 0);
  },
  // As Sphinx has them without this file.
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
