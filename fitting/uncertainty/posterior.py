r"""The posterior of a fit: its log density, draws by the No-U-Turn sampler, and the prior of another fit.

.. math:: \ln p(x \,|\, data) = -\frac12 \sum_i \rho(r_i^2) - \frac12 \sum_k p_k^2 + const

over the unbounded variables x of the fit (`fitting.parameters.variables`). Other samplers that take an
unconstrained log density and its gradient, such as blackjax, can use this density.

`run_chains` draws by the No-U-Turn sampler [Hoffman & Gelman, J. Mach. Learn. Res. 15 (2014) 1593,
arXiv:1111.4246; numpyro: Phan, Pradhan & Jankowiak, arXiv:1912.11554] in z, with x = x_fit + L z and L L^T
the covariance of the fit (its Laplace approximation), so it starts with a suitable metric. Chains start from
draws of the Laplace approximation, which `prior_of` gives as the prior of another fit.
"""

import dataclasses
import functools
import importlib
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.correlated import Correlated
from fitting.parameters.scenes import find, path_over
from fitting.parameters.variables import Array
from fitting.solvers.options import check_options
from fitting.solvers.problem import FitStructure, Numbers, Problem, Targets
from fitting.solvers.residuals import cost, padded
from fitting.uncertainty.covariance import OPEN
from fitting.uncertainty.intervals import SolvedProblem
from rubberfric.base import shown

# Called as callback(chain, draw), warm-up included, after every draw.
DrawProgress = Callable[[int, int], object]

# Greatest number of halvings of a chain's start towards the fit, until the model is finite there.
_HALVINGS = 20
# Least loading of a parameter in an unidentified direction that matters.
_PART = 0.1
_BODIES = ("lower", "upper")


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class LogDensity:
    """Log density of the free parameters of a fit, a function of x of shape (n,), made by `log_density`.

    A call returns the log density up to a constant, also inside jit, vmap and grad.

    Examples
    --------
    >>> scene, q = rf.load_scene("data/tread_on_asphalt.toml"), np.logspace(2.5, 4, 4)
    >>> C = rf.power_spectrum(scene.lower.spectrum, q)
    >>> data = fitting.SpectrumData(q, C, relative=0.2, body="lower")
    >>> density = fitting.log_density(fitting.fit(scene, data, {"lower.spectrum.h_rms": fitting.Positive()}))
    >>> density.names, density.values(np.log([0.5e-3])).round(9)
    (('lower.spectrum.h_rms',), array([0.0005]))
    >>> float(density.scene(np.log([0.6e-3])).lower.spectrum.hurst)
    0.8
    """

    problem: Problem
    flat: str

    def __call__(self, x: Array) -> jax.Array:
        """Return the log density at x, shape (n,), up to a constant."""
        structure, numbers, targets, _ = padded(self.problem)
        return _density(structure, self.flat, numbers, targets, jnp.asarray(x))

    @property
    def names(self) -> tuple[str, ...]:
        """Key path of every element of x."""
        return self.problem.names

    def values(self, x: Array) -> np.ndarray:
        """Return the values of the free elements at x. Values and x have the shape (..., n)."""
        return self.problem.values(x)

    def scene(self, x: Array) -> Any:
        """Return the scene, or a dict of scenes by name, with the free elements at x of shape (n,)."""
        return self.problem.scene(x)


def log_density(result: SolvedProblem, flat: str = "x") -> LogDensity:
    r"""Return the log density of the free parameters of a fit, given its data and priors.

    .. math:: \ln p(x) = -cost(x) \qquad\text{or}\qquad
              \ln p(x) = -cost(x) + \sum_k \ln\left|\frac{d\,value_k}{dx_k}\right|

    Parameters
    ----------
    result : FitResult
        fit whose data, errors (given or estimated), loss and priors are used.
    flat : "x" or "values"
        the variable in which a parameter without a prior is uniform: the fit's variable (the
        logarithm of a Positive parameter, the logit of a Bounded one), or the value itself. With "x"
        the density is highest at the fit, and its Gaussian approximation has the covariance of the fit.

    Returns
    -------
    LogDensity : a function of x, shape (len(result.names),), with `names`, `values(x)` and `scene(x)`

    Notes
    -----
    The integral of the density may be infinite: along unidentified directions (`result.unidentified`) it does
    not decrease, and a sampler diverges. Give such parameters a Gaussian prior, or fix them. For Bounded
    parameters the integral is finite with "values". For a robust loss the width of exp(-cost) differs from
    the fit's standard errors, which treat outliers differently.

    Examples
    --------
    One standard error from the minimum, the density is lower by exp(-1/2):

    >>> scene, q = rf.load_scene("data/tread_on_asphalt.toml"), np.logspace(2.5, 4, 4)
    >>> C = rf.power_spectrum(scene.lower.spectrum, q)
    >>> data = fitting.SpectrumData(q, C, relative=0.2, body="lower")
    >>> result = fitting.fit(scene, data, {"lower.spectrum.h_rms": fitting.Positive()})
    >>> density = fitting.log_density(result)
    >>> round(float(density(result.x + 0.05) - density(result.x)), 6)
    -0.5
    """
    check_options(flat=flat)
    return LogDensity(result.problem, flat)


def _log_slopes(variables, width, x):
    """Return the sum of ln |d value / d x|, computed in logarithms because slopes may underflow."""
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
    structure: FitStructure, flat: str, numbers: Numbers, targets: Targets, x: jax.Array
) -> jax.Array:
    """Return the log density from the parts of a problem, for use inside other compiled functions."""
    density = -cost(structure, numbers, targets, x)
    if flat == "x":
        return density
    return density + _log_slopes(structure.variables, numbers.constants.width, x)


# One compiled function for all results, so that a second density of the same kind compiles nothing.
_density = jax.jit(density_at, static_argnums=(0, 1))


class _Laplace(NamedTuple):
    """Laplace approximation of a posterior, x = centre + root z, as a pytree."""

    centre: Any
    root: Any


def run_chains(
    solved: SolvedProblem,
    flat: str,
    draws: int,
    warmup: int,
    chains: int,
    key: jax.Array,
    callback: DrawProgress | None = None,
) -> dict[str, np.ndarray]:
    """Return the draws of all chains from the posterior of a fit, without the warm-up, as in `Samples`."""
    numpyro = _installed("numpyro", "numpyro.infer")
    _installed("arviz-stats", "arviz_stats.base")
    check_proper(solved, flat)
    known, of = solved.uncertainty, padded(solved.problem)
    covariance = known.spread * np.outer(known.stretch, known.stretch)
    dtype = of.targets.measured.dtype
    laplace = _Laplace(known.x.astype(dtype), np.linalg.cholesky(covariance).astype(dtype))
    fixed = (numpyro, of.structure, flat, warmup), (of.numbers, of.targets, laplace)
    pieces = [
        _chain(fixed, number, own, draws, warmup, callback)
        for number, own in enumerate(jax.random.split(key, chains))
    ]
    z, energy, *rest = (np.stack(column) for column in zip(*pieces, strict=True))
    draws_of = {"x": laplace.centre + z @ laplace.root.T, "log_density": -energy}
    return draws_of | dict(zip(("diverging", "accepted", "steps"), rest, strict=True))


def check_proper(solved: SolvedProblem, flat: str) -> None:
    """Raise ValueError if the density does not decrease along an unidentified direction."""
    known, kinds = solved.uncertainty, np.array(solved.problem.variables.kinds)
    bounded = (kinds == "Bounded") & (flat == "values")
    for number, direction in enumerate(known.unidentified, 1):
        if direction.deviation > OPEN and np.abs(direction.loadings[~bounded]).max(initial=0.0) > _PART:
            raise ValueError(
                f"sample: direction {number} is not determined: {direction.text}. Give its parameters a"
                " Gaussian prior, or bounds and flat='values'"
            )


def diagnosed(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return R-hat and bulk effective sample size of every parameter, for draws x (chains, draws, size).

    R-hat of arviz-stats is the larger of rank-normalised split R-hat and its folded version, which compares
    the spread of the chains [Vehtari, Gelman, Simpson, Carpenter & Buerkner, Bayesian Anal. 16 (2021) 667,
    arXiv:1903.08008].
    """
    stats, half = _installed("arviz-stats", "arviz_stats.base").array_stats, x.shape[1] // 2
    if len(x) == 1:  # arviz-stats needs two chains
        x = np.concatenate([x[:, :half], x[:, -half:]])
    axes = {"chain_axis": 0, "draw_axis": 1}
    return np.asarray(stats.rhat(x, **axes)), np.asarray(stats.ess(x, **axes))


def _chain(fixed, number, key, draws, warmup, callback):
    """Run one chain, and return z, energy, divergence, acceptance probability and steps of every draw."""
    static, numbers = fixed
    to_start, to_run = jax.random.split(key)
    z = jax.random.normal(to_start, numbers[-1].centre.shape, numbers[-1].centre.dtype)
    for _ in range(_HALVINGS):
        if np.isfinite(_potential(*static[1:3], *numbers, z)):
            break
        z = z / 2
    state, kept = _begin(*static, *numbers, to_run, z), []
    for i in range(warmup + draws):
        state = _draw(*static, *numbers, state)
        if i >= warmup:
            kept.append(
                (state.z, state.potential_energy, state.diverging, state.accept_prob, state.num_steps)
            )
        if callback is not None:
            callback(number, i + 1)
    return [np.array(jax.device_get(column)) for column in zip(*kept, strict=True)]


def _installed(package: str, module: str) -> Any:
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError:
        raise ModuleNotFoundError(
            f"sample needs {package}, which is not installed: pip install 'rubberfric[sampling]'"
        ) from None


def _energy(structure: FitStructure, flat: str, numbers: Numbers, targets: Targets, laplace: _Laplace, z):
    return -density_at(structure, flat, numbers, targets, laplace.centre + laplace.root @ z)


_potential = jax.jit(_energy, static_argnums=(0, 1))


def _kernel(infer, structure, flat, warmup, numbers, targets, laplace, key, z):
    """Return the sampler, built during tracing so that other numbers compile nothing, and its state at z."""
    kernel = infer.NUTS(
        potential_fn=lambda z: _energy(structure, flat, numbers, targets, laplace, z), dense_mass=True
    )
    return kernel, kernel.init(key, warmup, z, model_args=(), model_kwargs={})


@functools.partial(jax.jit, static_argnums=(0, 1, 2, 3))
def _begin(infer, structure, flat, warmup, numbers, targets, laplace, key, z):
    return _kernel(infer, structure, flat, warmup, numbers, targets, laplace, key, z)[1]


@functools.partial(jax.jit, static_argnums=(0, 1, 2, 3))
def _draw(infer, structure, flat, warmup, numbers, targets, laplace, state):
    kernel, _ = _kernel(infer, structure, flat, warmup, numbers, targets, laplace, state.rng_key, state.z)
    return kernel.sample(state, (), {})


def prior_of(solved: SolvedProblem, body: str | None = None, widen: float = 1.0) -> dict[str, Correlated]:
    """Return the Laplace approximation of a solved problem as a prior. See `joint_prior`.

    Unidentified directions get a standard deviation of 100 in x, which is practically no prior.
    """
    variables, constants = solved.problem.variables, solved.problem.numbers.constants
    kinds, start, width = np.array(variables.kinds), np.asarray(constants.low), np.asarray(constants.width)
    low = np.where(kinds == "Free", -np.inf, start)
    high = np.where(kinds == "Bounded", start + width, np.inf)
    scale = np.where(kinds == "Free", width, 1.0)
    scene = solved.problem.scene(jnp.asarray(solved.x))
    leaves, places = jax.tree.leaves(scene), np.full(variables.size, np.nan)
    for group in variables.own:
        over = None if group.elements is None else path_over(scene, group.path)
        if over is not None:
            abscissa = np.asarray(leaves[find(scene, over)[0]])
            places[slice(*group.slot)] = abscissa[list(group.elements or ())]
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
    """Return a joint normal distribution as an entry of the `prior` of `fitting.fit`.

    `paths` name one or more elements each. The following arguments are as in `Correlated`, with limits =
    (low, high), the last two as in `FitResult.as_prior`.
    """
    check_options(widen=widen)
    key = ", ".join(_moved(paths, body))
    columns = (mean, widen**2 * 0.5 * (covariance + covariance.T), *limits, places)
    return {key: Correlated(*(column.tolist() for column in columns))}


def _moved(paths, body):
    """Return the key paths for a scene in which the fitted solid is the body `body`."""
    if body is None:
        return paths
    if not isinstance(body, str) or body.split(".")[-1] not in _BODIES:
        raise ValueError(f"body = {shown(body)}: must be 'lower', 'upper' or None")
    steps = [path.split(".") for path in paths]
    at = [next((i for i, step in enumerate(names) if step in _BODIES), None) for names in steps]
    named = {".".join(names[: i + 1]) for names, i in zip(steps, at, strict=True) if i is not None}
    if len(named) != 1:
        what = " and ".join(sorted(named)) or "none"
        raise ValueError(
            f"body = {body!r}: the fit has parameters of {what}, but all must belong to one body"
        )
    pairs = zip(paths, steps, at, strict=True)
    return [path if i is None else ".".join([body, *names[i + 1 :]]) for path, names, i in pairs]
