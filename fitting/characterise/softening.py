r"""Softening of filled rubber from a measured strain sweep (Payne effect) [J. Appl. Polym. Sci. 6 (1962) 57].

.. math:: f(\varepsilon) = E'(\varepsilon) / E'_{lin},\qquad g(\varepsilon) = E''(\varepsilon) / E''_{lin}

at one frequency. E'_lin and E''_lin are the moduli at small strains.
"""

import warnings

import numpy as np

import rubberfric as rf
from rubberfric.base import ArrayLike, shape_of, shown

# Temperatures that lie closer together belong to one sweep [K].
_SAME = 1.0
# A larger fall of E' between the first two strains gives a warning [-].
_FALLS = 0.02


def softening_from_sweep(
    strain: ArrayLike,
    storage: ArrayLike,
    loss: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    linear: float | None = None,
    factor: float = 1.0,
) -> rf.Softening | dict[float, rf.Softening]:
    r"""Fit the softening of a scene to a strain sweep at one frequency.

    `rubberfric.io.read_table(path, ["strain", "E_stor", "E_loss"], ["T"], increasing=False)` reads such a
    sweep from a file.

    Parameters
    ----------
    strain : amplitudes [-], > 0, shape (n,), in any order
        Amplitudes are half of the peak-to-peak value. For a sweep in shear give the shear amplitude, with
        G' and G'' as moduli.
    storage, loss : E' and E'' [Pa], or any other unit, > 0, shape (n,)
    temperature : temperature of each row [K], shape (n,), or a number, or None
        Rows within 1 K belong to one sweep.
    linear : largest strain of the linear range [-], or None
        The mean of f and of g up to this strain is 1. None: f = g = 1 at the smallest strain.
    factor : ratio of the strain to the rms slope of an asperity [-], passed to `Softening`

    Returns
    -------
    Softening, or, if temperatures are given, a dict of mean temperature [K] -> Softening with one item for
    each sweep, by rising temperature

    Raises
    ------
    ValueError
        Numbers have the wrong sign or shape, a sweep has fewer than two strains or no strain up to `linear`,
        or two strains are equal. If the strain rises and falls, give one direction or the mean of both. The
        message is one line.

    Warns
    -----
    UserWarning
        `linear` is None, and E' falls by more than 2 % between the first two strains. The sweep then begins
        above the linear range, and f and g are too large.

    Limits: f and g are assumed to be the same at all frequencies, and to apply to the strain of each length
    scale (`rubberfric.Softening`). They are constant outside the sweep.

    Examples
    --------
    A sweep whose first two strains are in the linear range:

    >>> softening = fitting.softening_from_sweep([1e-4, 1e-3, 1e-1], [8e6, 8e6, 3e6], [1e6, 1e6, 1.2e6])
    >>> softening.storage, softening.loss
    (Array([1.   , 1.   , 0.375], dtype=float64), Array([1. , 1. , 1.2], dtype=float64))
    """
    columns = {"strain": strain, "storage": storage, "loss": loss}
    if temperature is not None:
        columns["temperature"] = np.broadcast_to(np.asarray(temperature, float), shape_of(strain))
    columns = {name: _checked(name, values, shape_of(strain)) for name, values in columns.items()}
    if linear is not None and not (np.ndim(linear) == 0 and linear > 0):
        raise ValueError(f"linear = {shown(linear)}: must be a strain > 0, or None")
    if temperature is None:
        return _softening("", columns, linear, factor)
    factors = {}
    order = np.argsort(columns["temperature"], kind="stable")
    gaps = np.flatnonzero(np.diff(columns["temperature"][order]) > _SAME) + 1
    for rows in np.split(order, gaps):
        sweep = {name: values[rows] for name, values in columns.items()}
        mean = float(sweep.pop("temperature").mean())
        factors[mean] = _softening(f" at {mean:.6g} K", sweep, linear, factor)
    return factors


def _checked(name, values, shape):
    values = np.asarray(values, float)
    if values.ndim != 1 or values.shape != shape:
        raise ValueError(f"{name} has shape {values.shape}: must be (n,), with the length of strain")
    bad = np.flatnonzero(~(np.isfinite(values) & (values > 0)))
    if bad.size:
        raise ValueError(f"{name}[{bad[0]}] = {values[bad[0]]:g}: must be finite and > 0")
    return values


def _softening(where, sweep, linear, factor):
    order = np.argsort(sweep["strain"])
    strain, storage, loss = (sweep[name][order] for name in ("strain", "storage", "loss"))
    if strain.size < 2:
        raise ValueError(f"the sweep{where} has {strain.size} strains: must have at least 2")
    equal = np.flatnonzero(np.diff(strain) == 0)
    if equal.size:
        raise ValueError(
            f"the sweep{where} has two rows at the strain {strain[equal[0]]:g}. If the strain goes up"
            " and down, give one direction or the mean of both; for several temperatures give temperature="
        )
    if linear is None:
        fall = 1 - storage[1] / storage[0]
        if fall > _FALLS:
            warnings.warn(
                f"the sweep{where}: E' falls by {100 * fall:.1f} % between its first strains, {strain[0]:g}"
                f" and {strain[1]:g}, so the first strain is above the linear range, and f and g are too"
                " large;"
                " begin at a smaller strain",
                stacklevel=3,
            )
        first = 1
    else:
        first = int(np.sum(strain <= linear))
        if first == 0:
            raise ValueError(f"linear = {linear:g}: must be >= the smallest strain{where}, {strain[0]:g}")
    return rf.Softening(strain, storage / storage[:first].mean(), loss / loss[:first].mean(), factor)
