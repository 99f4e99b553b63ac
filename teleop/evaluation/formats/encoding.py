"""Detect the encoding of a text file from its first bytes."""

from __future__ import annotations

import codecs
import re
from collections.abc import Sequence

from teleop.evaluation.formats.columns import split_heading
from teleop.evaluation.formats.names import KNOWN, plain
from teleop.evaluation.formats.units import is_unit

CODE_PAGES = ("utf-8", "cp1252", "gb18030", "cp932")
"""Encodings that are tried for a file without a byte order mark, in the order of preference."""
BOMS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


def encoding_of(head: bytes, names: Sequence[str] = ()) -> str | None:
    """Return the encoding of a text file; None if it is not text.

    If the file has no byte order mark, several encodings are tried. The chosen encoding gives the
    largest number of cells that are names or units of measured quantities.
    """
    for mark, name in BOMS:
        if head.startswith(mark):
            return name
    if b"\0" in head:
        even, odd = head[0::2].count(0), head[1::2].count(0)
        if max(even, odd) < len(head) // 4 or min(even, odd) > len(head) // 16:
            return None
        return "utf-16-le" if odd > even else "utf-16-be"
    usual = {plain(name.rpartition("=")[0] or name) for name in names}.union(*KNOWN.values())

    def familiar(code_page: str) -> int:
        text = head.decode(code_page, errors="replace")
        cells = {cell.strip(' "') for cell in re.split(r"[\t\r\n;,|\"]", text)}
        headings = [split_heading(cell) for cell in cells if cell and len(cell) < 100]
        score = sum(plain(h.name) in usual for h in headings)
        return score + sum(is_unit(h.unit or h.name.strip("[]()")) for h in headings)

    order = [page for page in CODE_PAGES if page != "utf-8" or decodes(head, page)]
    order += ["utf-8"]
    if head.isascii():
        return "utf-8"
    if plainly_chinese(head):
        order.insert(0, "gb18030")
    if order[0] != "utf-8" and decodes(head, "utf-8"):
        order.insert(0, "utf-8")
    return max(order, key=familiar)


def decodes(head: bytes, code_page: str) -> bool:
    """Return whether the bytes are valid text in the encoding `code_page`.

    The last character may be incomplete.
    """
    try:
        codecs.getincrementaldecoder(code_page)().decode(head)
    except UnicodeDecodeError:
        return False
    return True


def plainly_chinese(head: bytes) -> bool:
    """Return whether the non-ASCII bytes are very probably Chinese text.

    This is the case if two conditions hold. First, the bytes are valid in the encoding GB 2312.
    Second, no non-ASCII byte is directly after a Latin letter. In a European language, such a byte
    can be a letter with an accent.
    """
    return decodes(head, "gb2312") and not re.search(rb"[A-Za-z][\x80-\xff]", head)
