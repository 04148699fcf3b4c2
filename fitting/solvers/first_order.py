"""First-order solvers from optax, behind the same init and step as `fitting.solvers.levenberg_marquardt`.

They see the gradient of the cost only, by reverse mode, and are for comparison and for
problems with more parameters than residuals; for curves, Levenberg-Marquardt is faster by far.
"""

import dataclasses
import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp
import optax

from fitting.solvers.problem import cost_at, rounding_cost
from fitting.solvers.status import CONVERGED, NOT_FINITE, PERFECT, RUNNING


class State(NamedTuple):
    """Where a fit stands; a pytree."""

    x: jax.Array  # the best so far
    cost: jax.Array
    status: jax.Array  # of `fitting.solvers.status`
    nfev: jax.Array  # evaluations of the cost
    njev: jax.Array  # and of its gradient
    here: jax.Array  # the solver's own x
    inner: object  # the state of the optax transformation
    quiet: jax.Array  # steps since the cost last fell by more than the tolerance


class _Gradient:
    """What both solvers share; they add `optimiser()` and `update(...)`."""

    def init(self, structure, numbers, targets, x):
        """The state at a start vector x."""
        cost = cost_at(structure, numbers, targets, x)
        status = jnp.where(jnp.isfinite(cost), RUNNING, NOT_FINITE)
        zero = jnp.asarray(0)
        return State(x, cost, status, zero + 1, zero, x, self.optimiser().init(x), zero)

    def step(self, structure, numbers, targets, state):
        """The state after one step; one that is done stays as it is."""

        function = functools.partial(cost_at, structure, numbers, targets)
        here, inner, evaluations, finite = self.update(function, state, targets.held)
        cost = function(here)
        better = cost < state.cost
        gained = jnp.where(better, state.cost - cost, 0.0)
        quiet = jnp.where(gained > self.tolerance * state.cost, 0, state.quiet + 1)
        perfect = jnp.minimum(cost, state.cost) <= rounding_cost(structure, targets)
        status = jnp.select(
            [~finite, perfect, quiet >= self.patience], [NOT_FINITE, PERFECT, CONVERGED], RUNNING
        )
        new = State(
            jnp.where(better, here, state.x),
            jnp.where(better, cost, state.cost),
            status,
            state.nfev + evaluations + 1,
            state.njev + evaluations,
            here,
            inner,
            quiet,
        )
        running = state.status == RUNNING
        return jax.tree.map(lambda after, before: jnp.where(running, after, before), new, state)


@dataclasses.dataclass(frozen=True)
class LBFGS(_Gradient):
    """Limited-memory BFGS with optax's zoom line search.

    Parameters
    ----------
    memory : number of past steps that shape the Hessian
    tolerance : done when `patience` steps in turn lower the cost by less than this part of it
    """

    memory: int = 20
    tolerance: float = 1e-9
    patience: int = 5
    max_steps = 2000

    def optimiser(self):
        return optax.lbfgs(memory_size=self.memory)

    def update(self, function, state, held):
        value, gradient = optax.value_and_grad_from_state(function)(state.here, state=state.inner)
        gradient = gradient * held
        updates, inner = self.optimiser().update(
            gradient, state.inner, state.here, value=value, grad=gradient, value_fn=function
        )
        evaluations = jnp.asarray(1) + optax.tree.get(inner, "num_linesearch_steps", default=0)
        finite = jnp.all(jnp.isfinite(gradient)) & jnp.all(jnp.isfinite(updates))
        return optax.apply_updates(state.here, updates * held), inner, evaluations, finite


@dataclasses.dataclass(frozen=True)
class Adam(_Gradient):
    """Adam with a rate that falls along a cosine.

    Parameters
    ----------
    rate : length of the first steps in x, where 1 is a factor e
    max_steps : steps until the rate is zero
    """

    rate: float = 0.1
    max_steps: int = 3000
    tolerance: float = 1e-9
    patience: int = 200

    def optimiser(self):
        return optax.adam(optax.cosine_decay_schedule(self.rate, self.max_steps))

    def update(self, function, state, held):
        gradient = jax.grad(function)(state.here) * held
        updates, inner = self.optimiser().update(gradient, state.inner, state.here)
        return (
            optax.apply_updates(state.here, updates),
            inner,
            jnp.asarray(1),
            jnp.all(jnp.isfinite(gradient)),
        )
