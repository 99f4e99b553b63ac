"""Check that all terms of codemeta.json are terms of CodeMeta: `python .ci/metadata_terms.py`.

A term that the vocabulary does not have is lost when the document is expanded and compacted. The
vocabulary is that in the package CodeMetaPy, because nothing is downloaded.
"""

from __future__ import annotations

import json
import sys
from importlib.resources import files
from pathlib import Path
from typing import Any

from pyld import jsonld

DOCUMENT = Path(__file__).parents[1] / "codemeta.json"
VOCABULARY = json.loads((files("codemeta") / "schema" / "codemeta.jsonld").read_text())


def names(part: Any) -> set[str]:
    """Return the terms in a part of a JSON-LD document, without the keywords of JSON-LD."""
    if isinstance(part, list):
        return set().union(*map(names, part))
    if isinstance(part, dict):
        inner = (names(value) for name, value in part.items() if name != "@context")
        return {name for name in part if name[0] != "@" and name != "type"}.union(*inner)
    return set()


def main() -> int:
    """Print the terms that the vocabulary does not have; return whether there are some."""
    document = json.loads(DOCUMENT.read_text())
    stated = names(document)
    document["@context"] = VOCABULARY["@context"]
    known = names(jsonld.compact(jsonld.expand(document), VOCABULARY["@context"]))
    for name in sorted(stated ^ known):
        print(f"{DOCUMENT.name}: {name}: expected a term of CodeMeta")
    return bool(stated ^ known)


if __name__ == "__main__":
    sys.exit(main())
