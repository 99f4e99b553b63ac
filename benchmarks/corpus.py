"""Check the results on records of known truth: `python benchmarks/corpus.py [--records 20]`.

For each kind of record, four values are printed: how often the 95 % interval of k contains the true
k, how often the interval of b contains the true b, how wide the interval of k is, and how many
results are "silent wrong". A result is silent wrong if k is wrong by more than 10 % and no reason
is given. For records from which no stiffness can be computed, a reason must be given, and no
stiffness. The aim is that 90 to 98 % of the intervals of 500 records contain the true value.

Seeds below 61000 were used in development. The option `--first` selects other seeds.
"""

from __future__ import annotations

import argparse
import zlib
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np

from estimation.testing_records import COVERAGE_KINDS, WITHOUT_STIFFNESS
from teleop.evaluation.batch.analysis import analyse
from teleop.evaluation.batch.stiffness_result import StiffnessResult
from teleop.evaluation.reading.signals import Signals, periods

KINDS = {**COVERAGE_KINDS, **WITHOUT_STIFFNESS}
WRONG = 0.1


def answer(kind: str, seed: int) -> tuple[float, float, StiffnessResult]:
    record = KINDS[kind](np.random.default_rng([zlib.crc32(kind.encode()), seed]))
    signals = Signals(record.t, record.x, record.f, periods(record.t), "position")
    return record.k, record.b, analyse(signals).result


def row(kind: str, answers: list[tuple[float, float, StiffnessResult]]) -> str:
    given = [(k, b, r) for k, b, r in answers if r.identifiable]
    without = len(answers) - len(given)
    unexplained = sum(not r.identifiable and not r.reasons for *_, r in answers)
    if kind in WITHOUT_STIFFNESS:
        silent = len(given) + unexplained
        return f"{kind:22} {len(answers):7} {without:6} {'-':>8} {'-':>8} {'-':>9} {silent:7}"
    inside = np.mean([r.k_low <= k <= r.k_high for k, _, r in given])
    damping = [r.b_low <= b <= r.b_high for _, b, r in given if np.isfinite(b)]
    width = np.median([(r.k_high - r.k_low) / (2.0 * k) for k, _, r in given])
    silent = unexplained + sum(
        not r.k_low <= k <= r.k_high and abs(r.k / k - 1.0) > WRONG and not r.reasons
        for k, _, r in given
    )
    b_text = f"{np.mean(damping):8.1%}" if damping else f"{'-':>8}"
    return f"{kind:22} {len(answers):7} {without:6} {inside:8.1%} {b_text} {width:9.2%} {silent:7}"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--records", type=int, default=20)
    parser.add_argument("--first", type=int, default=0, help="seed of the first record")
    parser.add_argument("--jobs", type=int, default=2, help="number of processes")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.records)
    print("kind                   records   no k  k within b within half of k silent wrong")
    with ProcessPoolExecutor(options.jobs) as pool:
        for kind in KINDS:
            answers = list(pool.map(partial(answer, kind), seeds, chunksize=4))
            print(row(kind, answers), flush=True)


if __name__ == "__main__":
    main()
