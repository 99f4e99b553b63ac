// The scores of Sphinx, except that the glossary comes after the page of a term.
var Scorer = {
  score: ([docname, , , , score]) => (docname === "glossary" ? score - 2 : score),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
