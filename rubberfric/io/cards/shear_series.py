r"""The shear modulus of an isotropic solid with a Prony series of E and an elastic bulk modulus.

.. math:: \frac{1}{G} = \frac{3}{E} - \frac{1}{3 B},\qquad G = \frac{3 B E}{9 B - E}

G is a Prony series with the number of terms of E, because 1/G is a retardation spectrum with the times of
1/E. With the rates l_i = 1/tau_i and E(s) = E_inf + sum_i E_i s/(s + l_i), the rates of G are the zeros x of
9 B - E(-x) (`rubberfric.materials.interconversion`). The weight of the rate x is

.. math:: G_x = \frac{27 B^2}{x \sum_j E_j l_j / (l_j - x)^2}
"""

import numpy as np

from rubberfric.materials.interconversion import zeros_after_poles


def shear_series(
    rest: float, weights: np.ndarray, tau: np.ndarray, bulk: float
) -> tuple[float, np.ndarray, np.ndarray]:
    """Return G_inf, G_i and relaxation times of the shear modulus [Pa, Pa, s].

    Parameters
    ----------
    rest, weights, tau : E_inf [Pa], E_i [Pa] and relaxation times [s]; shape (n,)
    bulk : B [Pa], more than a third of the glassy Young's modulus

    Returns
    -------
    G_inf, G_i and times, by rising time; equal times are joined and terms without weight are left out
    """
    times, place = np.unique(tau, return_inverse=True)
    weights = np.bincount(np.ravel(place), np.asarray(weights, float), times.size)
    # Rates rise, so that every interval ends at the next rate.
    E, rate = weights[weights > 0][::-1], 1 / times[weights > 0][::-1]
    G_inf = 3 * bulk * rest / (9 * bulk - rest)
    if not E.size:
        return G_inf, E, rate
    x, sums = zeros_after_poles(9 * bulk - rest - E.sum(), E * rate, rate)
    return G_inf, (27 * bulk**2 / (x * sums))[::-1], (1 / x)[::-1]
