"""Joint normal prior of several correlated numbers of a scene, for example the result of another fit."""

import dataclasses
import math

import jax
import jax.numpy as jnp
import numpy as np
import scipy

from fitting.parameters.scenes import find, path_over
from fitting.parameters.selection import STATIC, PriorContext, Selection
from fitting.parameters.variables import Array
from rubberfric.base import ArrayLike, shape_of

# Constant numbers are refused if their distance from the prior is less probable than this.
_CHANCE = 1e-3
# Relative difference of abscissae, such as relaxation times, due to rounding.
_SAME = 1e-6


@dataclasses.dataclass(frozen=True)
class Correlated:
    r"""Joint normal prior of several numbers of the scene, each transformed according to its limits.

    .. math:: r = C^{-1/2} (t(v) - t(mean)),\qquad t(v) = \ln\frac{v - low}{high - v},\;
              \ln(v - low),\; v

    for numbers with two limits, one limit and no limit, like the variables of Bounded, Positive and Free
    parameters. `as_prior` of a result creates such a prior. The key of the prior contains the paths of the
    numbers, separated by commas. If a fit keeps some of the numbers constant, the other numbers have the
    conditional distribution.

    Parameters
    ----------
    mean : means in the units of the numbers, shape (n,)
    covariance : covariance of t, shape (n, n)
    low, high : limits of every number, -inf and inf if there are none, shape (n,)
    places : abscissa of every number, such as its relaxation time, NaN if a number has none, shape (n,);
        or None. A scene with other abscissae is refused, because its numbers have another meaning.

    Examples
    --------
    The height from another measurement, with 10 %, and data that determine it to 20 % / sqrt(4):

    >>> scene, q = rf.load_scene("data/tread_on_asphalt.toml"), np.logspace(2.5, 4, 4)
    >>> C = rf.power_spectrum(scene.lower.spectrum, q)
    >>> data = fitting.SpectrumData(q, C, relative=0.4, body="lower")  # ln C = 2 ln h + ...
    >>> h = "lower.spectrum.h_rms"
    >>> prior = {h: fitting.Correlated([0.5e-3], [[0.1**2]], low=[0.0], high=[np.inf])}
    >>> result = fitting.fit(scene, data, {h: fitting.Positive()}, prior=prior)
    >>> round(float(result[h].stderr / result[h].value), 4)  # 0.1 / sqrt(2)
    0.0707
    """

    mean: ArrayLike
    covariance: ArrayLike
    low: ArrayLike
    high: ArrayLike
    places: ArrayLike | None = None

    def __post_init__(self) -> None:
        size = math.prod(shape_of(self.mean))
        names = ("mean", "covariance", "low", "high", *["places"] * (self.places is not None))
        for name in names:
            value, shape = getattr(self, name), (size, size) if name == "covariance" else (size,)
            try:
                numbers = np.asarray(value, float)
            except (TypeError, ValueError):
                numbers = np.empty(())
            if numbers.shape != shape or size == 0:
                raise ValueError(f"Correlated: {name} must be numbers of the shape {shape}")
            # Tuples, so that equal priors compare equal.
            object.__setattr__(
                self, name, tuple(tuple(row) if np.ndim(row) else float(row) for row in numbers)
            )
        C = np.array(self.covariance)
        if not (np.isfinite(C).all() and np.allclose(C, C.T, rtol=1e-6) and (np.diag(C) > 0).all()):
            raise ValueError("Correlated: covariance must be finite, symmetric, and > 0 on its diagonal")
        if np.any(np.isfinite(np.array(self.high)) & ~np.isfinite(np.array(self.low))):
            raise ValueError("Correlated: high must be inf where low is -inf")
        if not jnp.isfinite(coordinates(*map(np.array, (self.mean, self.low, self.high)))).all():
            raise ValueError("Correlated: mean must be finite and between low and high")

    def read(self, place: PriorContext) -> list["CorrelatedRows"]:
        """Return the rows of the prior, as a list with one entry."""
        where, chosen = place.where, place.selection(",", ", or several separated by commas")
        mean, low, high = (np.array(value) for value in (self.mean, self.low, self.high))
        if chosen.size != mean.size:
            raise ValueError(
                f"{where}: the key names {chosen.size} numbers, but the prior has {mean.size}; the scene must"
                " have the material, or the table, of the fit that the prior comes from"
            )
        self._check_places(place, chosen)
        start = np.asarray(chosen.of(place.start))
        t, centre = (np.asarray(coordinates(v, low, high)) for v in (start, mean))
        covariance = np.array(self.covariance)
        if not np.isfinite(t).all():
            i = int(np.flatnonzero(~np.isfinite(t))[0])
            raise ValueError(
                f"{where}: {chosen.names[i]} starts at {start[i]:g}: must be between {low[i]:g} and"
                f" {high[i]:g}"
            )
        held = np.flatnonzero(~chosen.changing(place.variables))
        if held.size:
            away = t[held] - centre[held]
            part = covariance[np.ix_(held, held)]
            far = away @ np.linalg.pinv(part, hermitian=True) @ away
            if scipy.special.gammaincc(held.size / 2, far / 2) < _CHANCE:
                i = held[int(np.argmax(np.abs(away) / np.sqrt(np.diag(part))))]
                raise ValueError(
                    f"{where}: {chosen.names[i]} is fixed at {start[i]:.6g}, but its prior mean is"
                    f" {mean[i]:.6g};"
                    " free it, or start from the scene of the fit that the prior comes from"
                )
        return [CorrelatedRows(chosen, centre, whitener(covariance), low, high)]

    def _check_places(self, place: PriorContext, chosen: Selection) -> None:
        """Raise ValueError unless every element has the abscissa that `places` states."""
        if self.places is None:
            return
        before, i = np.array(self.places), 0
        for path, elements in zip(chosen.paths, chosen.elements, strict=True):
            count, over = len(elements or (0,)), None if elements is None else path_over(place.scene, path)
            known = before[i : i + count]
            if over is not None and elements is not None and np.isfinite(known).all():
                here = np.asarray(place.start[find(place.scene, over)[0]])[list(elements)]
                if not np.allclose(here, known, rtol=_SAME, atol=0.0):
                    k = int(np.argmax(np.abs(here / known - 1)))
                    raise ValueError(
                        f"{place.where}: {path} had {over} = {known[k]:.6g}, but has {here[k]:.6g};"
                        " use the material, or the table, of the fit that the prior comes from"
                    )
            i += count


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class CorrelatedRows:
    """Rows that a `Correlated` prior adds to the residuals."""

    chosen: Selection = dataclasses.field(metadata=STATIC)
    centre: Array  # t(mean)
    whiten: Array  # C^(-1/2)
    low: Array
    high: Array

    @property
    def size(self) -> int:
        """Number of rows."""
        return self.chosen.size

    def rows(self, leaves: list[Array], x: jax.Array) -> jax.Array:
        """Return the residuals of the prior for the leaves of a scene, shape (size,)."""
        del x
        t = coordinates(self.chosen.of(leaves), self.low, self.high)
        return jnp.asarray(self.whiten) @ (t - self.centre)

    def moved(self, to: dict[int, int]) -> "CorrelatedRows":
        """Return the rows for a scene whose leaf i has the index to[i]."""
        return dataclasses.replace(self, chosen=self.chosen.moved(to))


def coordinates(v: Array, low: Array, high: Array) -> jax.Array:
    """Return the transformed values t(v) of a `Correlated` prior, not finite outside the limits."""
    floor, roof = jnp.isfinite(low), jnp.isfinite(high)
    # The branch that is not selected must have a finite derivative.
    above = jnp.log(jnp.where(floor, v - jnp.where(floor, low, 0.0), 1.0))
    below = jnp.log(jnp.where(roof, jnp.where(roof, high, 0.0) - v, 1.0))
    return jnp.where(floor, above - below, jnp.asarray(v))


def whitener(covariance: np.ndarray) -> np.ndarray:
    """Return W with W C W^T = 1 for a covariance C, whose deviations may differ by orders of magnitude."""
    size = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    # Smaller eigenvalues are rounding, if a number is an exact function of others.
    values = np.maximum(values, 1e-14 * values[-1])
    return (vectors / np.sqrt(values)).T / size
