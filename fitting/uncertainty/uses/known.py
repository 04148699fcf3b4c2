r"""What is known before the next experiment, and what measurements of the friction would add to it.

A row of the Jacobian of ln Q (of Q itself for absolute errors), in units of the error that the measurement
will have, and in the variables x of a fit (`fitting.parameters.variables`):

.. math:: a_i = \frac{1}{\epsilon_i} \frac{\partial \ln Q(v_i, p_i, T_i)}{\partial x}
"""

from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import rubberfric as rf
from fitting.parameters.constraints import Rule, with_starts
from fitting.parameters.priors import Prior, prior_residuals, read_priors
from fitting.parameters.variables import Constants, Variables, element_names, free_parameters, to_scene
from fitting.solvers.residuals import forward
from fitting.uncertainty.covariance import OPEN
from fitting.uncertainty.intervals import SolvedProblem
from rubberfric.analysis import value_and_jacobian
from rubberfric.base import quick_jit, recurring_length
from rubberfric.scene import cast, result_dtype

Points = tuple[np.ndarray, np.ndarray, np.ndarray | None]  # velocity, pressure, temperature


class Known(NamedTuple):
    """What is known of the free parameters of a scene."""

    variables: Variables
    constants: Constants
    quadrature: rf.Quadrature
    x: np.ndarray  # shape (size,)
    stretch: np.ndarray  # of the variables, see `fitting.uncertainty.covariance`
    information: np.ndarray  # M_0, of y = x / stretch; no direction is less known than OPEN

    @property
    def names(self) -> tuple[str, ...]:
        """Key path of every free element."""
        return tuple(element_names(self.variables))

    @property
    def scene(self) -> rf.Scene:
        """The scene at x."""
        return to_scene(self.variables, self.constants, self.x)

    def draws(self, count: int, reach: float, key: jax.Array) -> np.ndarray:
        """x itself, and draws about it, along no direction farther than `reach`; shape (count, size)."""
        values, V = np.linalg.eigh(self.information)
        noise = np.array(jax.random.normal(key, (count, self.x.size)))
        noise[0] = 0.0
        return self.x + self.stretch * ((noise * np.minimum(values**-0.5, reach)) @ V.T)

    def rows(self, x: np.ndarray, at: Points, quantity: str, logarithmic: bool = True) -> np.ndarray:
        """d ln Q / dy, or dQ / dy, at points and a draw x, shape (points, size).

        The points are padded to a length that recurs: other candidates compile nothing.
        """
        count = at[0].size
        padding = (0, recurring_length(count) - count)
        v, p, T = (None if c is None else np.pad(c, padding, "edge") for c in at)
        static = {"variables": self.variables, "quantity": quantity, "quadrature": self.quadrature}
        value, slope = _value_and_slope(self.constants, jnp.asarray(x), (v, p, T), **static)
        value, slope = np.asarray(value)[:count], np.asarray(slope)[:count]
        if logarithmic:
            slope = slope / value[:, None]
        if not np.isfinite(slope).all():
            bad = int(np.argmin(np.isfinite(slope).all(1)))
            raise ValueError(
                f"candidates: {quantity} = {value[bad]:g} at v = {at[0][bad]:g} m/s, p = {at[1][bad]:g} Pa:"
                " must be > 0, and the temperatures of a heated scene converge there"
            )
        return slope * self.stretch


@quick_jit(static_argnames=("variables", "quantity", "quadrature"))
def _value_and_slope(constants, x, at, *, variables, quantity, quadrature):
    return value_and_jacobian(lambda x: to_scene(variables, constants, x), x, at, quantity, quadrature)


@quick_jit(static_argnames=("structure", "variables"))
def _prior_slopes(numbers, constants, x, *, structure, variables):
    """Derivatives of the rows of the priors, shape (rows, size)."""
    return forward(lambda x: prior_residuals(structure, numbers, to_scene(variables, constants, x), x), x)[1]


def known_of(
    source: SolvedProblem | rf.Scene,
    free: Mapping[str, Rule] | None,
    prior: Mapping[str, Prior] | None,
    quadrature: rf.Quadrature | None,
) -> Known:
    """What a fit knows; or what is known of the `free` parameters of a scene, priors alone."""
    if isinstance(source, SolvedProblem):
        for name, value in (("free", free), ("prior", prior), ("quadrature", quadrature)):
            if value is not None:
                raise ValueError(f"{name}: must not be given; a fit has its own")
        of, known = source.problem, source.uncertainty
        quadrature = of.structure.quadrature
        information = np.linalg.inv(known.spread)
        return Known(of.variables, of.numbers.constants, quadrature, known.x, known.stretch, information)
    if not isinstance(source, rf.Scene):
        raise ValueError(f"source is a {type(source).__name__}: must be a FitResult or a Scene")
    if not isinstance(free, dict):
        raise ValueError('free: must be a dict of key paths, like {"upper.spectrum.hurst": Bounded(0.3, 1)}')
    scene = with_starts(cast(source, result_dtype(source, 1.0)), free)
    variables, constants, x = free_parameters(scene, free)
    structure, numbers = read_priors(scene, variables, constants, prior)
    static = {"structure": structure, "variables": variables}
    rows = np.asarray(_prior_slopes(numbers, constants, jnp.asarray(x), **static))
    information = np.eye(x.size) / OPEN**2 + rows.T @ rows
    return Known(variables, constants, quadrature or rf.Quadrature(), x, np.ones(x.size), information)
