r"""The posterior of a fit as a function, for samplers.

.. math:: \ln p(x \,|\, data) = -\frac12 \sum_i \rho(r_i^2) - \frac12 \sum_k p_k^2 + const

over the fit's own variables x, which know no bounds (`fitting.parameters.variables`): any sampler that
takes an unconstrained log density and its gradient can use it, numpyro's NUTS or blackjax.
"""

import dataclasses
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.variables import Array
from fitting.solvers.problem import Numbers, Problem, Structure, Targets
from fitting.solvers.residuals import objective, padded
from fitting.uncertainty.intervals import SolvedProblem

# What a prior that says nothing is flat in.
FLAT = ("x", "values")


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class LogDensity:
    """A log density over x, and the way from x to values; made by `log_density`.

    Called with x, shape (n,), it gives the logarithm of the density but for a constant, a scalar;
    jit, vmap and grad go through.
    """

    problem: Problem
    flat: str

    def __call__(self, x: Array) -> jax.Array:
        """The logarithm of the density at x, shape (n,), but for a constant."""
        structure, numbers, targets, _ = padded(self.problem)
        return _density(structure, self.flat, numbers, targets, jnp.asarray(x))

    @property
    def names(self) -> tuple[str, ...]:
        """Key path of every element of x."""
        return self.problem.names

    def values(self, x: Array) -> np.ndarray:
        """Values of the free elements at x; both of shape (..., n)."""
        return self.problem.values(x)

    def scene(self, x: Array) -> Any:
        """The scene with the free elements at x, shape (n,), or the scenes by their names.

        What a draw predicts is computed from it.
        """
        return self.problem.scene(x)


def log_density(result: SolvedProblem, flat: str = "x") -> LogDensity:
    r"""Log density of the free parameters of a fit, given its data and priors.

    .. math:: \ln p(x) = -cost(x) \qquad\text{or}\qquad
              \ln p(x) = -cost(x) + \sum_k \ln\left|\frac{d\,value_k}{dx_k}\right|

    Parameters
    ----------
    result : FitResult
        whose data, errors (estimated ones as estimated), loss and priors are taken as they are.
    flat : "x" or "values"
        what a parameter without a prior is evenly distributed in: the fit's variable (for a
        Positive one its logarithm, for a Bounded one its logit), or the value itself. With "x"
        the density is highest at the fit, and the covariance is that of its Gaussian approximation.

    Returns
    -------
    LogDensity : a function of x, shape (n,), with `names`, `values(x)` and `scene(x)`;
        n = len(result.names), start at result.x.

    Raises
    ------
    ValueError : flat is neither.

    Notes
    -----
    A density need not have a finite integral: what the data leave open (`result.unidentified`)
    stays open in x, and a sampler walks away along it. Give such a parameter a Gaussian prior, or
    hold it; a Bounded one is safe with "values". For a robust loss exp(-cost) is a density whose width
    is not that of the fit's standard errors, which allow for outliers in another way.
    """
    if flat not in FLAT:
        raise ValueError(f"flat = {flat!r}: must be one of {', '.join(FLAT)}")
    return LogDensity(result.problem, flat)


def _log_slopes(variables, width, x):
    """Sum of ln |d value / d x|, in logarithms: far out a slope itself is zero."""
    total = 0.0
    for group in variables.own:
        here, scale = x[slice(*group.slot)], jnp.log(jnp.abs(width[slice(*group.slot)]))
        if group.kind == "Positive":
            total += jnp.sum(here)
        elif group.kind == "Bounded":
            total += jnp.sum(scale + jax.nn.log_sigmoid(here) + jax.nn.log_sigmoid(-here))
        else:
            total += jnp.sum(scale)
    return total


def density_at(
    structure: Structure, flat: str, numbers: Numbers, targets: Targets, x: jax.Array
) -> jax.Array:
    """The density as `LogDensity` has it, of what a problem holds, for what compiles it with more."""
    density = -objective(structure, numbers, targets).cost(x)
    if flat == "x":
        return density
    return density + _log_slopes(structure.variables, numbers.constants.width, x)


# One for all results: a second density of the same kind compiles nothing.
_density = jax.jit(density_at, static_argnums=(0, 1))
