r"""How far the theory itself may be off: a smooth error of the model over the velocity.

What is measured is taken to be the theory times e^delta, with delta a Gaussian process over ln(v a_T) of
mean 0 [Kennedy & O'Hagan, J. R. Stat. Soc. B 63 (2001) 425],

.. math:: \mathrm{cov}(\delta_i, \delta_j) = \frac{a^2}{1 + (x_i - x_j)^2 / 2 w^2},\qquad x = \ln(v\, a_T)

a rational quadratic: squared exponentials of many widths, the typical one w [Rasmussen & Williams, Gaussian
Processes for Machine Learning (2006), eq. 4.19]. The theory's error has a level, a drift over all decades and
bends within one; a squared exponential of one width holds one of them to be impossible, and moduli that do
just that then look known.

The residuals of a fit, in units of the errors sigma of the logarithms, have the covariance
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

    The defaults are those of rubber-like solids: chosen so that intervals of fits to
    notebooks/boundary_elements.csv, and to 20 drawn scenes, hold the truth. The amplitude is above the
    0.3 ... 0.4 by which friction is off there, root mean square, as the error is no accident: theory over
    elements rises with the velocity in every scene.

    Held against boundary elements of 20 scenes drawn after the defaults were chosen (one relaxation time a
    decade, q1/qr = 8 ... 64, H = 0.6 ... 1, 12 velocities over five decades, 3 % noise, `area_correction`;
    moduli known beforehand to 30 %, the height free), 95 % intervals hold the truth of

    - two pressures: 94 % of the moduli and 100 % of the heights; without discrepancy of 38 % and 0 %
    - one pressure: 95 % and 100 %; without discrepancy of 48 % and 20 %
    - two pressures, the amplitude estimated: 88 % and 85 %

    The height then has a bar of 30 %, three times the scatter of the fitted heights.

    Limits: linear loss, errors of the friction given. The shift a_T is that of the scene at its start. An
    amplitude from the data counts as known: with fewer than some 20 values over the width give one. Of solids
    with one relaxation time the intervals of moduli hold the truth in five cases of six. Where nothing but
    friction determines the moduli, fit and truth lie along a curved valley: most moduli get no interval, and
    those few that do, and the height, can miss; `FitResult.profile` follows the valley.
    """

    amplitude: float | None = 0.5
    width: float = math.log(10)
    shared: float = 0.6
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
    near = 1 / (1 + 0.5 * ((x[:, None] - x) / discrepancy.width) ** 2)
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
