"""The scripts in `docs/_ext` that a person runs: pictures of the live page, and clipped blocks."""

from __future__ import annotations

import importlib.util
import io
import shutil
import sys
from pathlib import Path

import pytest

pytest.importorskip("playwright.sync_api", reason="needs playwright")
from PIL import Image

SCRIPTS = Path(__file__).parents[1] / "docs" / "_ext"
PAGE = """<!doctype html><style>pre {{ overflow-x: auto; font: 16px monospace; }}</style>
<article class="bd-article"><pre>{}</pre></article>"""


def script(name):
    """Return a script as a module."""
    spec = importlib.util.spec_from_file_location(name, SCRIPTS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.real_time
def test_a_code_block_that_is_wider_than_its_box_is_listed_and_fails(tmp_path, monkeypatch, capsys):
    clipped_blocks = script("clipped_blocks")
    if not any(map(shutil.which, clipped_blocks.BROWSERS)):
        pytest.skip("needs a browser")
    (tmp_path / "short.html").write_text(PAGE.format("x = 1"))
    (tmp_path / "long.html").write_text(PAGE.format("a long line " * 8))
    monkeypatch.setattr(sys, "argv", ["clipped_blocks", str(tmp_path), "390", "1920"])
    assert clipped_blocks.main() == 1
    first, *others = capsys.readouterr().out.splitlines()
    assert first.startswith("390 long pre ")
    assert others == [
        "390 pixels, pre: 1 of 2 clipped",
        "390 pixels, table: 0 of 0 clipped",
        "1920 pixels, pre: 0 of 2 clipped",
        "1920 pixels, table: 0 of 0 clipped",
    ]
    (tmp_path / "long.html").unlink()
    assert clipped_blocks.main() == 0


def shot(level):
    """Return a picture of one grey level, as the browser sends it."""
    file = io.BytesIO()
    Image.new("RGB", (128, 72), (level,) * 3).save(file, "png")
    return file.getvalue()


def test_an_animation_has_the_newest_frame_of_each_period_and_no_long_standstill():
    pictures = script("live_pictures")
    frames = [(0.00, shot(10)), (0.06, shot(20)), (0.09, shot(30)), (0.21, shot(40))]
    frames.append((3.01, shot(50)))
    made = pictures.regular(frames)
    levels = [one.getpixel((0, 0))[0] for one in made]
    assert levels[:3] == [10, 30, 30]
    assert levels[3:] == [40] * pictures.STANDSTILL  # 2.8 s would be 28 equal frames
    assert {one.size for one in made} == {(960, 540)}


def test_an_animation_that_is_too_large_is_written_with_a_lower_quality(tmp_path, monkeypatch):
    pictures = script("live_pictures")
    frames = [Image.effect_noise((96, 54), 40.0 + i).convert("RGB") for i in range(3)]
    path = tmp_path / "live.webp"
    pictures.write_animation(frames, path)
    best = path.stat().st_size
    monkeypatch.setattr(pictures, "LARGEST", best)
    pictures.write_animation(frames, path)
    assert path.stat().st_size < best
    with Image.open(path) as written:
        assert written.n_frames == 3
    monkeypatch.setattr(pictures, "LARGEST", 100)
    with pytest.raises(ValueError, match="is larger than 100 bytes"):
        pictures.write_animation(frames, path)
