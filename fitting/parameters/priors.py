"""Priors of a fit, and the rows that they add to the residuals.

`Gaussian` is for a free parameter, `Smooth` for a curve such as a relaxation spectrum, `Sum` for a sum such
as the glassy modulus, and `Correlated` (`fitting.parameters.correlated`) for the result of another fit.
"""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from fitting.parameters.constraints import FOLLOWING, is_number
from fitting.parameters.correlated import Correlated
from fitting.parameters.scenes import Scenes, find, owner_of, path_over
from fitting.parameters.selection import STATIC, PriorContext, Rows, Selection
from fitting.parameters.variables import Array, Constants, Variables, slopes_of, to_x
from rubberfric.base import unit_of

# Relative difference of a fixed number and the mean of its prior that rounding may cause.
_SAME = 1e-6


@dataclasses.dataclass(frozen=True)
class Gaussian:
    r"""Gaussian prior of a free parameter, with a mean and a standard deviation, in the fit's variable x.

    .. math:: r = (x - x(mean)) \, / \, (sigma \; dx/d value)

    Parameters
    ----------
    mean, sigma : mean and standard deviation in the parameter's unit, for all elements or for each element
        For a Positive parameter sigma / mean is the standard deviation of its logarithm.

    Notes
    -----
    On a number that is not free, the prior states its error. `mean` must be the number itself. The fit does
    not change, and `FitResult.budget` includes the error.

    Examples
    --------
    Data and prior with equal errors halve the variance, 5 % / sqrt(2):

    >>> scene, q = rf.load_scene("data/tread_on_asphalt.toml"), np.logspace(2.5, 4, 4)
    >>> C = rf.power_spectrum(scene.lower.spectrum, q)
    >>> data = fitting.SpectrumData(q, C, relative=0.2, body="lower")  # sigma(ln h) = 0.1 / sqrt(4)
    >>> h, prior = "lower.spectrum.h_rms", fitting.Gaussian(mean=0.5e-3, sigma=0.025e-3)
    >>> result = fitting.fit(scene, data, {h: fitting.Positive()}, prior={h: prior})
    >>> round(float(result[h].stderr / result[h].value), 4)
    0.0354
    """

    mean: float | tuple[float, ...] | np.ndarray
    sigma: float | tuple[float, ...] | np.ndarray

    def __post_init__(self) -> None:
        for name, rule in (("mean", ""), ("sigma", " > 0")):
            values = getattr(self, name)
            several = isinstance(values, np.ndarray | list | tuple) and np.ndim(values) == 1
            each: tuple[Any, ...] = tuple(values) if several else (values,)
            if not each or not all(is_number(x) and (x > 0 or not rule) for x in each):
                raise ValueError(f"Gaussian: {name} = {values!r}: must be a finite number{rule}")
            if several:
                object.__setattr__(self, name, tuple(map(float, each)))

    def read(self, place: PriorContext) -> list["GaussianRows"]:
        """Return the rows of the prior, as a list with one entry."""
        leaf, elements = find(place.scene, place.key)  # raises an error with similar paths
        group, variables, constants = place.group(), place.variables, place.constants
        if group is None and is_fixed(variables, leaf, elements):
            self._check_fixed(place, leaf, elements)
            return []
        if group is None or group.kind in FOLLOWING:
            known = ", ".join(g.path for g in variables.own)
            raise ValueError(f"{place.where}: the key must be one of the free parameters {known}")
        part = np.arange(*group.slot)
        for name in ("mean", "sigma"):
            size = np.size(getattr(self, name))
            if size not in (1, part.size):
                raise ValueError(f"{place.where}: {name} has {size} numbers: must have {part.size} or one")
        mean = np.broadcast_to(np.asarray(self.mean, float), part.shape)
        low, width = np.asarray(constants.low)[part], np.asarray(constants.width)[part]
        if group.kind == "Positive" and not (mean > 0).all():
            raise ValueError(f"{place.where}: mean = {mean.min():g}: must be > 0 for a Positive parameter")
        inside = (low < mean) & (mean < low + width)
        if group.kind == "Bounded" and not inside.all():
            bad = mean[np.argmin(inside)]
            raise ValueError(f"{place.where}: mean = {bad:g}: must be inside the parameter's bounds")
        at = to_x(group.kind, low, width, mean)
        sigma = np.asarray(self.sigma, float) / slopes_of(group.kind, width, at)
        return [GaussianRows(tuple(part.tolist()), at, sigma)]

    def _check_fixed(self, place: PriorContext, leaf: int, elements: tuple[int, ...] | None) -> None:
        """Raise ValueError unless the means are the fixed numbers, and there are as many sigma or one."""
        value = np.atleast_1d(np.asarray(place.start[leaf])[list(elements) if elements else ()])
        for name in ("mean", "sigma"):
            if np.size(getattr(self, name)) not in (1, value.size):
                raise ValueError(f"{place.where}: {name} must have {value.size} numbers or one")
        mean = np.broadcast_to(np.asarray(self.mean, float), value.shape)
        away = np.abs(mean - value) > _SAME * np.abs(value)
        if away.any():
            k = int(np.argmax(away))
            raise ValueError(
                f"{place.where}: mean = {mean[k]:g}, but the number is fixed at {value[k]:g}: must be this"
                " number, to state its error, or the number must be free"
            )


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class GaussianRows:
    """Rows that a `Gaussian` prior adds to the residuals."""

    elements: tuple[int, ...] = dataclasses.field(metadata=STATIC)  # in x
    mean: Array  # of x
    sigma: Array

    @property
    def size(self) -> int:
        """Number of rows."""
        return len(self.elements)

    def rows(self, leaves: list[Array], x: jax.Array) -> jax.Array:
        """Return the residuals of the prior at x, shape (size,)."""
        del leaves
        return (x[np.array(self.elements)] - self.mean) / self.sigma

    def moved(self, to: dict[int, int]) -> "GaussianRows":
        """Return the rows unchanged, because the residuals depend on x and not on leaves."""
        del to
        return self


def is_fixed(variables: Variables, leaf: int, elements: tuple[int, ...] | None) -> bool:
    """Return True if a fit changes none of the elements of a leaf."""
    chosen = set(elements or (None,))
    return all(g.leaf != leaf or chosen.isdisjoint(g.elements or (None,)) for g in variables.groups)


# Temperatures of a table span a small part of a decade, so u is T divided by this temperature [K].
_STEP = 10.0


@dataclasses.dataclass(frozen=True)
class Smooth:
    r"""Smoothness prior: the log-log slope of a vector y of the scene changes little along its abscissa x.

    .. math:: r_i = \frac{1}{sigma} \left( \frac{\ln y_{i+1} - \ln y_i}{u_{i+1} - u_i}
              - \frac{\ln y_i - \ln y_{i-1}}{u_i - u_{i-1}} \right),\qquad u = \log_{10} x

    Examples are E of a Prony series over tau, E' and E'' of a table over omega, C over q, and the factors of
    a softening over the strain. For a_T and b_T over the temperature, u = T / 10 K. The key is the path
    of a whole vector, or of several vectors separated by commas; each vector then has its own prior.

    Parameters
    ----------
    sigma : standard deviation of the change of d ln y / du from one interval to the next [-]

    Examples
    --------
    A table of C with 30 % scatter becomes almost a power law:

    >>> q = np.geomspace(1e3, 1e5, 9)
    >>> noisy = 1e-14 * (q / 1e3) ** -3.6 * np.exp(0.3 * np.random.default_rng(0).normal(size=9))
    >>> road = rf.Body(rf.Rigid(), rf.TabulatedSpectrum(q, noisy))
    >>> scene = rf.Scene(road, rf.Body(rf.Elastic(3e6, 0.5)))
    >>> data = fitting.SpectrumData(q, noisy, relative=0.3, body="lower")
    >>> prior = {"lower.spectrum.C": fitting.Smooth(sigma=0.1)}
    >>> C = fitting.fit(scene, data, {"lower.spectrum.C": fitting.Positive()}, prior=prior).values
    >>> [round(float(np.std(np.diff(np.log(y)) / np.diff(np.log(q)))), 1) for y in (noisy, C)]  # slopes
    [0.4, 0.0]
    """

    sigma: float = 1.0

    def __post_init__(self) -> None:
        if not (is_number(self.sigma) and self.sigma > 0):
            raise ValueError(f"Smooth: sigma = {self.sigma!r}: must be a finite number > 0")

    def read(self, place: PriorContext) -> list["SmoothRows"]:
        """Return the rows for every vector in the key."""
        rows = []
        for path in (path.strip() for path in place.key.split(",")):
            leaf, elements = find(place.scene, path)
            over = None if "[" in path or elements is None else path_over(place.scene, path)
            if over is None:
                raise ValueError(
                    f"{place.where}: Smooth must have the path of a whole vector with an abscissa,"
                    " such as E of a Prony series or storage of a table"
                )
            if not any(group.leaf == leaf for group in place.variables.groups):
                raise ValueError(f"{place.where}: the vector, or some of its elements, must be free")
            at, _ = find(place.scene, over)
            values, where = np.asarray(place.start[leaf]), np.asarray(place.start[at])
            if where.size < 3 or np.unique(where).size < where.size:
                raise ValueError(f"{place.where}: {over} must have at least three different numbers")
            if not (values > 0).all():
                raise ValueError(
                    f"{place.where}: {path} starts at {values.min():g}: must be > 0, because Smooth uses"
                    " logarithms"
                )
            owner, name = owner_of(place.scene, over)
            warm = unit_of(type(owner), name) == "K"
            rows.append(SmoothRows(leaf, at, values.size, warm, float(self.sigma)))
        return rows


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class SmoothRows:
    """Rows that a `Smooth` prior of one vector adds to the residuals."""

    leaf: int = dataclasses.field(metadata=STATIC)  # index of the leaf with the vector
    over: int = dataclasses.field(metadata=STATIC)  # index of the leaf with the abscissa
    count: int = dataclasses.field(metadata=STATIC)  # elements of the vector
    warm: bool = dataclasses.field(metadata=STATIC)  # True if the abscissa is a temperature
    sigma: Any

    @property
    def size(self) -> int:
        """Number of rows."""
        return self.count - 2

    def rows(self, leaves: list[Array], x: jax.Array) -> jax.Array:
        """Return the residuals of the prior for the leaves of a scene, shape (size,)."""
        del x
        at = jnp.asarray(leaves[self.over])
        order = jnp.argsort(at)
        u = at[order] / _STEP if self.warm else jnp.log10(at[order])
        return jnp.diff(jnp.diff(jnp.log(jnp.asarray(leaves[self.leaf])[order])) / jnp.diff(u)) / self.sigma

    def moved(self, to: dict[int, int]) -> "SmoothRows":
        """Return the rows for a scene whose leaf i has the index to[i]."""
        return dataclasses.replace(self, leaf=to[self.leaf], over=to[self.over])


@dataclasses.dataclass(frozen=True)
class Sum:
    r"""Prior that keeps the sum s of several numbers of the scene within soft limits.

    .. math:: r = \frac{\max(\ln s - \ln high,\, 0) - \max(\ln low - \ln s,\, 0)}{sigma}

    The residual r is zero within the limits; beyond a limit the prior is Gaussian in ln s. The key contains
    the paths of the summands, separated by "+". All elements of a vector are added:
    {"upper.material.E_inf + upper.material.E": Sum(high=2e9)} keeps the glassy modulus of a Prony series
    below 2 GPa.

    Parameters
    ----------
    low, high : limits in the unit of the numbers, > 0, low < high; None: no limit on this side
    sigma : relative uncertainty of the limits [-]

    Examples
    --------
    E' and E'' of a glassy modulus of 22 MPa. The prior lowers it towards its limit of 20 MPa +- 5 %:

    >>> omega, scene = np.logspace(0, 6, 13), rf.load_scene("data/tread_on_asphalt.toml")
    >>> E = np.asarray(rf.complex_modulus(rf.Prony(1e6, [21e6], [1e-3]), omega))
    >>> data = fitting.ModulusData(omega, E.real, E.imag, relative=0.1, body="upper")
    >>> scene = scene.replace("upper.material", rf.Prony(1e6, [2e7], [1e-3]))
    >>> free = {f"upper.material.{name}": fitting.Positive() for name in ("E_inf", "E")}
    >>> prior = {"upper.material.E_inf + upper.material.E": fitting.Sum(high=20e6)}
    >>> rubber = fitting.fit(scene, data, free, prior=prior).scene.upper.material
    >>> bool(20e6 < rubber.E_inf + rubber.E[0] < 22e6)
    True
    """

    low: float | None = None
    high: float | None = None
    sigma: float = 0.05

    def __post_init__(self) -> None:
        limits = [limit for limit in (self.low, self.high) if limit is not None]
        if not limits or not all(is_number(limit) and limit > 0 for limit in limits):
            raise ValueError(
                f"Sum: low = {self.low!r}, high = {self.high!r}: must be numbers > 0, at least one of them"
                " given"
            )
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise ValueError(f"Sum: low = {self.low!r}, high = {self.high!r}: must be low < high")
        if not (is_number(self.sigma) and self.sigma > 0):
            raise ValueError(f"Sum: sigma = {self.sigma!r}: must be a finite number > 0")

    def read(self, place: PriorContext) -> list["SumRows"]:
        """Return the row of the prior, as a list with one entry."""
        chosen = place.selection("+", " or a sum with some")
        start = float(np.sum(np.asarray(chosen.of(place.start))))
        if not start > 0:
            raise ValueError(f"{place.where}: the sum starts at {start:g}: must be > 0")
        low = -np.inf if self.low is None else float(np.log(self.low))
        high = np.inf if self.high is None else float(np.log(self.high))
        return [SumRows(chosen, low, high, float(self.sigma))]


@jax.tree_util.register_dataclass
@dataclasses.dataclass(frozen=True)
class SumRows:
    """Row that a `Sum` prior adds to the residuals."""

    chosen: Selection = dataclasses.field(metadata=STATIC)
    low: Any  # ln low
    high: Any  # ln high
    sigma: Any

    @property
    def size(self) -> int:
        """Number of rows."""
        return 1

    def rows(self, leaves: list[Array], x: jax.Array) -> jax.Array:
        """Return the residual of the prior for the leaves of a scene, shape (1,)."""
        del x
        log_sum = jnp.log(jnp.sum(self.chosen.of(leaves)))
        beyond = jnp.maximum(log_sum - self.high, 0.0) - jnp.maximum(self.low - log_sum, 0.0)
        return (beyond / self.sigma)[None]

    def moved(self, to: dict[int, int]) -> "SumRows":
        """Return the rows for a scene whose leaf i has the index to[i]."""
        return dataclasses.replace(self, chosen=self.chosen.moved(to))


Prior = Gaussian | Smooth | Sum | Correlated
PRIORS: dict[str, type[Prior]] = {cls.__name__: cls for cls in (Gaussian, Smooth, Sum, Correlated)}


def read_priors(
    scene: Scenes, variables: Variables, constants: Constants, prior: Mapping[str, Prior] | None
) -> tuple[Rows, ...]:
    """Return the rows that the priors of a fit add to the residuals."""
    rows: list[Rows] = []
    for key, rule in (prior or {}).items():
        where = f"prior[{key!r}]"
        if not isinstance(rule, tuple(PRIORS.values())):
            raise ValueError(f"{where} = {rule!r}: must be Gaussian, Smooth, Sum or Correlated")
        rows += rule.read(PriorContext(where, key, scene, variables, constants))
    return tuple(rows)


def prior_residuals(priors: tuple[Rows, ...], scene: Scenes, x: jax.Array) -> jax.Array:
    """Return the residuals of all priors at x in one array, in the order of the priors."""
    leaves = jax.tree.leaves(scene) if priors else []
    return jnp.concatenate([jnp.zeros(0, x.dtype), *(prior.rows(leaves, x) for prior in priors)])


def prior_size(priors: tuple[Rows, ...]) -> int:
    """Return the number of rows of priors that count as data. A `Sum` is zero within its limits."""
    return sum(prior.size for prior in priors if not isinstance(prior, SumRows))
