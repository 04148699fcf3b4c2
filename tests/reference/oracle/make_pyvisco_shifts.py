"""Writes pyvisco_shifts.json: log10 a_T that pyvisco fits to the public sweeps.

    python tests/reference/oracle/make_pyvisco_shifts.py      (needs pyvisco; not rubberfric)

RUBBERFRIC_PUBLISHED names a folder with the sets that are not in the project.

pyvisco shifts E' alone: power laws through neighbouring sweeps are brought to overlap
[https://github.com/NREL/pyvisco]. A set that pyvisco refuses is stored as its error message.
"""

import io
import json
from importlib.metadata import version

import numpy as np
import pyvisco
from support.public_sweeps import NAMES, columns_of
from support.published import PUBLISHED


def shifts_of(name):
    """Return the temperatures of the sweeps [degrees Celsius] and log10 a_T, or None for NaN."""
    omega, storage, loss, T, _ = columns_of(name)
    order = np.lexsort((omega, T))
    sets = np.concatenate([[0], np.cumsum(np.diff(T[order]) > 1.0)])
    rows = np.stack([omega / (2 * np.pi), storage, loss, T], axis=1)[order]
    file = io.StringIO("f,E_stor,E_loss,T,Set\nHz,MPa,MPa,C,-\n")
    file.seek(0, io.SEEK_END)
    np.savetxt(file, np.column_stack([rows, sets]), delimiter=",", fmt=4 * ["%.17g"] + ["%d"])
    frame, rounded, _ = pyvisco.load.user_raw(file.getvalue().encode(), "freq", "E")
    found, _ = pyvisco.master.get_aT(frame, rounded.iloc[len(rounded) // 2])
    means = [float(T[order][sets == i].mean()) for i in range(len(rounded))]
    return {"T": means, "log10_aT": [x if np.isfinite(x) else None for x in found["log_aT"].tolist()]}


def main():
    result = {"pyvisco": version("pyvisco")}
    for name in NAMES:
        try:
            result[name] = shifts_of(name)
        except Exception as error:
            result[name] = {"refused": f"{type(error).__name__}: {error}"}
        print(name, result[name])
    (PUBLISHED / "pyvisco_shifts.json").write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
