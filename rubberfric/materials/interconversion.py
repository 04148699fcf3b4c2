r"""Exact conversion of a retardation spectrum to a Prony series.

The compliance and the modulus of a linear viscoelastic solid satisfy E(s) D(s) = 1 with the Laplace variable
s (Carson transforms),

.. math:: D(s) = D_0 + \sum_i \frac{D_i}{1 + s\tau_i} + \frac{\varphi}{s},\qquad
          E(s) = E_\infty + \sum_k E_k \frac{s}{s + x_k}

The rates x_k are the zeros of D(-x). With the rates l_i = 1/tau_i, exactly one zero follows each l_i, and one
zero follows 0 if the solid flows. [Gross, Mathematical Structure of the Theories of Viscoelasticity, Hermann
1953; Park & Schapery, Int. J. Solids Struct. 36 (1999) 1653, doi:10.1016/S0020-7683(98)00055-9]
"""

import numpy as np

from rubberfric.base.checks import NONNEGATIVE, POSITIVE, ArrayLike, as_leaf, check_lengths, check_values
from rubberfric.materials.prony import Prony
from rubberfric.materials.shifts import Shift

# Bisections of the logarithm of a distance. They divide the range of float64, 1500 e-folds, by 2^80 = 1e24.
_HALVINGS = 80
# Smallest ln of a distance that is not a denormal number.
_LOWEST = -700.0


def zeros_after_poles(
    constant: float, weights: np.ndarray, poles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    r"""Return the zeros of c + sum_j w_j / (l_j - x) and the sums of w_j / (l_j - x)^2 at the zeros.

    Exactly one zero follows each pole l_j, before the next pole. It is found by bisection of the logarithm of
    its distance from l_j, so that it is accurate relative to this distance.

    Parameters
    ----------
    constant : c, > 0
    weights : w_j, > 0, shape (n,)
    poles : l_j, >= 0, strictly increasing, shape (n,)

    Returns
    -------
    zeros and sums, each of shape (n,)
    """
    own = np.eye(poles.size, dtype=bool)
    apart = poles[None, :] - poles[:, None]
    # Beyond the last pole, c exceeds the sum of w_j / (x - l_j) <= sum(w) / (x - l_n).
    high = np.log(np.append(np.diff(poles), np.sum(weights) / constant))
    low = np.full(poles.size, _LOWEST)

    def distances(log_d):
        """Return l_j - x for each x, a row, and each l_j, without cancellation at the own pole."""
        step = np.exp(log_d)[:, None]
        return np.where(own, -step, apart - step)

    with np.errstate(divide="ignore", over="ignore"):
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            before = constant + np.sum(weights / distances(middle), axis=1) < 0
            low, high = np.where(before, middle, low), np.where(before, high, middle)
    return poles + np.exp(low), np.sum(weights / distances(low) ** 2, axis=1)


def prony_from_compliance(
    D_0: ArrayLike,
    D: ArrayLike,
    tau: ArrayLike,
    fluidity: ArrayLike = 0.0,
    *,
    poisson: float = 0.5,
    shift: Shift | None = None,
) -> Prony:
    r"""Return the Prony series of a solid with a given creep compliance.

    .. math:: D(t) = D_0 + \sum_i D_i (1 - e^{-t/\tau_i}) + \varphi t

    The series has one relaxation time for each retardation time with D_i > 0, and one more if the solid
    flows. It is exact up to rounding. [Park & Schapery, doi:10.1016/S0020-7683(98)00055-9]

    Parameters
    ----------
    D_0 : instantaneous compliance, > 0 [1/Pa]
    D : retarded compliances, >= 0 [1/Pa], shape (n,)
    tau : retardation times, > 0 [s], shape (n,)
    fluidity : phi, rate of flow divided by the stress, >= 0 [1/(Pa s)]; 0 for a solid
    poisson, shift : fields of the material

    Returns
    -------
    Prony with E_inf = 1 / (D_0 + sum D), or 0 if the material flows

    Raises
    ------
    ValueError : a value is invalid, or nothing is retarded, because the solid is then elastic.

    Examples
    --------
    A standard linear solid, whose relaxation time is shorter than its retardation time of 1 s:

    >>> rubber = rf.materials.prony_from_compliance(1e-7, [1e-7], [1.0])
    >>> round(float(rubber.E_inf)), round(float(rubber.E[0])), round(float(rubber.tau[0]), 9)
    (5000000, 5000000, 0.5)
    """
    arguments = {"D_0": (D_0, 0), "D": (D, 1), "tau": (tau, 1), "fluidity": (fluidity, 0)}
    leaves = {name: as_leaf(name, value, ndim) for name, (value, ndim) in arguments.items()}
    check_lengths("prony_from_compliance", D=leaves["D"], tau=leaves["tau"])
    values = {name: np.asarray(leaf, float) for name, leaf in leaves.items()}
    for name, rule in (("D_0", POSITIVE), ("D", NONNEGATIVE), ("tau", POSITIVE), ("fluidity", NONNEGATIVE)):
        check_values(name, values[name], rule)
    numbers = (float(values["D_0"]), values["D"], values["tau"], float(values["fluidity"]))
    return Prony(*terms_from_compliance(*numbers), poisson, shift)


def terms_from_compliance(
    D_0: float, D: np.ndarray, tau: np.ndarray, fluidity: float
) -> tuple[float, np.ndarray, np.ndarray]:
    """Return E_inf, E and the relaxation times of `prony_from_compliance`, by rising times.

    Raise ValueError if nothing is retarded.

    Examples
    --------
    >>> E_inf, E, tau = rf.materials.terms_from_compliance(1e-7, np.array([]), np.array([]), 1e-6)
    >>> E_inf, E.round(3), tau.round(9)
    (0.0, array([10000000.]), array([0.1]))
    """
    rates, place = np.unique(1 / tau, return_inverse=True)
    weights = np.bincount(np.ravel(place), D, rates.size)
    rates, weights = rates[weights > 0], weights[weights > 0]
    if not rates.size and not fluidity:
        raise ValueError("D is 0 and fluidity is 0: must have a retarded compliance; use Elastic")
    relaxed = 0.0 if fluidity else 1 / (D_0 + float(weights.sum()))
    poles, residues = rates, weights * rates
    if fluidity:
        poles, residues = np.append(0.0, poles), np.append(fluidity, residues)
    x, sums = zeros_after_poles(D_0, residues, poles)
    # Rates rise.
    return relaxed, (1 / (x * sums))[::-1], (1 / x)[::-1]
