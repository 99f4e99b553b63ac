"""The check of outputs does not change symbolic links."""

from __future__ import annotations

from contextlib import suppress

import pytest

from teleop.errors import InputError
from teleop.files import check_outputs


def test_a_link_whose_target_does_not_exist_remains_after_the_check(tmp_path):
    link, target = tmp_path / "a.png", tmp_path / "b.png"
    link.symlink_to(target)
    for arguments in ({}, {"pictures": (link,)}):
        with suppress(InputError):
            check_outputs(*(() if arguments else (link,)), **arguments)
        assert link.is_symlink()
        assert not target.exists()


def test_a_link_whose_target_cannot_be_written_is_refused_and_remains(tmp_path):
    link = tmp_path / "a.png"
    link.symlink_to(tmp_path / "none" / "b.png")
    with pytest.raises(InputError):
        check_outputs(link)
    assert link.is_symlink()


def test_a_link_to_itself_is_refused(tmp_path):
    link = tmp_path / "a.png"
    link.symlink_to(link)
    with pytest.raises(InputError):
        check_outputs(link)
    assert link.is_symlink()


def test_a_link_to_another_output_is_refused(tmp_path):
    link, target = tmp_path / "a.csv", tmp_path / "b.csv"
    link.symlink_to(target)
    with pytest.raises(InputError, match="would overwrite"):
        check_outputs(target, link)


def test_two_pictures_of_the_same_name_are_refused(tmp_path):
    picture = tmp_path / "a.png"
    with pytest.raises(InputError, match="would overwrite an input or another output"):
        check_outputs(pictures=(picture, picture))
    assert not picture.exists()
