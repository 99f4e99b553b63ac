"""Store the results of evaluated files, so that the same files need not be evaluated again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from teleop.errors import InputError
from teleop.evaluation.across.comparison import Compared
from teleop.evaluation.formats.delimited import METADATA
from teleop.files import unreadable, write_text
from teleop.json_documents import dumps
from teleop.studies.sweep.origin import code_hash, content, origin_of, points

NAME = ".teleop-compare"
"""Name of the folder of the stored results."""
CODE = ("estimation", "teleop")
"""Packages whose code computes the results. Their versions do not identify a changed checkout."""
ROWS = TypeAdapter(Compared)


class StoredResults:
    """A folder with one file for each evaluated file.

    The name of a file in the folder is a hash of all that determines the result: the content of the
    evaluated file, the options, and the software. A result is therefore never used for another
    file, and two commands can use the folder at the same time.

    Parameters
    ----------
    folder
        The folder; None if nothing is stored.
    options
        The options of the evaluation, which can be written as JSON.
    """

    def __init__(self, folder: Path | None, options: Sequence[Any]) -> None:
        self._folder = folder
        self._options = ""
        if folder:
            code = {name: code_hash(name) for name in CODE}
            # a recording can name an estimator of another package in its settings
            self._options = dumps([options, origin_of({}, sorted(points())), code])

    def read(self, file: Path) -> Compared | None:
        """Return the stored result of a file; None if there is none, or if it cannot be read."""
        if not self._folder:
            return None
        try:
            row = ROWS.validate_python(json.loads(self._place(file).read_bytes()))
        except (OSError, ValueError):
            return None
        return replace(row, file=str(file))

    def write(self, file: Path, row: Compared) -> None:
        """Store the result of a file."""
        if not self._folder:
            return
        try:
            self._folder.mkdir(exist_ok=True)
        except OSError as error:
            raise InputError(f"{self._folder}: {error.strerror}") from error
        # Numbers that are not finite are kept, unlike in the documents for other programs.
        write_text(self._place(file), json.dumps(ROWS.dump_python(row)), overwrite=True)

    def _place(self, file: Path) -> Path:
        """Return the path of the stored result of a file."""
        assert self._folder
        digest = hashlib.sha256(self._options.encode())
        beside = file.with_name(f"{file.name}{METADATA}")
        inside = sorted(path for path in file.rglob("*") if path.is_file()) if file.is_dir() else []
        try:
            for path in inside or [file, *([beside] if beside.is_file() else [])]:
                stat = path.stat()
                digest.update(content(path, stat.st_ino, stat.st_size, stat.st_mtime_ns).encode())
        except OSError as error:
            raise unreadable(file, error) from error
        # the ending is part of how a file is read
        return self._folder / f"{digest.hexdigest()[:32]}{file.suffix.lower()}.json"
