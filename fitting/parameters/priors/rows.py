"""What is known before the data: rows that stand beside the residuals."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from fitting.parameters.priors.correlated import Correlated
from fitting.parameters.priors.gaussian import Gaussian
from fitting.parameters.priors.selection import Place, Rows
from fitting.parameters.priors.smooth import Smooth
from fitting.parameters.priors.sums import Sum, SumRows
from fitting.parameters.scenes import Scenes
from fitting.parameters.variables import Constants, Variables

Prior = Gaussian | Smooth | Sum | Correlated
PRIORS: dict[str, type[Prior]] = {cls.__name__: cls for cls in (Gaussian, Smooth, Sum, Correlated)}


class PriorStructure(NamedTuple):
    """Structure of the priors; hashable."""

    terms: tuple[Rows, ...]

    def moved(self, to: dict[int, int]) -> "PriorStructure":
        """The same of a scene whose leaves are elsewhere."""
        return PriorStructure(tuple(term.moved(to) for term in self.terms))


# Numbers of the priors, one pytree for each term.
PriorNumbers = tuple[Any, ...]


def read_priors(
    scene: Scenes, variables: Variables, constants: Constants, prior: Mapping[str, Prior] | None
) -> tuple[PriorStructure, PriorNumbers]:
    """Structure and numbers of the priors of a fit; ValueError naming the path that is wrong."""
    terms, numbers = [], []
    for key, rule in (prior or {}).items():
        where = f"prior[{key!r}]"
        if not isinstance(rule, tuple(PRIORS.values())):
            raise ValueError(f"{where} = {rule!r}: must be Gaussian, Smooth, Sum or Correlated")
        for term, own in rule.read(Place(where, key, scene, variables, constants)):
            terms.append(term)
            numbers.append(own)
    return PriorStructure(tuple(terms)), tuple(numbers)


def prior_residuals(
    structure: PriorStructure, numbers: PriorNumbers, scene: Scenes, x: jax.Array
) -> jax.Array:
    """Rows of the priors at x, shape (rows,), in the order in which they were given."""
    leaves = jax.tree.leaves(scene) if structure.terms else []
    rows = [term.rows(own, leaves, x) for term, own in zip(structure.terms, numbers, strict=True)]
    return jnp.concatenate(rows) if rows else jnp.zeros(0, x.dtype)


def prior_size(structure: PriorStructure) -> int:
    """Number of rows that say something wherever the fit is, which those of sums do not."""
    return sum(term.size for term in structure.terms if not isinstance(term, SumRows))
