"""Reference estimates for tests: `python tests/estimation/reference.py` writes the data file.

They were computed by the code of commit dcad2fa, before the fields of states had names. Write the
data anew only for an intended change of the numbers of an estimator, and state this in the commit.
The standard deviations of the methods of `linear_gain` on signals with uneven periods were
recomputed when the weight of a sample in the noise variance became independent of its period. All
were recomputed by the code of commit 5c285d2e when the signals were rounded. Those of the model
`stiffening` were recomputed, with equal b, k and k3, when its regressor became a product: the last
bits of a power depend on the processor.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation import METHODS, MODELS, Estimates, paper_preset

FILE = Path(__file__).parents[1] / "data" / "estimates" / "estimates.npz"
SAMPLES = 400
KEPT = {"kelvin-voigt": 25}
"""Number of samples per stored sample of an estimate, by model."""
KEPT_OTHERWISE = 100

Signals = tuple[NDArray[np.float64], ...]
"""x, v, f and dt, each of shape (n,)."""


def rounded(*signals: NDArray[np.float64]) -> Signals:
    """Round signals to multiples of 2^-40.

    The last bits of numpy's sine depend on the processor, and some estimates from the signal
    `degenerate` are so sensitive to them that they differ by 1e-7.
    """
    return tuple(np.round(signal * 2.0**40) / 2.0**40 for signal in signals)


def sequences() -> dict[str, Signals]:
    """Return the signals by name."""
    rng = np.random.default_rng(7)
    period = np.full(SAMPLES, 1e-3)
    t = np.cumsum(period)

    poke = 3e-3 * np.maximum(np.sin(2 * np.pi * 4.0 * t), 0.0)
    poke_rate = 3e-3 * 8 * np.pi * np.cos(2 * np.pi * 4.0 * t) * (poke > 0.0)
    force = (2000.0 + 1e7 * poke**2) * poke + 8.0 * poke_rate + rng.normal(0.0, 0.02, SAMPLES)
    pokes = rounded(poke, poke_rate, force, period)

    jitter = 1e-3 * (1.0 + 0.3 * rng.uniform(-1.0, 1.0, SAMPLES))
    t = np.cumsum(jitter)
    x = 5e-3 + 3e-3 * np.sin(25.0 * t)
    v = 75e-3 * np.cos(25.0 * t)
    sine = rounded(x, v, 20.0 * v + 2100.0 * x + rng.normal(0.0, 0.05, SAMPLES), jitter)

    noise = rounded(
        *(rng.normal(size=(3, SAMPLES)) * [[5e-3], [0.03], [8.0]]),
        10.0 ** rng.uniform(-4.0, -2.0, SAMPLES),
    )

    x, v, f = (signal.copy() for signal in sine[:3])
    v[:80] = f[:40] = x[:20] = 0.0  # nothing, a displacement alone, then a hold with a force
    v[120:180] = 1e-9
    x[120:180] = 5e-3
    x[200:240] = v[200:240] = 0.0
    x[260:300], v[260:300], f[260:300] = 1e-12, -1e-12, 1e-9
    x[320:340], v[320:340], f[320:340] = 3.0, -50.0, -2e4
    degenerate = (x, v, f, period)

    gaps = period.copy()
    gaps[[60, 150, 151, 280, 350]] = (0.3, 5.0, 1e-6, 800.0, 0.05)
    return {
        "pokes": pokes,
        "sine": sine,
        "noise": noise,
        "degenerate": degenerate,
        "gaps": (*sine[:3], gaps),
    }


def regressor(model: str, signals: Signals) -> NDArray[np.float64] | None:
    """Return the regressor of the model besides v and x, shape (n, 1); None if it has none."""
    x, v, f, _ = signals
    further = {
        "kelvin-voigt": None,
        "datum": np.ones_like(x),
        "inertia": np.gradient(v, 1e-3),
        "stiffening": x * x * x,
        "sls": -np.gradient(f, 1e-3),
    }[model]
    return None if further is None else further[:, np.newaxis]


def columns(estimates: Estimates) -> NDArray[np.float64]:
    """Return all columns of the estimates, shape (n, columns)."""
    further = estimates.further.values()
    return np.column_stack((*estimates[:5], *(s.value for s in further), *(s.std for s in further)))


def runs() -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield name and estimates of each estimator for each supported model and each sequence."""
    for cube in ("soft", "hard"):
        for model in MODELS.values():
            preset = replace(paper_preset(cube), model=model)
            for name, make in METHODS.items():
                if make(preset).model is not model or (cube == "hard" and name not in ("ai", "me")):
                    continue
                for sequence, signals in sequences().items():
                    estimates = make(preset).run(*signals, regressor(model.name, signals))
                    yield f"{name}/{model.name}/{cube}/{sequence}", columns(estimates)


def kept(key: str, answer: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the samples of the estimates that are stored."""
    every = KEPT.get(key.split("/")[1], KEPT_OTHERWISE)
    return answer[every - 1 :: every]


if __name__ == "__main__":
    FILE.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(FILE, **{key: kept(key, answer) for key, answer in runs()})
