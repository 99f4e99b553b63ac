"""Name the version of this software, with the commit where there is one."""

from __future__ import annotations

import subprocess
from functools import cache
from pathlib import Path

from telepalpation import __version__

PACKAGE = Path(__file__).parent
BUILT_FROM = PACKAGE / "commit.txt"
"""File that `setup.py` adds to a package that is built in a git checkout."""


@cache
def software() -> str:
    """The version and the commit, such as `0.2.0 (commit 51c01ce9)`.

    The commit is followed by `modified` if files differ from it. It is left out if the package was
    neither built in a git checkout nor runs in one.
    """
    commit = checkout_commit(PACKAGE.parent) or built_commit()
    return __version__ + (f" (commit {commit})" if commit else "")


def built_commit() -> str:
    """The commit from which this package was built; empty if it is not known."""
    try:
        return BUILT_FROM.read_text().strip()
    except OSError:
        return ""


def checkout_commit(folder: Path) -> str:
    """The commit of a folder; empty if the folder is not the top of a git checkout."""
    if not (folder / ".git").exists():
        return ""
    # `dirty` compares the files with the commit; no tag can match, so that the commit is printed
    asked = ["git", "-C", str(folder), "describe", "--always", "--exclude=*", "--abbrev=8"]
    try:
        answer = subprocess.run(
            [*asked, "--dirty=, modified"], capture_output=True, text=True, timeout=5, check=True
        )
    except (OSError, subprocess.SubprocessError):  # no git, or a folder of another user
        return ""
    return answer.stdout.strip()
