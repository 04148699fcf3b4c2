"""First-order solvers from optax, which take their steps in one compiled function.

They serve for comparison, and for problems with more parameters than residuals. Levenberg-Marquardt is much
faster for curves.
"""

import abc
import dataclasses
from typing import Any, ClassVar

import jax
import jax.numpy as jnp

from fitting.parameters.variables import Array
from fitting.solvers.objective import Iterate, Objective, status_after, unless_done


class FirstOrder(abc.ABC):
    """Base class of the first-order solvers."""

    tolerance: float
    patience: int
    # True for a line search, after which value and gradient are known when a step begins.
    searches: ClassVar[bool]

    @abc.abstractmethod
    def optimiser(self) -> Any:
        """Return the gradient transformation of optax."""

    def own(self, x: Array) -> tuple[Array, Any, jax.Array]:
        """Return the first `own` of an `Iterate` for several fits, at x of shape (fits, size).

        It contains the present x, which may be worse than the best x so far, the state of the transformation,
        and the number of steps since the cost last fell by more than the tolerance.
        """
        return x, jax.vmap(self.optimiser().init)(x), jnp.zeros(len(x), int)

    def step(self, objective: Objective, iterate: Iterate) -> Iterate:
        """Return the iterate after one step."""
        optax = _optax()
        here, inner, quiet = iterate.own
        if self.searches:
            value, gradient = optax.value_and_grad_from_state(objective.cost)(here, state=inner)
        else:
            value, gradient = jax.value_and_grad(objective.cost)(here)
        gradient = gradient * objective.moving
        updates, inner = optax.with_extra_args_support(self.optimiser()).update(
            gradient, inner, here, value=value, grad=gradient, value_fn=objective.cost
        )
        evaluations = jnp.asarray(1) + optax.tree.get(inner, "num_linesearch_steps", default=0)
        finite = jnp.all(jnp.isfinite(gradient)) & jnp.all(jnp.isfinite(updates))
        here = here + updates * objective.moving
        cost = objective.cost(here)
        better = cost < iterate.cost
        gained = jnp.where(better, iterate.cost - cost, 0.0)
        quiet = jnp.where(gained > self.tolerance * iterate.cost, 0, quiet + 1)
        perfect = jnp.minimum(cost, iterate.cost) <= objective.rounding
        new = Iterate(
            jnp.where(better, here, iterate.x),
            jnp.where(better, cost, iterate.cost),
            status_after(finite, perfect, quiet >= self.patience),
            iterate.nfev + evaluations + 1,
            iterate.njev + evaluations,
            (here, inner, quiet),
        )
        return unless_done(iterate, new)


@dataclasses.dataclass(frozen=True)
class LBFGS(FirstOrder):
    """Limited-memory BFGS with optax's zoom line search.

    Parameters
    ----------
    memory : number of past steps from which the Hessian is estimated
    tolerance, patience : the fit ends after `patience` consecutive steps with relative gains below
        `tolerance`
    """

    title: ClassVar[str] = "limited-memory BFGS"
    searches: ClassVar[bool] = True
    max_steps: ClassVar[int] = 2000

    memory: int = 20
    tolerance: float = 1e-9
    patience: int = 5

    def optimiser(self) -> Any:
        """Return optax's L-BFGS with the zoom line search."""
        return _optax().lbfgs(memory_size=self.memory)


@dataclasses.dataclass(frozen=True)
class Adam(FirstOrder):
    """Adam with a learning rate that follows a cosine down to zero.

    Parameters
    ----------
    rate : length of the first steps in x. A step of 1 changes a Positive parameter by a factor e.
    max_steps : number of steps until the rate is zero
    tolerance, patience : as in `LBFGS`
    """

    title: ClassVar[str] = "Adam"
    searches: ClassVar[bool] = False

    rate: float = 0.1
    max_steps: int = 3000
    tolerance: float = 1e-9
    patience: int = 200

    def optimiser(self) -> Any:
        """Return Adam with the cosine schedule of the learning rate."""
        return _optax().adam(_optax().cosine_decay_schedule(self.rate, self.max_steps))


def _optax() -> Any:
    # A late import, because optax takes a quarter of the time of `import fitting`.
    import optax

    return optax
