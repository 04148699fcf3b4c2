r"""Draws from the posterior of a fit by the No-U-Turn sampler.

[Hoffman & Gelman, J. Mach. Learn. Res. 15 (2014) 1593, arXiv:1111.4246; numpyro: Phan, Pradhan & Jankowiak,
arXiv:1912.11554]

The density is that of `fitting.log_density`: the fit's own residuals, errors, loss, priors and bounds. The
sampler sees z of x = x_fit + L z, where L L^T is the covariance of the fit (its Laplace approximation), so
that it starts with the right metric; chains start from draws of that approximation.

It needs numpyro: pip install 'rubberfric[sampling]'.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import numpy as np
import scipy

from fitting.solvers.problem import Numbers, Structure, Targets
from fitting.solvers.residuals import padded
from fitting.uncertainty.covariance import OPEN
from fitting.uncertainty.density import density_at
from fitting.uncertainty.intervals import SolvedProblem

# Called as callback(chain, draw), warm-up included, after every draw.
Progress = Callable[[int, int], object]

# Halvings of the way to a chain's start, until the model is finite there.
_HALVINGS = 20
# Of a direction that the data leave open: a part in it that matters.
_PART = 0.1


class Chains(NamedTuple):
    """Draws by chain, without the warm-up."""

    x: np.ndarray  # shape (chains, draws, size)
    log_density: np.ndarray  # but for a constant, shape (chains, draws)
    diverging: np.ndarray  # whether the trajectory left what the steps resolve, shape (chains, draws)
    accepted: np.ndarray  # mean acceptance probability, shape (chains, draws)
    steps: np.ndarray  # evaluations of the density and its gradient, shape (chains, draws)


class _Laplace(NamedTuple):
    """x = centre + root z; a pytree."""

    centre: Any
    root: Any


def run_chains(
    solved: SolvedProblem,
    flat: str,
    draws: int,
    warmup: int,
    chains: int,
    key: jax.Array,
    callback: Progress | None = None,
) -> Chains:
    """Draws from the posterior of a fit; see `fitting.FitResult.sample` for the arguments.

    Raises
    ------
    ModuleNotFoundError : numpyro is not installed; the message says how to install it.
    ValueError : the data and priors leave a direction open, along which the density has no finite integral.
    """
    numpyro = _numpyro()
    check_proper(solved, flat)
    known, of = solved.uncertainty, padded(solved.problem)
    covariance = known.spread * np.outer(known.stretch, known.stretch)
    dtype = of.targets.measured.dtype
    laplace = _Laplace(known.x.astype(dtype), np.linalg.cholesky(covariance).astype(dtype))
    fixed = (numpyro, of.structure, flat, warmup), (of.numbers, of.targets, laplace)
    found = [
        _chain(fixed, number, own, draws, warmup, callback)
        for number, own in enumerate(jax.random.split(key, chains))
    ]
    z, energy, *rest = (np.stack(column) for column in zip(*found, strict=True))
    x = laplace.centre + z @ laplace.root.T
    return Chains(x, -energy, *rest)


def check_proper(solved: SolvedProblem, flat: str) -> None:
    """ValueError if the density does not fall off along a direction that the data leave open."""
    known, variables = solved.uncertainty, solved.problem.variables
    bounded = np.zeros(variables.size, bool)
    for group in variables.own:
        bounded[slice(*group.slot)] = group.kind == "Bounded" and flat == "values"
    for number, direction in enumerate(known.unidentified, 1):
        if direction.deviation > OPEN and np.abs(direction.loadings[~bounded]).max(initial=0.0) > _PART:
            raise ValueError(
                f"sample: direction {number} is left open, {direction.text}: must be closed by a prior"
                " (Gaussian), or a number held; a Bounded one is safe with flat='values'"
            )


def diagnosed(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R-hat and effective number of draws of every number, of normalised ranks, (size,) each.

    Chains are split in two [Vehtari, Gelman, Simpson, Carpenter & Buerkner, Bayesian Anal. 16 (2021) 667,
    arXiv:1903.08008].

    Parameters
    ----------
    x : draws, shape (chains, draws, size)
    """
    from numpyro.diagnostics import effective_sample_size, split_gelman_rubin

    chains, draws, size = x.shape
    rank = scipy.stats.rankdata(x.reshape(-1, size), axis=0).reshape(x.shape)
    normal = scipy.special.ndtri((rank - 0.375) / (chains * draws + 0.25))
    return np.asarray(split_gelman_rubin(normal)), np.asarray(effective_sample_size(normal))


def _chain(fixed, number, key, draws, warmup, callback):
    """One chain: z, potential energy, diverging, acceptance and steps of its draws."""
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


def _numpyro() -> Any:
    """The sampler's module."""
    try:
        from numpyro import infer
    except ModuleNotFoundError:
        raise ModuleNotFoundError(
            "sample needs numpyro, which is not installed: pip install 'rubberfric[sampling]'"
        ) from None
    return infer


def _energy(structure: Structure, flat: str, numbers: Numbers, targets: Targets, laplace: _Laplace, z):
    """Minus the log density at z."""
    return -density_at(structure, flat, numbers, targets, laplace.centre + laplace.root @ z)


_potential = jax.jit(_energy, static_argnums=(0, 1))


def _kernel(infer, structure, flat, warmup, numbers, targets, laplace, key, z):
    """The sampler and its state at z; made anew while tracing, so that other numbers compile nothing."""
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
