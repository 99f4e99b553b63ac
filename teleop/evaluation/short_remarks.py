"""Shorten the remarks on results, so that recordings with similar remarks can be counted."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable

from teleop.evaluation.result import Result

IN_PARENTHESES = re.compile(r" \([^()]*\d[^()]*\)")
"""Pattern of a part in parentheses that contains a number."""
FROM_FIRST_NUMBER = re.compile(r"[:;,][^:;,\d]*\d.*")
"""Pattern of the first part of a sentence that contains a number, and of all parts after it."""


def short(remark: str) -> str:
    """Return a remark without the parts that contain numbers.

    The numbers differ between recordings. A part in parentheses is removed alone. Another part is
    removed together with the text after it.
    """
    return FROM_FIRST_NUMBER.sub("", IN_PARENTHESES.sub("", remark))


def remark_counts(results: Iterable[Result]) -> dict[str, int]:
    """Return the short form of each remark, with the number of results that have this remark."""
    return dict(Counter(text for one in results for text in dict.fromkeys(map(short, one.reasons))))
