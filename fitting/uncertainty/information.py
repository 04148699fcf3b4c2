r"""Information before the next experiment, and linear optimal design of its measurements by exchange.

A measurement i has a row of the Jacobian of ln Q in units of its error and in the variables x of a fit
(`fitting.parameters.variables`):

.. math:: a_i = \frac{1}{\epsilon_i} \frac{\partial \ln Q(v_i, p_i, T_i)}{\partial x}

It adds a_i a_i^T to the information M, and M^-1 is the covariance of the fitted parameters. With the prior
information M_0, the n measurements with

.. math:: \max_i \; \frac1K \sum_k \phi\Big(M_0 + \sum_i a_{ik} a_{ik}^T\Big),\qquad
          \phi_D = \ln\det M,\quad \phi_L = -\ln\mathrm{tr}(L\, M^{-1})

are found by adding the best candidates in turn, and then exchanging single measurements until no exchange
improves the criterion [Fedorov, Theory of Optimal Experiments, Academic Press 1972; Atkinson, Donev & Tobias,
Optimum Experimental Designs, Oxford 2007, chapter 12]. K sets of rows, from draws of the prior information,
make the design robust. Logarithms are averaged [Chaloner & Larntz, J. Stat. Plan. Inference 21, 191 (1989)]
because draws with a large variance would dominate. One more row changes both criteria by

.. math:: \Delta\phi_D = \ln(1 + a^T M^{-1} a),\qquad
          \Delta\phi_L = -\ln\Big(1 - \frac{1}{\mathrm{tr}(L\, M^{-1})}
          \frac{a^T M^{-1} L M^{-1} a}{1 + a^T M^{-1} a}\Big)

Limits: the result is a local optimum, which no single exchange improves. In the examples with a closed form
it is the global one.
"""

from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import rubberfric as rf
from fitting.parameters.constraints import Constraint, with_starts
from fitting.parameters.priors import Prior, prior_residuals, read_priors
from fitting.parameters.variables import Constants, Variables, element_names, free_parameters, to_scene
from fitting.solvers.residuals import forward
from fitting.uncertainty.covariance import OPEN
from fitting.uncertainty.intervals import SolvedProblem
from rubberfric.analysis import value_and_jacobian
from rubberfric.base import quick_jit, recurring_length
from rubberfric.scene import cast, result_dtype

Conditions = tuple[np.ndarray, np.ndarray, np.ndarray | None]  # velocity, pressure, temperature
# Fewer points are padded to this number, so that a prediction shares the compiled function of few candidates.
_SHORTEST = 32
# Largest number of passes through all chosen points. A few suffice.
_PASSES = 50
# An exchange must gain more than this. Rounding alone would cycle.
_LEAST = 1e-10
# Largest share of the variance that one row removes, also after rounding.
_MOST = 1 - 1e-15


class PriorInformation(NamedTuple):
    """Prior information on the free parameters of a scene."""

    variables: Variables
    constants: Constants
    quadrature: rf.Quadrature
    x: np.ndarray  # shape (size,)
    stretch: np.ndarray  # of the variables, see `fitting.uncertainty.covariance`
    information: np.ndarray  # M_0, of y = x / stretch; standard deviations are limited to OPEN

    @property
    def names(self) -> tuple[str, ...]:
        """Key path of every free element."""
        return tuple(element_names(self.variables))

    @property
    def scene(self) -> rf.Scene:
        """The scene at x."""
        return to_scene(self.variables, self.constants, self.x)

    def draws(self, count: int, reach: float, key: jax.Array) -> np.ndarray:
        """Return x and random draws about it, with deviations of at most `reach`, shape (count, size)."""
        values, V = np.linalg.eigh(self.information)
        noise = np.array(jax.random.normal(key, (count, self.x.size)))
        noise[0] = 0.0
        return self.x + self.stretch * ((noise * np.minimum(values**-0.5, reach)) @ V.T)

    def rows(self, x: np.ndarray, at: Conditions, quantity: str) -> np.ndarray:
        """Return d ln Q / dy with y = x / stretch at the conditions `at`, (points, size)."""
        count = at[0].size
        padding = (0, recurring_length(max(count, _SHORTEST)) - count)  # other candidates compile nothing
        v, p, T = (None if c is None else np.pad(c, padding, "edge") for c in at)
        static = {"variables": self.variables, "quantity": quantity, "quadrature": self.quadrature}
        value, slope = _value_and_slope(self.constants, jnp.asarray(x), (v, p, T), **static)
        value = np.asarray(value)[:count]
        slope = np.asarray(slope)[:count] / value[:, None]
        if not np.isfinite(slope).all():
            bad = int(np.argmin(np.isfinite(slope).all(1)))
            raise ValueError(
                f"candidates: {quantity} = {value[bad]:g} at v = {at[0][bad]:g} m/s, p = {at[1][bad]:g} Pa:"
                " must be > 0, and the temperatures of a heated scene must converge"
            )
        return slope * self.stretch


@quick_jit(static_argnames=("variables", "quantity", "quadrature"))
def _value_and_slope(constants, x, at, *, variables, quantity, quadrature):
    return value_and_jacobian(lambda x: to_scene(variables, constants, x), x, at, quantity, quadrature)


@quick_jit(static_argnames=("variables",))
def _prior_slopes(priors, constants, x, *, variables):
    return forward(lambda x: prior_residuals(priors, to_scene(variables, constants, x), x), x)[1]


def known_of(
    source: SolvedProblem | rf.Scene,
    free: Mapping[str, Constraint] | None,
    prior: Mapping[str, Prior] | None,
    quadrature: rf.Quadrature | None,
) -> PriorInformation:
    """Return the prior information from a fit, or from priors on the parameters `free` of a scene."""
    if isinstance(source, SolvedProblem):
        for name, value in (("free", free), ("prior", prior), ("quadrature", quadrature)):
            if value is not None:
                raise ValueError(f"{name}: must be None if the source is a fit")
        of, known = source.problem, source.uncertainty
        if of.numbers.whitening is not None:
            raise ValueError(
                "source: the fit has a Discrepancy: must have none, because further measurements share the"
                " error of the theory, and a design promises errors without it"
            )
        quadrature = of.structure.quadrature
        information = np.linalg.inv(known.spread)
        return PriorInformation(
            of.variables, of.numbers.constants, quadrature, known.x, known.stretch, information
        )
    if not isinstance(source, rf.Scene):
        raise ValueError(f"source is a {type(source).__name__}: must be a FitResult or a Scene")
    if not isinstance(free, dict):
        raise ValueError('free: must be a dict of key paths, like {"upper.spectrum.hurst": Bounded(0.3, 1)}')
    scene = with_starts(cast(source, result_dtype(source, 1.0)), free)
    variables, constants, x = free_parameters(scene, free)
    priors = read_priors(scene, variables, constants, prior)
    rows = np.asarray(_prior_slopes(priors, constants, jnp.asarray(x), variables=variables))
    information = np.eye(x.size) / OPEN**2 + rows.T @ rows
    return PriorInformation(
        variables, constants, quadrature or rf.Quadrature(), x, np.ones(x.size), information
    )


def exchange(
    rows: np.ndarray,
    base: np.ndarray,
    budget: float,
    cost: np.ndarray | None = None,
    target: np.ndarray | None = None,
) -> np.ndarray:
    """Return the indices of the candidates to measure, most useful first; some may appear several times.

    Parameters
    ----------
    rows : row a_i of the Jacobian of every candidate, in units of the candidate's error, shape (draws,
        candidates, size)
    base : prior information M_0, positive definite, shape (size, size)
    budget : number of measurements, or their largest total cost
    cost : cost of every candidate, > 0, shape (candidates,). If None, each measurement costs 1.
    target : L, shape (draws, size, size). If None, the criterion is D.
    """
    cost = np.ones(rows.shape[1]) if cost is None else cost
    chosen = _filled(rows, base, budget, cost, target, [])
    for _ in range(_PASSES):
        before = list(chosen)
        for i in range(len(chosen)):
            others = chosen[:i] + chosen[i + 1 :]
            gains = gain(rows, information(rows, base, others), target)
            allowed = cost <= budget - cost[others].sum() + 1e-9 * budget
            best = int(np.argmax(np.where(allowed, gains, -np.inf)))
            if gains[best] > gains[chosen[i]] + _LEAST * (1 + abs(gains[chosen[i]])):
                chosen[i] = best
        chosen = _filled(rows, base, budget, cost, target, chosen)
        if chosen == before:
            break
    return _ordered(rows, base, cost, target, chosen)


def information(rows: np.ndarray, base: np.ndarray, chosen: list[int] | np.ndarray) -> np.ndarray:
    """Return the information M after measurements at the chosen candidates, (draws, size, size)."""
    some = rows[:, np.asarray(chosen, int)]
    return base + np.swapaxes(some, 1, 2) @ some


def variance(information: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Return tr(L M^-1) of every draw, shape (draws,)."""
    return np.trace(target @ np.linalg.inv(information), axis1=1, axis2=2)


def gain(rows: np.ndarray, information: np.ndarray, target: np.ndarray | None) -> np.ndarray:
    """Return the gain in phi, averaged over draws, from a measurement at each candidate, (candidates,)."""
    covariance = np.linalg.inv(information)
    moved = rows @ covariance
    seen = np.sum(moved * rows, -1)
    if target is None:
        return np.mean(np.log1p(seen), 0)
    less = np.sum((moved @ target) * moved, -1) / (1 + seen)
    part = less / np.trace(target @ covariance, axis1=1, axis2=2)[:, None]
    return np.mean(-np.log1p(-np.minimum(part, _MOST)), 0)


def _filled(rows, base, budget, cost, target, chosen):
    """Add candidates to `chosen`, by decreasing gain per cost, until the budget allows no further one."""
    chosen = list(chosen)
    while True:
        allowed = cost <= budget - cost[chosen].sum() + 1e-9 * budget
        if not allowed.any():
            return chosen
        gains = gain(rows, information(rows, base, chosen), target) / cost
        chosen.append(int(np.argmax(np.where(allowed, gains, -np.inf))))


def _ordered(rows, base, cost, target, chosen):
    left, order = list(chosen), []
    while left:
        gains = gain(rows[:, left], information(rows, base, order), target) / cost[left]
        order.append(left.pop(int(np.argmax(gains))))
    return np.array(order, int)
