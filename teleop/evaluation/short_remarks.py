"""Remove the numbers from the remarks on results, and count the results with the same remark."""

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
    """Return a remark without its numbers, so that remarks on several recordings can be equal.

    For example, the remark "bad fit: 12 % of the force variance is not explained" becomes "bad
    fit". Parentheses that contain a number are removed first. If a number remains after a colon, a
    semicolon or a comma, the text from this punctuation mark to its end is removed.
    """
    return FROM_FIRST_NUMBER.sub("", IN_PARENTHESES.sub("", remark))


def remark_counts(results: Iterable[Result]) -> dict[str, int]:
    """Return the number of results with each remark, by the remark without its numbers."""
    return dict(Counter(text for one in results for text in dict.fromkeys(map(short, one.reasons))))
