"""Each example of the gallery runs, prints what its text says, and draws its figure."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import matplotlib.pyplot as plt
import pytest

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


@pytest.fixture
def printed(tmp_path, monkeypatch, capsys):
    """Run an example; return what it printed. It draws one figure and leaves no file."""
    plt.switch_backend("agg")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plt, "show", lambda: None)

    def run(name: str) -> str:
        runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")
        assert len(plt.get_fignums()) == 1
        assert not list(tmp_path.iterdir())
        return capsys.readouterr().out

    yield run
    plt.close("all")


def test_each_example_is_run_here():
    assert all(f"test_{path.stem}" in globals() for path in EXAMPLES)


def test_first_estimate(printed):
    k, interval = re.search(
        r"rls: k = (\d+) ± (\d+) N/m", out := printed("first_estimate")
    ).groups()
    assert abs(int(k) - 2100) <= 3 * int(interval) < 30
    assert re.search(r"^rls_k +210\d\.", out, re.MULTILINE)


def test_measured_tissue(printed):
    out = printed("measured_tissue")
    found = re.findall(r"k = (\d+) N/m, b = (\d+) N s/m, misfit: (.*)", out)
    readme = [("940800", "66400"), ("980000", "23000"), ("1007800", "10400")]
    for (k, b, misfit), (batch_k, batch_b) in zip(found, readme, strict=True):
        assert int(k) == pytest.approx(int(batch_k), rel=0.01)
        assert int(b) == pytest.approx(int(batch_b), rel=0.03)
        assert misfit == "none"
    assert re.search(r"together: Kelvin-Voigt does not fit: b varies by [3-9]\d%", out)
    left = {name: float(rms) for name, rms in re.findall(r"(\S+): residual (\S+) N rms", out)}
    assert len(left) == 5
    assert left["sls"] < 0.75 * left["kelvin-voigt"]
    assert min(left, key=left.get) == "sls"


def test_which_model(printed):
    found = re.findall(r"(\S+): (\S+) mN with (\S+)", printed("which_model"))
    assert len(found) == 5
    for body, error, model in found:
        assert model == body
        assert float(error) < 50.0


def test_live_loop(printed):
    out = printed("live_loop")
    events = re.findall(r"(\S+) s: (holds|learns), (-?\d+) N/m", out)
    assert [event for _, event, _ in events] == ["holds", "learns", "holds", "learns", "holds"]
    assert [float(time) for time, *_ in events] == pytest.approx([0.0, 1.9, 5.5, 7.5, 9.7], abs=0.1)
    kalman, rls = map(int, re.search(r"kalman has (\S+) N/m, rls has (\S+) N/m", out).groups())
    assert kalman == pytest.approx(2100, rel=0.03)
    assert abs(rls) < 20


def test_swapped_cube(printed):
    found = re.findall(
        r"(\w+): within 5 % after (\S+) s; interval right (\d+)% before, (\d+)% just after, "
        r"(\d+)% later",
        printed("swapped_cube"),
    )
    assert [name for name, *_ in found][:3] == ["rls", "me", "ai"]
    for _, arrival, before, way, after in found:
        assert 0.3 < float(arrival) < 2.0
        assert int(before) > 80
        assert int(way) < 80
        assert int(after) > 80
