"""Force feedback in virtual time: acceptance grid, bodies outside the model, and stability map.

    python benchmarks/feedback.py --part acceptance --seeds 15 --out acceptance.csv
    python benchmarks/feedback.py --part acceptance --seeds 15 --rigid --out rigid.csv
    python benchmarks/feedback.py --part bodies --seeds 2 --out bodies.csv
    python benchmarks/feedback.py --part stiffening --seeds 4 --out stiffening.csv
    python benchmarks/feedback.py --part z-width --seeds 3 --out z-width.csv
    python benchmarks/feedback.py --part map --seeds 1 --out map.csv

The acceptance grid is model-mediated feedback on three cubes, with round trips of 0 to 1 s and
three arms, a jitter of 20 ms and a loss of 5 %. The felt stiffness and force are compared with the
law of the simulated body at the position of the hand. The map finds, for position-force and each
cube, virtual damping and arm, the largest stable round trip beside the predicted one. One row per
trial is written to a CSV file, and a summary is printed.
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
from feedback_case import (
    HARD,
    JITTER,
    LOSS,
    is_permitted,
    run_one,
    settings_of,
)

from sim_backend import CUBES as CUBES_BY_NAME
from sim_backend.operators import TREMOR_AMPLITUDE

CUBES = ("soft", "medium", "hard")
ROUND_TRIPS = (0.0, 0.1, 0.2, 0.5, 1.0)
MAP_TICKS = (0, 1, 2, 3, 4, 5, 7, 10, 15, 20, 30, 40, 50, 60, 70, 77, 80, 100, 150, 250)
"""Delays of one direction of the channel in the map, in ticks."""
ARMS = (250.0, 400.0, 1500.0)
SPRINGS = (2e3, 5e3, 1e4, 2e4, 5e4, 1e5, 2e5)
"""Stiffness of the springs for the range of impedances that the hand can feel [N/m]."""
DAMPINGS = (15.0, 50.0, 200.0)
TREMORS = (0.0, TREMOR_AMPLITUDE)
"""Amplitudes of the tremor of the hand in the map [m]. Equation (1) describes the loop, not the
tremor that the loop amplifies."""
MOST_K, MOST_FORCE = 0.1, 0.15
"""Errors of felt stiffness and felt force that are permitted in the summary."""
Row = dict[str, Any]


def acceptance(seeds: range, rigid: bool) -> Iterator[Row]:
    """Yield the trials of the acceptance grid, the whole grid for each seed in turn."""
    for seed, cube, trip, arm in itertools.product(seeds, CUBES, ROUND_TRIPS, ARMS):
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


def bodies(seeds: range, rigid: bool) -> Iterator[Row]:
    """Yield the trials on bodies that the local model does not describe, or that change."""
    swaps = [f"{a} to {b}" for a, b in itertools.permutations(CUBES, 2)]
    softer = [f"{a} while indented to {b}" for a, b in itertools.combinations(CUBES[::-1], 2)]
    cases = [(body, body.split()[0]) for body in (*swaps, *softer)]
    cases += [(body, cube) for body in ("loose", "relaxing") for cube in CUBES]
    cases += [("inclusion", "soft"), ("hunt-crossley", "soft")]
    for seed, (body, cube), trip in itertools.product(seeds, cases, (0.0, 0.2)):
        yield channelled(
            "model-mediated", cube, trip, body=body, seed=seed, rigid=rigid, duration=12.0
        )


def stiffening(seeds: range, rigid: bool) -> Iterator[Row]:
    """Yield the trials on bodies that become stiffer while they are indented."""
    for seed, (before, after), trip in itertools.product(
        seeds, itertools.combinations(CUBES, 2), (0.0, 0.2)
    ):
        body = f"{before} while indented to {after}"
        yield channelled("model-mediated", before, trip, body=body, seed=seed, rigid=rigid)


def z_width(seeds: range, rigid: bool) -> Iterator[Row]:
    """Yield trials on springs of increasing stiffness, for the stiffest one that the hand feels."""
    laws = {"position-force": 50.0, "model-mediated": 15.0}
    for seed, law, k, arm in itertools.product(seeds, laws, SPRINGS, ARMS):
        case = {"law": law, "cube": "soft", "round_trip": 0.0, "body": f"spring {k:g}"}
        yield case | {"damping": laws[law], "arm": arm, "seed": seed, "rigid": rigid}


MAP_ROUND_TRIPS = [2e-3 * ticks for ticks in MAP_TICKS]
"""Round trips of the map, in increasing order [s]."""


def stability_map(seeds: range, rigid: bool) -> Iterator[Row]:
    """Yield the cases of the map of position-force, with the first round trip of each case.

    The first round trip is the longest of the map that the check before a trial permits; 0 if it
    permits none.
    """
    grid = itertools.product(TREMORS, CUBES, DAMPINGS, ARMS, seeds)
    for tremor, cube, damping, arm, seed in grid:
        case = {"law": "position-force", "cube": cube, "damping": damping, "arm": arm}
        case |= {"rigid": rigid}
        permitted = [
            trip for trip in MAP_ROUND_TRIPS if is_permitted(settings_of(**case, round_trip=trip))
        ]
        first = max(permitted, default=0.0)
        row = {"permitted": first if permitted else -1.0, "tremor": tremor, "seed": seed}
        yield case | {"round_trip": first} | row


def run_to_boundary(case: Row) -> list[Row]:
    """Run trials with other round trips until one is stable and the next longer one is not."""
    trips = MAP_ROUND_TRIPS
    first = trips.index(case["round_trip"])
    row = run_one(case)
    rows = [row]
    unstable = not row["stable"]
    for trip in trips[:first][::-1] if unstable else trips[first + 1 :]:
        rows.append(run_one(case | {"round_trip": trip}))
        if rows[-1]["stable"] == unstable:
            break
    return sorted(rows, key=lambda row: row["round_trip"])


def run_single(case: Row) -> list[Row]:
    return [run_one(case)]


PARTS = {
    "acceptance": acceptance,
    "bodies": bodies,
    "stiffening": stiffening,
    "map": stability_map,
    "z-width": z_width,
}
KEYS = {
    "acceptance": ("cube", "round_trip"),
    "bodies": ("body", "cube", "round_trip"),
    "stiffening": ("body", "round_trip"),
    "z-width": ("law", "body"),
    "map": ("tremor", "cube", "damping", "arm", "round_trip"),
}
"""Arguments by which the summary groups the trials of a part."""


def summarise(rows: list[Row], keys: Iterable[str]) -> None:
    """Print one line for each group of trials: medians and worst values."""
    print(
        f"{'case':<38}{'stable':>8}{'k error: median, worst':>23}{'force error':>16}"
        f"{'within':>9}{'felt b':>8}{'shakes':>9}{'energy':>10}{'F/Fs':>6}{'F/Fh':>6}  stops"
    )
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[key] for key in keys), []).append(row)
    for group, found in groups.items():
        stops = sorted({row["fault"] for row in found if row["fault"]})
        case = ", ".join(str(value) for value in group)
        k, force = column(found, "true_k_error"), column(found, "true_force_error")
        if not np.isfinite(k).any() and " to " not in found[0].get("body", ""):
            k, force = column(found, "rendered_k_error"), column(found, "felt_force_error")
        within = np.mean((k < MOST_K) & (force < MOST_FORCE))
        ratio = felt_damping(found)
        print(
            f"{case:<38}{sum(row['stable'] for row in found):>4}/{len(found):<3}"
            f"{middle(k):>14.1%},{worst(k):>7.1%}"
            f"{middle(force):>8.1%},{worst(force):>6.1%}{within:>9.0%}{ratio:>8.2f}"
            f"{worst(column(found, 'shaking_um')):>6.0f} um"
            f"{min(row['energy_min_j'] for row in found) * 1e3:>7.1f} mJ"
            f"{max(row['force_of_soft_limit'] for row in found):>6.2f}"
            f"{max(row['force_of_hard_limit'] for row in found):>6.2f}  {', '.join(stops)}"
        )
    k, force = column(rows, "true_k_error"), column(rows, "true_force_error")
    print(
        f"felt k within {MOST_K:.0%} and felt force within {MOST_FORCE:.0%} of the tissue: "
        f"{np.mean((k < MOST_K) & (force < MOST_FORCE)):.1%} of all trials"
    )


def middle(values: np.ndarray) -> float:
    """Return the median of the finite values; NaN if there is none."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else float("nan")


def worst(values: np.ndarray) -> float:
    """Return the largest of the finite values; NaN if there is none."""
    known = values[np.isfinite(values)]
    return float(np.max(known)) if len(known) else float("nan")


def felt_damping(rows: list[Row]) -> float:
    """Return the median ratio of felt damping and that of the tissue; NaN if the body changes."""
    if " to " in rows[0].get("body", ""):
        return float("nan")
    return float(np.nanmedian(column(rows, "rendered_b") / column(rows, "tissue_b")))


def column(rows: list[Row], name: str) -> np.ndarray:
    """Return the magnitude of a value of each row; NaN where it is missing."""
    return np.abs(np.array([row[name] for row in rows], dtype=float))


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
        f"\nlargest stable round trip at 1000 Hz, {hand}: {len(rows)} trials, "
        f"number of seeds: {seeds}, {unstable_text(rows, '')}"
    )
    print(
        f"{'cube':<8}{'d [N s/m]':>10}{'arm [N/m]':>11}{'stable to [ms]':>16}{'unstable from':>15}"
        f"{'permitted':>11}{'condition (2)':>15}{'equation (1)':>14}"
    )
    for case in dict.fromkeys((row["cube"], row["damping"], row["arm"]) for row in rows):
        found = [row for row in rows if (row["cube"], row["damping"], row["arm"]) == case]
        bad = [row["round_trip"] for row in found if not row["stable"]]
        first = min(bad, default=float("inf"))
        last = max((row["round_trip"] for row in found if row["round_trip"] < first), default=-1.0)
        safe, largest = found[0]["safe_round_trip"], found[0]["largest_round_trip"]
        permitted = found[0]["permitted"]
        cube, damping, arm = case
        print(
            f"{cube:<8}{damping:>10g}{arm:>11g}{f'{last * 1e3:g}' if last >= 0.0 else 'none':>16}"
            f"{first * 1e3:>15g}{f'{permitted * 1e3:g}' if permitted >= 0.0 else 'none':>11}"
            f"{safe * 1e3:>15.1f}"
            f"{largest * 1e3:>14.1f}"
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
    parser.add_argument("--first-seed", type=int, default=0)
    options = parser.parse_args()
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    cases = [
        case for case in PARTS[options.part](seeds, options.rigid) if case["cube"] in options.cubes
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
    print(
        f"{options.part}, {len(rows)} trials, seeds {seeds[0]} to {seeds[-1]}, "
        f"{'rigid transmission' if options.rigid else 'default rig'}"
    )
    summarise(rows, KEYS[options.part])
    print(unstable_text(rows, " trials"))
    if options.part == "map":
        for tremor in TREMORS:
            summarise_map([row for row in rows if row["tremor"] == tremor], tremor)
    if options.part == "stiffening":
        summarise_stops(rows)


if __name__ == "__main__":
    main()
