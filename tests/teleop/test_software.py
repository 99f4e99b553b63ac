"""The version and the commit that recordings and reports state."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from teleop import software
from telepalpation import __version__

TOP = Path(__file__).parents[2]


def git(folder: Path, *words: str) -> str:
    who = ("-c", "user.name=a", "-c", "user.email=a@b")
    asked = subprocess.run(
        ["git", "-C", str(folder), *who, *words], capture_output=True, text=True, check=True
    )
    return asked.stdout.strip()


@pytest.fixture
def checkout(tmp_path):
    """A git checkout with a commit and a tag."""
    git(tmp_path, "init", "-q")
    (tmp_path / "file").write_text("a\n")
    git(tmp_path, "add", "file")
    git(tmp_path, "commit", "-qm", "first")
    git(tmp_path, "tag", "v9")
    return tmp_path


def test_the_commit_of_a_checkout_is_named_and_changes_are(checkout):
    commit = git(checkout, "rev-parse", "--short=8", "HEAD")
    assert software.checkout_commit(checkout) == commit
    (checkout / "file").write_text("b\n")
    assert software.checkout_commit(checkout) == f"{commit}, modified"


def test_a_folder_within_a_checkout_has_no_commit_of_its_own(checkout):
    inner = checkout / "site-packages"
    inner.mkdir()
    assert software.checkout_commit(inner) == ""


def test_without_git_and_commit_the_version_is_all(monkeypatch, tmp_path):
    monkeypatch.setattr(software, "PACKAGE", tmp_path / "teleop")
    monkeypatch.setattr(software, "BUILT_FROM", tmp_path / "commit.txt")
    assert software.software.__wrapped__() == __version__
    (tmp_path / "commit.txt").write_text("0123abcd\n")
    assert software.software.__wrapped__() == f"{__version__} (commit 0123abcd)"
    (tmp_path / ".git").mkdir()
    monkeypatch.setenv("PATH", "")
    assert software.software.__wrapped__() == f"{__version__} (commit 0123abcd)"


def test_a_wheel_of_a_checkout_contains_its_commit(checkout):
    for name in ("setup.py", "pyproject.toml", "README.md", "LICENSE"):
        (checkout / name).write_bytes((TOP / name).read_bytes())
    (checkout / "telepalpation").mkdir()
    (checkout / "telepalpation" / "__init__.py").write_bytes(
        (TOP / "telepalpation" / "__init__.py").read_bytes()
    )
    package = checkout / "teleop"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "software.py").write_bytes((TOP / "teleop" / "software.py").read_bytes())
    git(checkout, "add", ".")
    git(checkout, "commit", "-qm", "package")
    commit = git(checkout, "rev-parse", "--short=8", "HEAD")
    code = "from setuptools import build_meta; print(build_meta.build_wheel('out'))"
    built = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code],
        cwd=checkout,
        capture_output=True,
        text=True,
        check=True,
    )
    with zipfile.ZipFile(checkout / "out" / built.stdout.split()[-1]) as wheel:
        assert wheel.read("teleop/commit.txt").decode().strip() == commit
    assert not (package / "commit.txt").exists()
