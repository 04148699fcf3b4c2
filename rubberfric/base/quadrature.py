"""Accuracy settings, and quadrature tables that NumPy computes once in float64."""

import dataclasses
import functools
import math
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import numpy.typing as npt
from numpy.polynomial import chebyshev, legendre

from rubberfric.base.checks import ArrayLike

# Nodes between neighbouring Gauss nodes. Exact to rounding for power laws of exponent 6 over panels of one
# e-fold. The error is 1e-7 for the widest panels, ten decades of plateau in 12 panels.
_IN_A_GAP = 5

# Detail of the angular means over ln q that `panels` and `angular_order` resolve.
_COARSEST = 0.27


@jax.tree_util.register_static
@dataclasses.dataclass(frozen=True)
class Quadrature:
    """Accuracy setting of the forward model.

    The setting is static, so functions are compiled again for each new setting. The defaults have errors
    below 1e-9 for area, friction and separation over ten decades of roughness, also with plateaus of nine
    decades, and below 1e-7 for area and friction with contact_model="boundary_elements". Calls without a
    setting choose one for the scene (`rf.analysis.default_quadrature`). For roughness of two or three decades
    the chosen setting has half as many nodes. `rf.analysis.quadrature_for` finds a setting for another error.

    Parameters
    ----------
    order : int, 4 ... 64
        Gauss nodes of a contact panel, where P, S and Psi are evaluated.
    panels : int, 2 ... 200
        number of angular panels over ln(q1/q0), and of contact panels before panels are added at kinks and
        by the grading.
    graded : int, 0 ... 40
        extra panels towards every wavevector where roughness begins. P decreases from 1 there within
        ln(q/q0) ~ 1e-4 at tyre pressures and 1e-18 at light loads.
    ratio : float, > 1
        neighbouring graded panels shrink by ratio^2 in ln(q/q0).
    angular_order : int, 4 ... 64
        nodes of an angular panel, where the angular integrals of the stiffness are evaluated.
    heat : int, 40 ... 2000
        nodes of the sum over ln k that gives the temperatures of a heated scene.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> coarse = rf.Quadrature(order=5, panels=10, graded=4)
    >>> error = rf.friction(scene, 0.01, 0.15e6, quadrature=coarse) / rf.friction(scene, 0.01, 0.15e6) - 1
    >>> bool(1e-9 < abs(error) < 1e-4)
    True
    """

    order: int = 13
    panels: int = 20
    graded: int = 8
    ratio: float = 4.5
    angular_order: int = 13
    heat: int = 176

    def __post_init__(self) -> None:
        limits = {"order": (4, 64), "panels": (2, 200), "graded": (0, 40)}
        limits |= {"angular_order": (4, 64), "heat": (40, 2000)}
        for name, (low, high) in limits.items():
            value = getattr(self, name)
            if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
                raise ValueError(f"Quadrature.{name} = {value!r}: must be an integer, {low} to {high}")
        if not (isinstance(self.ratio, int | float) and 1 < self.ratio < 1e6):
            raise ValueError(f"Quadrature.ratio = {self.ratio!r}: must be between 1 and 1e6")

    def finer(self) -> "Quadrature":
        """Return a setting with half as many nodes again, within the limits of each number.

        Examples
        --------
        >>> rf.Quadrature(panels=20).finer().panels
        30
        """
        return dataclasses.replace(
            self,
            order=min(64, self.order + 3),
            panels=min(200, round(1.5 * self.panels)),
            graded=min(40, self.graded + 2),
            angular_order=min(64, self.angular_order + 3),
            heat=min(2000, round(1.5 * self.heat)),
        )

    def resolving(self, detail: float) -> "Quadrature":
        """Return a setting for angular means with finer detail over ln q than a Prony series has.

        The setting has more panels, and fewer angular nodes in each panel.

        Parameters
        ----------
        detail : width of the Gaussian that smooths a tabulated modulus [-]
        """
        if detail >= _COARSEST:
            return self
        panels = min(200, round(self.panels * min(4.0, _COARSEST / detail)))
        angular_order = max(4, math.ceil(0.7 * self.angular_order))
        return dataclasses.replace(self, panels=panels, angular_order=angular_order)


def typed(table: npt.ArrayLike, values: ArrayLike) -> jax.Array:
    """Convert a NumPy table to a JAX array with the dtype of `values`, so that float32 is not widened."""
    return jnp.asarray(table, jnp.result_type(values))


@functools.cache
def gauss(order: int) -> tuple[np.ndarray, np.ndarray]:
    """Return Gauss-Legendre nodes and weights on [0, 1] as read-only arrays of shape (order,)."""
    x, w = legendre.leggauss(order)
    return _frozen(0.5 * (x + 1)), _frozen(0.5 * w)


@functools.cache
def legendre_transform(order: int) -> np.ndarray:
    """Return the matrix that converts values at Gauss nodes to `order` Legendre coefficients."""
    x, w = legendre.leggauss(order)
    basis = legendre.legvander(x, order - 1)
    return _frozen((2 * np.arange(order)[:, None] + 1) / 2 * basis.T * w)


@functools.cache
def slopes_at_nodes(order: int) -> np.ndarray:
    """Return the derivatives of the Lagrange polynomials of the Gauss nodes on [0, 1].

    Row k holds the derivatives of all polynomials at node k.
    """
    x = legendre.leggauss(order)[0]
    # Column k holds the coefficients of the derivative of the Legendre polynomial k.
    slopes = np.stack([np.append(legendre.legder(coefficients), 0.0) for coefficients in np.eye(order)], -1)
    return _frozen(2 * legendre.legvander(x, order - 1) @ slopes @ legendre_transform(order))


@functools.cache
def nodes_between(order: int) -> np.ndarray:
    """Return `_IN_A_GAP` nodes on [0, 1] in each gap before a Gauss node, for integrals up to the node."""
    borders = np.concatenate([[0.0], gauss(order)[0]])
    return _frozen((borders[:-1, None] + np.diff(borders)[:, None] * gauss(_IN_A_GAP)[0]).ravel())


@functools.cache
def weights_between(order: int) -> np.ndarray:
    """Return the weights of `nodes_between`, of shape (order, nodes in a gap), a row for each Gauss node."""
    gap = np.diff(np.concatenate([[0.0], gauss(order)[0]]))
    return _frozen(gap[:, None] * gauss(_IN_A_GAP)[1])


@functools.cache
def cumulative(order: int) -> np.ndarray:
    r"""Return a rule for integrals of a product up to every Gauss node of [0, 1].

    .. math:: \int_0^{x_k} w f\,dx = \sum_{s i} w(y_s)\, T_{ski}\, f(x_i)

    x are the Gauss nodes and y the nodes of `nodes_between`. f is smooth and known at x only, and w is
    known everywhere. The rule stays accurate, and therefore positive, if w grows by 1e6 within the panel. T
    has the shape (nodes between, order, order).
    """
    y = nodes_between(order)
    weight = weights_between(order).ravel()
    basis = legendre.legvander(2 * y - 1, order - 1) @ legendre_transform(order)
    before = np.repeat(np.arange(order), _IN_A_GAP)[:, None] <= np.arange(order)
    return _frozen((weight[:, None] * before)[:, :, None] * basis[:, None, :])


@functools.cache
def chebyshev_transform(count: int) -> np.ndarray:
    """Return the matrix from values at the Chebyshev nodes (chebpts1) to `count` Chebyshev coefficients."""
    matrix = 2 / count * chebyshev.chebvander(chebyshev.chebpts1(count), count - 1).T
    matrix[0] /= 2
    return _frozen(matrix)


def chebyshev_sum(coefficients: jax.Array, u: jax.Array) -> jax.Array:
    """Return a Chebyshev series at u by Clenshaw's recurrence, which compiles quickly.

    Its derivatives are finite at u = -1 and 1.
    """
    twice, last, before = 2 * u, jnp.zeros_like(u), jnp.zeros_like(u)
    for c in coefficients[:0:-1]:
        last, before = twice * last - before + c, last
    return u * last - before + coefficients[0]


def chebyshev_fit(
    function: Callable[[np.ndarray], np.ndarray], low: float, high: float, degree: int
) -> np.ndarray:
    """Return the power series of the Chebyshev interpolant of a function on [low, high].

    The coefficients are ordered by ascending powers of u, which increases from -1 at `low` to 1 at `high`.
    """
    coefficients = chebyshev.chebinterpolate(
        # NumPy's stub has the wrong type for the values at all nodes.
        lambda u: function(0.5 * (high - low) * (u + 1) + low),  # pyright: ignore[reportArgumentType, reportCallIssue]
        degree,
    )
    return _frozen(chebyshev.cheb2poly(coefficients))


def between_nodes(nodes: jax.Array, targets: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return the index of the node before each target, and the share of the node after it, 0 ... 1.

    Targets before the first and after the last of the ascending nodes are at these nodes.
    """
    index = jnp.clip(jnp.searchsorted(nodes, targets) - 1, 0, nodes.shape[0] - 2)
    before, after = nodes[index], nodes[index + 1]
    return index, jnp.clip((targets - before) / (after - before), 0.0, 1.0)


def _frozen(array):
    array.setflags(write=False)
    return array
