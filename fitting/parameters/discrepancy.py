r"""How far the theory itself may be off: a smooth error of the model over the velocity.

What is measured is taken to be the theory times e^delta, with delta a Gaussian process over ln(v a_T) of
mean 0 [Kennedy & O'Hagan, J. R. Stat. Soc. B 63 (2001) 425],

.. math:: \mathrm{cov}(\delta_i, \delta_j) = a^2 e^{-(x_i - x_j)^2 / 2 w^2},\qquad x = \ln(v\, a_T)

so that the residuals of a fit, in units of the errors sigma of the logarithms, have the covariance
1 + cov / (sigma_i sigma_j): they are whitened by the inverse of its Cholesky factor, and error bars, bands
and verdict follow.
"""

import dataclasses
import math

import numpy as np

from fitting.parameters.constraints import is_number


@dataclasses.dataclass(frozen=True)
class Discrepancy:
    r"""A smooth relative error of the theory of friction over ln(v a_T).

    Parameters
    ----------
    amplitude : a, its standard deviation [-], 0.25 stands for 25 %; or None
        None: the one under which the data are most likely, all parameters integrated out.
    width : w, over which it changes, in ln v [-]; 2.3 is a decade
    shared : correlation between the errors of different curves at the same v a_T, 0 ... 1
        A curve is what one data set has at one pressure and temperature. 1: all have the same error, 0: each
        its own.
    estimated : whether the amplitude came from the data; said by a fit, not to it

    The defaults are those of rubber-like solids in notebooks/boundary_elements.md, where the amplitude is
    0.4 (with area_correction; one relaxation time has 0.6, over a decade and a half).

    Against friction from boundary elements of one relaxation time, the 95 % intervals of moduli and
    height hold the truth in none of 36 cases without it; with amplitude 0.45, over one decade and nothing
    shared, in half of them. What the defaults do there has not been measured.

    Limits: linear loss, errors of the friction given. The shift a_T is that of the scene at its start. An
    amplitude from the data counts as known: with fewer than some 20 values over the width give one.
    """

    amplitude: float | None = None
    width: float = math.log(100)
    shared: float = 0.8
    estimated: bool = False

    def __post_init__(self) -> None:
        if self.amplitude is not None and not (is_number(self.amplitude) and self.amplitude >= 0):
            raise ValueError(f"Discrepancy: amplitude = {self.amplitude!r}: must be a number >= 0, or None")
        if not (is_number(self.width) and self.width > 0):
            raise ValueError(f"Discrepancy: width = {self.width!r}: must be a finite number > 0")
        if not (is_number(self.shared) and 0 <= self.shared <= 1):
            raise ValueError(f"Discrepancy: shared = {self.shared!r}: must be between 0 and 1")
        if not isinstance(self.estimated, bool):
            raise ValueError(f"Discrepancy: estimated = {self.estimated!r}: must be True or False")


def correlations(x: np.ndarray, curve: np.ndarray, discrepancy: Discrepancy) -> np.ndarray:
    """Correlation of the theory's errors at x of curves, both of shape (n,); (n, n)."""
    near = np.exp(-0.5 * ((x[:, None] - x) / discrepancy.width) ** 2)
    return np.where(curve[:, None] == curve, near, discrepancy.shared * near)


def text_of(discrepancy: Discrepancy) -> str:
    """What a report says of it."""
    if discrepancy.amplitude is None:
        return "the theory may be off, by how much was not estimated"
    source = "estimated from the data" if discrepancy.estimated else "as given"
    decades = discrepancy.width / math.log(10)
    return (
        f"the theory may be off by {100 * discrepancy.amplitude:.3g} % ({source}), smoothly over"
        f" {decades:.2g} decade{'s' * (decades != 1)} of v a_T; different curves share"
        f" {100 * discrepancy.shared:.3g} % of it"
    )
