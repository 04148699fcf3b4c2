"""What a fit knows of its numbers, as the prior of another fit."""

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.constraints import is_number
from fitting.parameters.correlated import Correlated
from fitting.parameters.scenes import find, path_over
from fitting.uncertainty.intervals import SolvedProblem
from rubberfric.base import shown

_BODIES = ("lower", "upper")


def prior_of(solved: SolvedProblem, body: str | None = None, widen: float = 1.0) -> dict[str, Correlated]:
    """What a solved problem knows of its free numbers; see `joint_prior`.

    What its data leave open is known to a factor e^100, that is, not at all.
    """
    variables, constants = solved.problem.variables, solved.problem.numbers.constants
    scene = solved.problem.scene(jnp.asarray(solved.x))
    leaves, places = jax.tree.leaves(scene), np.full(variables.size, np.nan)
    low, high = np.full(variables.size, -np.inf), np.full(variables.size, np.inf)
    scale = np.ones(variables.size)
    for group in variables.own:
        part = slice(*group.slot)
        if group.kind == "Positive":
            low[part] = 0.0
        elif group.kind == "Bounded":
            low[part] = constants.low[part]
            high[part] = low[part] + np.asarray(constants.width[part])
        else:
            scale[part] = constants.width[part]
        over = None if group.elements is None else path_over(scene, group.path)
        if over is not None:
            places[part] = np.asarray(leaves[find(scene, over)[0]])[list(group.elements or ())]
    known = solved.uncertainty
    reach = scale * known.stretch
    return joint_prior(
        [group.path for group in variables.own],
        solved.problem.values(known.x),
        known.spread * np.outer(reach, reach),
        (low, high),
        places,
        body,
        widen,
    )


def joint_prior(
    paths: list[str],
    mean: np.ndarray,
    covariance: np.ndarray,
    limits: tuple[np.ndarray, np.ndarray],
    places: np.ndarray,
    body: str | None,
    widen: float,
) -> dict[str, Correlated]:
    """A joint normal distribution as an entry of the `prior` of `fitting.fit`.

    Parameters
    ----------
    paths : key paths of the numbers, each of one or more of them
    mean, covariance, limits, places : as of `Correlated`; limits (low, high)
    body : of the other scene, that the paths which begin with "lower" or "upper" are of there; None: the same
    widen : factor of all deviations
    """
    if not (is_number(widen) and widen > 0):
        raise ValueError(f"widen = {shown(widen)}: must be a number > 0")
    key = ", ".join(_moved(paths, body))
    columns = (mean, widen**2 * 0.5 * (covariance + covariance.T), *limits, places)
    return {key: Correlated(*(column.tolist() for column in columns))}


def _moved(paths, body):
    """Key paths in a scene whose solid is another body."""
    if body is None:
        return paths
    if not isinstance(body, str) or body.split(".")[-1] not in _BODIES:
        raise ValueError(f"body = {shown(body)}: must be 'lower', 'upper' or None")
    steps = [path.split(".") for path in paths]
    at = [next((i for i, step in enumerate(one) if step in _BODIES), None) for one in steps]
    named = {".".join(one[: i + 1]) for one, i in zip(steps, at, strict=True) if i is not None}
    if len(named) != 1:
        what = " and ".join(sorted(named)) or "none"
        raise ValueError(f"body = {body!r}: the fit's numbers are of {what}: must be of one body")
    pairs = zip(paths, steps, at, strict=True)
    return [path if i is None else ".".join([body, *one[i + 1 :]]) for path, one, i in pairs]
