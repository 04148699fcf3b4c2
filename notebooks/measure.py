"""Measure the figures that README and the documentation state, and store the output in measured.md.

    python notebooks/measure.py            # all measurements, about two hours on two idle cores
    python notebooks/measure.py curves fits

Every measurement is one command. measured.md keeps the last output of each, with its date,
processor, versions and run time. Boundary elements (`python notebooks/boundary_elements.py`) take longer
and are not repeated here.
"""

import datetime
import os
import subprocess
import sys
import time
from pathlib import Path

from error_over_time import machine

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "notebooks" / "measured.md"
HEAD = """\
# Measured figures

`python notebooks/measure.py` measures the figures that the README and the documentation state.
This page holds the output of each of its commands. Run it on an idle machine: times vary by a quarter
between runs, and by a factor of two between machines.
"""


def pytest(path, mark='""'):
    """Return the command that runs a test module and shows what it prints."""
    return f"python -m pytest -q -m {mark} -s tests/{path}"


LAW = "rubberfric/theory/area/test_law_and_boundary_elements.py"
MEASUREMENTS = {
    "curves": "python notebooks/benchmarks/curves.py",
    "parts": "python notebooks/benchmarks/parts.py",
    "tables": "python notebooks/benchmarks/tables.py",
    "first_fit": "rubberfric-fit data/tread_on_asphalt_fit.toml --no-cache",
    "fits": "python notebooks/benchmarks/fits.py",
    "ensembles": "python notebooks/benchmarks/ensembles.py",
    "laboratories": "python notebooks/benchmarks/laboratories.py",
    "twin": pytest("fitting/whole_fits/test_fit_twin.py"),
    "error_over_time": "python notebooks/error_over_time.py",
    "stability": "python notebooks/stability.py",
    "operations": "python notebooks/operations.py",
    "growth": "python notebooks/growth.py",
    "settings": "python notebooks/benchmarks/settings.py",
    "law": f"TABLE=notebooks/law_table.md {pytest(LAW, 'slow')}",
    "fits_of_boundary_elements": pytest("fitting/uncertainty/test_coverage.py", "slow"),
    "wrong_models": pytest("fitting/budget/test_wrong_models.py", "slow"),
    "molecular_dynamics": pytest("rubberfric/theory/area/test_molecular_dynamics.py"),
    "master_curves": pytest("fitting/characterise/test_public_sweeps.py"),
    "prony_series": pytest("fitting/characterise/test_public_series.py"),
    "spectra": "python notebooks/spectra.py",  # draws a picture
    "sphere": pytest("rubberfric/analysis/test_sliding_sphere.py"),
    "tyre": pytest("whole_scenes/test_tyre_friction.py"),
}


def main(names):
    """Run the measurements `names`, all if there are none, and write each section as it is done."""
    unknown = set(names) - set(MEASUREMENTS)
    if unknown:
        sys.exit(f"no measurement {', '.join(sorted(unknown))}. There are {', '.join(MEASUREMENTS)}.")
    failed = []
    for name in names or MEASUREMENTS:
        print(f"{name}: {MEASUREMENTS[name]}", flush=True)
        begin = time.perf_counter()
        done = subprocess.run(
            MEASUREMENTS[name],
            shell=True,
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        store(name, section(name, done, time.perf_counter() - begin))
        failed += [name] if done.returncode else []
    if failed:
        sys.exit(f"{', '.join(failed)} failed. measured.md has the output.")


def section(name, done, seconds):
    """Return the section of one measurement."""
    load = os.getloadavg()[1] if hasattr(os, "getloadavg") else float("nan")
    return f"""
## {name}

{datetime.date.today()}, {machine()}, mean number of running processes {load:.1f}. The command took {
        seconds:.0f} s{f" and failed with status {done.returncode}" if done.returncode else ""}.

```text
$ {MEASUREMENTS[name]}
{done.stdout.strip()}
```
"""


def store(name, text):
    """Replace one section of the page."""
    old = PAGE.read_text(encoding="utf-8").split("\n## ")[1:] if PAGE.exists() else []
    sections = {part.partition("\n")[0]: "\n## " + part for part in old} | {name: text}
    ordered = [sections[name].rstrip("\n") + "\n" for name in MEASUREMENTS if name in sections]
    PAGE.write_text(HEAD + "".join(ordered), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
