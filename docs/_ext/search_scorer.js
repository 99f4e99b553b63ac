// The scores of Sphinx, except that pages that mention everything come after the page of a term.
var General = ["glossary", "commands", "benchmarks", "contributing"];
var Scorer = {
  score: ([docname, , , , score]) => (General.includes(docname) ? score - 11 : score),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
