r"""Cards at one temperature, and rows of moduli over temperature for a vertical shift.

.. math:: E(\omega, T) = b_T\, E(a_T \omega, T_\mathrm{ref})

Abaqus and ANSYS interpolate the moduli of a material linearly between temperatures and multiply them by the
Prony weights, so that rows of b_T E represent a vertical shift.
"""

import math

import numpy as np

from rubberfric.base.checks import NumberLike, as_leaf, shown
from rubberfric.io.cards.text import need
from rubberfric.materials.prony import Prony, PronyShear
from rubberfric.materials.shifts import TabulatedVertical, log_factors, log_vertical

# Programs whose cards hold moduli at several temperatures.
_ROWS = ("abaqus", "ansys")
# Largest relative error of b_T between rows over temperature.
_ROW_ERROR = 1e-4
# Temperatures in one evaluation of a law. JAX compiles each length once.
_BLOCK = 256
# Number of rows above which they are not made finer.
_MOST_ROWS = 1000


def at_temperature(material: object, temperature: NumberLike) -> object:
    """Return the material at a temperature [K], without its shift. Raise ValueError if it has none."""
    law = getattr(material, "shift", None)
    if not isinstance(material, Prony | PronyShear) or law is None:
        raise ValueError(f"temperature = {shown(temperature)}: must not be given; the material has no shift")
    law.check_temperature(temperature)
    times = np.asarray(material.tau, float) * math.exp(float(log_factors(law, temperature)))
    log_b = log_vertical(law, temperature)
    scale = 1.0 if log_b is None else math.exp(float(log_b))
    if isinstance(material, PronyShear):
        return material.replace(tau=times, shift=None)
    rest, weights = float(material.E_inf) * scale, np.asarray(material.E, float) * scale
    return material.replace(E_inf=rest, E=weights, tau=times, shift=None)


def rows_of(
    material: object, program: str, temperature: NumberLike | None, bulk: float | None, zero: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return temperatures in the unit of the file and b_T for the rows of cards, or None without b_T.

    Parameters
    ----------
    material, program, temperature, bulk : as for `rubberfric.io.write_prony`
    zero : zero of the temperature scale of the file [K]
    """
    law = getattr(material, "shift", None)
    vertical = None if law is None else law.vertical
    if law is None or vertical is None:
        message = "must not be given; the material has no vertical shift, and shift is True"
        need(temperature is None, f"temperature = {shown(temperature)}: {message}")
        return None
    kind = type(vertical).__name__
    need(
        program in _ROWS,
        f"material.shift.vertical = {kind}: must be None for {program}; shift=False leaves out the whole"
        " shift, for cards at one temperature",
    )
    message = f"bulk = {bulk}: must be None with the vertical shift {kind}, which does not change B"
    need(bulk is None, f"{message}; give the material a Poisson's ratio such as 0.499")
    nodes = np.asarray(vertical.T, float) if isinstance(vertical, TabulatedVertical) else np.zeros(0)
    if temperature is None:
        message = f"temperature is missing: must be (lowest, highest) [K] for the vertical shift {kind}"
        need(nodes.size, message)
        ends = nodes[[0, -1]]
    else:
        ends = np.asarray(as_leaf("temperature", temperature, 1), float)
        fits = ends.size == 2 and 0 < ends[0] < ends[1]
        need(fits, f"temperature = {shown(temperature)}: must be (lowest, highest) [K], in this order")
        law.check_temperature(ends)
    T_ref = float(law.reference_temperature)
    inside = ends[0] <= T_ref <= ends[1]
    need(inside, f"temperature = {ends[0]:g} ... {ends[1]:g} K: must include T_ref = {T_ref:g} K")

    def factor(T):
        padded = np.pad(np.ravel(T), (0, -T.size % _BLOCK), "edge").reshape(-1, _BLOCK)
        logs = [log_factors(vertical, block, T_ref) for block in padded]
        return np.exp(np.concatenate(logs)[: T.size].reshape(T.shape))

    T = np.unique([*ends, T_ref, *nodes[(nodes > ends[0]) & (nodes < ends[1])]])
    while T.size < _MOST_ROWS:
        # Largest error of linear interpolation at three places between neighbouring temperatures.
        between = T[:-1] + np.diff(T) * np.array([[0.25], [0.5], [0.75]])
        exact = factor(between)
        coarse = np.abs(np.interp(between, T, factor(T)) / exact - 1).max(axis=0) > _ROW_ERROR
        if not coarse.any():
            break
        T = np.union1d(T, 0.5 * (T[1:] + T[:-1])[coarse])
    return T - zero, factor(T)
