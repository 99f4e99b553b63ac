"""What a release needs agrees with the package, and an unreleased version has no release notes."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import telepalpation

TOP = Path(__file__).parents[1]
STATED = ("telepalpation/__init__.py", "CITATION.cff", "codemeta.json", "CHANGELOG.md")


@pytest.fixture
def released(tmp_path):
    """Returns a function that prints the release notes of 1.2.3 in a copy of the files."""
    for name in (*STATED, ".ci/release-notes"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        text = (TOP / name).read_text().replace(telepalpation.__version__, "1.2.3")
        (tmp_path / name).write_text(text)
    changes = tmp_path / "CHANGELOG.md"

    def printed(heading, change="- A change.\n"):
        changes.write_text(
            f"# Changelog\n\n## 2.0.0, unreleased\n\n{heading}\n\n{change}\n## 1.0.0\n"
        )
        asked = [sys.executable, tmp_path / ".ci" / "release-notes", "1.2.3"]
        return subprocess.run(asked, capture_output=True, text=True, check=False)

    return printed


def test_the_notes_of_a_released_version_are_its_section_of_the_changelog(released):
    assert released("## 1.2.3, 2026-12-01").stdout == "- A change.\n"


@pytest.mark.parametrize("heading", ["## 1.2.3, unreleased", "## 1.2.3", "## 1.2"])
def test_a_version_without_a_date_has_no_notes(released, heading):
    ended = released(heading)
    assert ended.returncode == 1
    assert "expected '## 1.2.3, DATE'" in ended.stderr


def test_a_tag_of_another_version_is_refused(released, tmp_path):
    path = tmp_path / "CITATION.cff"
    path.write_text(path.read_text().replace("1.2.3", "1.2.2"))
    ended = released("## 1.2.3, 2026-12-01")
    assert "CITATION.cff: version 1.2.2: expected 1.2.3" in ended.stderr


def test_the_changelog_begins_with_the_version_of_the_package():
    heading = re.search(r"^## (\S+?),", (TOP / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert telepalpation.__version__.partition(".dev")[0] == heading[1]
    unreleased = ".dev" in telepalpation.__version__
    assert unreleased == ("unreleased" in heading.string[heading.end() :].partition("\n")[0])


def test_citation_and_codemeta_state_version_and_licence_of_the_package():
    assert f"\nversion: {telepalpation.__version__}\n" in (TOP / "CITATION.cff").read_text()
    about = json.loads((TOP / "codemeta.json").read_text())
    assert about["name"] == telepalpation.NAME
    assert about["version"] == telepalpation.__version__


def test_the_development_container_is_json_and_grants_what_the_containerfile_states():
    about = json.loads((TOP / ".devcontainer" / "devcontainer.json").read_text())
    for option in ("rtprio=90", "memlock=-1"):
        assert f"--ulimit={option}" in about["runArgs"]
        assert f"--ulimit {option}" in (TOP / "Containerfile").read_text()


def test_the_paper_has_the_sections_and_the_length_that_the_journal_requires():
    _, head, text = (TOP / "paper" / "paper.md").read_text().split("---\n", 2)
    sections = re.findall(r"^# (.*)$", text, re.MULTILINE)
    assert sections == [
        "Summary",
        "Statement of need",
        "State of the field",
        "Software design",
        "Research impact statement",
        "AI usage disclosure",
        "Acknowledgements",
        "References",
    ]
    assert 750 <= len(text.split()) <= 1750
    cited = {*re.findall(r"@(\w+)", text)}
    assert cited == {*re.findall(r"^@\w+{(\w+),$", (TOP / "paper" / "paper.bib").read_text(), re.M)}
    assert "bibliography: paper.bib" in head
