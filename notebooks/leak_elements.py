"""Compute the flow through gaps of boundary elements; append the results to leak_elements.csv.

    python notebooks/leak_elements.py [--part new] [--seconds 500]    # continue

Each row is one surface under one pressure, with q1 = 1 1/m, rms slope 1 and E / (1 - nu^2) = 1 Pa, on a
period of eight longest wavelengths. The flow is solved for both directions with harmonic and with arithmetic
means of the cubed gap between cells (`tests/support/oracles/reynolds_flow.py`). Its discretisation error is
about half the difference of the two. The form of the theory was chosen on the rows with `part` "choice". The
rows with `part` "new" were computed afterwards. All rows take 15 minutes on one core.
"""

import argparse
import csv
import itertools
import sys
import time
import warnings
from pathlib import Path

import jax
import numpy as np

import rubberfric as rf
from rubberfric.analysis import boundary_element

FOLDER = Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER.parent / "tests"))

from support.oracles.reynolds_flow import flow_tensor  # noqa: E402

TABLE = FOLDER / "leak_elements.csv"
PERIODS = 8
TOLERANCE = 1e-4
INPUTS = ("part", "ratio", "rolloff", "hurst", "grid", "key", "pressure")
FLOWS = tuple(f"{faces}_{axis}" for faces in ("harmonic", "arithmetic") for axis in "xy")
COLUMNS = (*INPUTS, "area", "separation", *FLOWS)


def cases():
    """Yield the inputs of all rows."""
    shapes = itertools.product(((5, 1), (10, 1), (16, 1), (16, 4)), (0.4, 0.8))
    for (ratio, rolloff), hurst in shapes:
        if rolloff == 1 or hurst == 0.8:
            for k, pressure in enumerate((0.0225, 0.05, 0.08, 0.12, 0.165)):
                yield "choice", ratio, rolloff, hurst, 512, 100 + k, pressure
    loads = (0.0225, 0.052, 0.085, 0.12, 0.165)
    shapes = itertools.product(((6, 1), (8, 1), (16, 1), (16, 3)), (0.5, 0.7, 0.9))
    for i, ((ratio, rolloff), hurst) in enumerate(shapes):
        for k, pressure in enumerate(loads):
            yield "new", ratio, rolloff, hurst, 512, 1000 + 10 * i + k, pressure
    for k, pressure in enumerate(loads):
        yield "new", 32, 1, 0.7, 1024, 2000 + k, pressure


def scene_of(ratio, rolloff, hurst):
    """Return a scene of rms slope 1, q1 = 1 and E / (1 - nu^2) = 1."""
    spectrum = rf.SelfAffine(1 / ratio, rolloff / ratio, 1.0, hurst, 1.0)
    spectrum = spectrum.replace(h_rms=1 / float(rf.rms_slope(spectrum)))
    return rf.Scene(rf.Body(rf.Rigid(), spectrum), rf.Body(rf.Elastic(1.0, 0.0)))


def computed(part, ratio, rolloff, hurst, grid, key, pressure):
    """Return a row of the table."""
    inputs = dict(zip(INPUTS, (part, ratio, rolloff, hurst, grid, key, pressure), strict=True))
    contact = boundary_element(
        scene_of(ratio, rolloff, hurst),
        0.0,
        pressure,
        jax.random.key(key),
        grid=grid,
        periods=PERIODS,
        tolerance=TOLERANCE,
    )
    flows = [np.diag(flow_tensor(contact.gap, faces)) for faces in ("harmonic", "arithmetic")]
    values = (contact.area, contact.separation, *np.ravel(flows))
    return inputs | {name: f"{value:.5g}" for name, value in zip(COLUMNS[7:], values, strict=True)}


def main():
    """Append rows until all are there or the time is over."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--part", choices=["choice", "new"], help="compute the rows of this part only")
    parser.add_argument("--seconds", type=float, default=np.inf, help="begin no row after this time")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    warnings.simplefilter("ignore", rf.UnitWarning)
    there = set()
    if TABLE.exists():
        with TABLE.open(newline="") as file:
            there = {tuple(row[name] for name in INPUTS) for row in csv.DictReader(file)}
    else:
        TABLE.write_text(",".join(COLUMNS) + "\n")
    begin = time.monotonic()
    for case in cases():
        wanted = options.part in (None, case[0]) and tuple(map(str, case)) not in there
        if wanted and time.monotonic() - begin < options.seconds:
            row = computed(*case)
            with TABLE.open("a", newline="") as file:
                csv.DictWriter(file, COLUMNS, lineterminator="\n").writerow(row)
            print(row, flush=True)


if __name__ == "__main__":
    main()
