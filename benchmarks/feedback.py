"""Force feedback in virtual time: acceptance grid, bodies outside the model, and stability map.

    python benchmarks/feedback.py --part acceptance --seeds 20 --rigid --out acceptance.csv
    python benchmarks/feedback.py --part acceptance --seeds 1 --out lost-motion.csv
    python benchmarks/feedback.py --part bodies --seeds 2 --rigid --out bodies.csv
    python benchmarks/feedback.py --part map --seeds 3 --rigid --out map.csv
    python benchmarks/feedback.py --part passivity --seeds 20 --cubes soft --out passivity.csv

The acceptance grid is model-mediated feedback on three cubes, with round trips of 0 to 500 ms and
three arms, a jitter of 20 ms and a loss of 5 %. The map finds, for position-force and each cube,
virtual damping and arm, the largest stable round trip beside the predicted one. One row per trial
is written to a CSV file, and a summary is printed. `least` is the error of the force of the best
model, fitted afterwards.
"""

from __future__ import annotations

import argparse
import csv
import itertools
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from feedback_case import HARD, JITTER, LOSS, run_one, settings_of

from sim_backend import CUBES as CUBES_BY_NAME
from sim_backend.operators import TREMOR_AMPLITUDE
from teleop.trial.feedback_checks import delayed_loop, lag

CUBES = ("soft", "medium", "hard")
ROUND_TRIPS = (0.0, 0.05, 0.1, 0.2, 0.5)
PASSIVITY_ROUND_TRIPS = (0.0, 0.02, 0.05, 0.1, 0.2, 0.5)
MAP_ROUND_TRIPS = tuple(
    1e-3 * ms
    for ms in (0, 2, 4, 6, 8, 10, 14, 20, 30, 40, 60, 80, 100, 120, 140, 154, 160, 200, 300, 500)
)
"""Even numbers of milliseconds, because each of the two directions delays by whole ticks [s]."""
ARMS = (150.0, 400.0, 1500.0)
DAMPINGS = (15.0, 50.0, 200.0)
TREMORS = (0.0, TREMOR_AMPLITUDE)
"""Amplitudes of the tremor of the hand in the map [m]. Equation (1) describes the loop, not the
tremor that the loop amplifies."""
INSTANTS = 10
"""Number of trials on a body that changes while it is indented, each at another time of a poke."""
Row = dict[str, Any]


def acceptance(seeds: int, rigid: bool) -> Iterator[Row]:
    """Yield the trials of the acceptance grid, the whole grid for each seed in turn."""
    for seed, cube, trip, arm in itertools.product(range(seeds), CUBES, ROUND_TRIPS, ARMS):
        yield channelled("model-mediated", cube, trip, arm=arm, seed=seed, rigid=rigid)


def channelled(law: str, cube: str, trip: float, **more: Any) -> Row:
    return {
        "law": law,
        "cube": cube,
        "round_trip": trip,
        "jitter": JITTER if trip else 0.0,
        "loss": LOSS if trip else 0.0,
        **more,
    }


def bodies(seeds: int, rigid: bool) -> Iterator[Row]:
    """Yield the trials on bodies that the local model does not describe."""
    cases = (
        ("relaxing", CUBES),
        ("loose", CUBES),
        ("stiffer at the next contact", ("soft", "medium")),
        ("stiffer while indented", ("soft", "medium")),
    )
    for body, cubes in cases:
        number = INSTANTS if body == "stiffer while indented" else seeds
        for cube, trip, seed in itertools.product(cubes, (0.0, 0.2), range(number)):
            yield channelled("model-mediated", cube, trip, body=body, seed=seed, rigid=rigid)


def stability_map(seeds: int, rigid: bool) -> Iterator[Row]:
    """Yield the cases of the map of position-force, with the first round trip of each case.

    The first round trip is the largest of `MAP_ROUND_TRIPS` for which condition (2) of
    `teleop.control.feedback.stability` holds.
    """
    grid = itertools.product(TREMORS, CUBES, DAMPINGS, ARMS, range(seeds))
    for tremor, cube, damping, arm, seed in grid:
        case = {"law": "position-force", "cube": cube, "damping": damping, "arm": arm}
        settings = settings_of(**case, round_trip=0.0)
        safe = delayed_loop(settings).safe_delay - lag(settings)
        first = max(trip for trip in MAP_ROUND_TRIPS if trip <= max(safe, 0.0))
        yield case | {"round_trip": first, "tremor": tremor, "seed": seed, "rigid": rigid}


def run_to_boundary(case: Row) -> list[Row]:
    """Run trials with other round trips until one is stable and the next longer one is not."""
    first = MAP_ROUND_TRIPS.index(case["round_trip"])
    row = run_one(case)
    rows = [row]
    if row["stable"]:
        trips, unstable = MAP_ROUND_TRIPS[first + 1 :], False
    else:
        trips, unstable = MAP_ROUND_TRIPS[:first][::-1], True
    for trip in trips:
        rows.append(run_one(case | {"round_trip": trip}))
        if rows[-1]["stable"] == unstable:
            break
    return sorted(rows, key=lambda row: row["round_trip"])


def run_single(case: Row) -> list[Row]:
    return [run_one(case)]


def passivity(seeds: int, rigid: bool) -> Iterator[Row]:
    """Yield the trials with passivity control."""
    grid = itertools.product(CUBES, PASSIVITY_ROUND_TRIPS, ("force", "depth"), ARMS, range(seeds))
    for cube, trip, operator, arm, seed in grid:
        case = {"law": "passivity", "cube": cube, "round_trip": trip, "operator": operator}
        yield case | {"arm": arm, "seed": seed, "rigid": rigid}


PARTS = {
    "acceptance": acceptance,
    "bodies": bodies,
    "map": stability_map,
    "passivity": passivity,
}
KEYS = {
    "acceptance": ("cube", "round_trip"),
    "bodies": ("body", "cube", "round_trip"),
    "map": ("tremor", "cube", "damping", "arm", "round_trip"),
    "passivity": ("cube", "round_trip", "operator", "arm"),
}
"""Arguments by which the summary groups the trials of a part."""


def summarise(rows: list[Row], keys: Iterable[str]) -> None:
    """Print one line for each group of trials: the worst value of each quantity."""
    print(
        f"{'case':<44}{'stable':>8}{'k error':>9}{'force':>8}{'least':>8}{'energy':>10}"
        f"{'soft':>7}{'hard':>7}{'model':>8}  stops"
    )
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[key] for key in keys), []).append(row)
    for group, found in groups.items():

        def worst(name: str, rows: list[Row] = found) -> float:
            values = np.array([row[name] for row in rows], dtype=float)
            return float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))

        stops = sorted({row["fault"] for row in found if row["fault"]})
        case = ", ".join(str(value) for value in group)
        print(
            f"{case:<44}{sum(row['stable'] for row in found):>4}/{len(found):<3}"
            f"{worst('rendered_k_error'):>8.1%}{worst('felt_force_error'):>8.1%}"
            f"{worst('least_force_error'):>8.1%}"
            f"{min(row['energy_min_j'] for row in found) * 1e3:>7.1f} mJ"
            f"{worst('force_of_soft_limit'):>7.2f}{worst('force_of_hard_limit'):>7.2f}"
            f"{worst('converged_s'):>6.1f} s  {', '.join(stops)}"
        )


def summarise_stops(rows: list[Row]) -> None:
    """Print how far the slave moved into the body after each stop by the force limit."""
    stops = [row for row in rows if row["fault"]]
    print("\nstops: advance of the slave into the body, its stopping distance, static force there")
    print(
        f"{'case':<44}{'seed':>5}{'speed':>12}{'advance':>10}{'distance':>10}"
        f"{'force':>9}{'greatest':>10}"
    )
    for row in stops:
        case = ", ".join(str(row[key]) for key in KEYS["bodies"])
        print(
            f"{case:<44}{row['seed']:>5}{row['stop_speed'] * 1e3:>7.1f} mm/s"
            f"{row['advance'] * 1e6:>7.0f} um{row['stopping_distance'] * 1e6:>7.0f} um"
            f"{CUBES_BY_NAME['hard'].force(row['stop_position'], 0.0):>7.0f} N"
            f"{row['force_of_hard_limit'] * HARD:>8.0f} N"
        )


def unstable_text(rows: list[Row], noun: str) -> str:
    """Return the number of unstable trials, and of those that no stop has ended."""
    faults = [row["fault"] for row in rows if not row["stable"]]
    return f"{len(faults)}{noun} not stable, of which {faults.count('')} ended without a stop"


def summarise_map(rows: list[Row], tremor: float) -> None:
    """Print the measured and the predicted largest round trip for each cube, damping and arm."""
    seeds = len({row["seed"] for row in rows})
    hand = f"tremor of {tremor * 1e3:g} mm" if tremor else "no tremor"
    print(
        f"\nlargest stable round trip, {hand}: {len(rows)} trials, number of seeds: {seeds}, "
        + unstable_text(rows, "")
    )
    print(
        f"{'cube':<8}{'d [N s/m]':>10}{'arm [N/m]':>11}{'stable to [ms]':>16}{'unstable from':>15}"
        f"{'condition (2)':>15}{'equation (1)':>14}"
    )
    for case in dict.fromkeys((row["cube"], row["damping"], row["arm"]) for row in rows):
        found = [row for row in rows if (row["cube"], row["damping"], row["arm"]) == case]
        bad = [row["round_trip"] for row in found if not row["stable"]]
        first = min(bad, default=float("inf"))
        good = [row["round_trip"] for row in found if row["round_trip"] < first]
        safe, largest = found[0]["safe_round_trip"], found[0]["largest_round_trip"]
        last = f"{max(good) * 1e3:.0f}" if good else "none"
        cube, damping, arm = case
        print(
            f"{cube:<8}{damping:>10g}{arm:>11g}{last:>16}{first * 1e3:>15.0f}"
            f"{safe * 1e3:>15.1f}{largest * 1e3:>14.1f}"
        )


def write(rows: list[Row], file: TextIO, header: bool) -> None:
    """Append rows to a CSV file."""
    writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
    if header:
        writer.writeheader()
    for row in rows:
        writer.writerow({k: f"{v:.5g}" if isinstance(v, float) else v for k, v in row.items()})
    file.flush()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--part", choices=sorted(PARTS), required=True)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--rigid", action="store_true", help="a transmission without lost motion")
    parser.add_argument("--cubes", nargs="*", choices=CUBES, default=CUBES)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--processes", type=int, default=1)
    options = parser.parse_args()
    cases = [
        case
        for case in PARTS[options.part](options.seeds, options.rigid)
        if case["cube"] in options.cubes
    ]
    run = run_to_boundary if options.part == "map" else run_single
    with ExitStack() as stack:
        pool = stack.enter_context(ProcessPoolExecutor(options.processes))
        file = stack.enter_context(options.out.open("w", newline="")) if options.out else None
        rows = []
        for found in pool.map(run, cases, chunksize=1):
            if file:
                write(found, file, header=not rows)
            rows += found
    print(f"{options.part}, {len(rows)} trials, rigid transmission: {options.rigid}")
    summarise(rows, KEYS[options.part])
    print(unstable_text(rows, " trials"))
    if options.part == "map":
        for tremor in TREMORS:
            summarise_map([row for row in rows if row["tremor"] == tremor], tremor)
    if options.part == "bodies":
        summarise_stops(rows)


if __name__ == "__main__":
    main()
