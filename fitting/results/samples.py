"""Draws from the posterior of a fit, their diagnostics, quantiles and bands."""

import dataclasses
import time
from collections.abc import Sequence
from typing import Any, Self

import h5py
import jax
import jax.numpy as jnp
import numpy as np

from fitting.results import hdf5 as fit_files
from fitting.results.record import FitRecord
from fitting.results.report import aligned_table
from fitting.solvers.options import check_options
from fitting.uncertainty.intervals import Band
from fitting.uncertainty.posterior import DrawProgress, diagnosed, run_chains
from rubberfric.base import ArrayLike, StrPath, html, optional_library, quick_jit
from rubberfric.io import hdf5

# R-hat below which draws are reliable [Vehtari, Gelman, Simpson, Carpenter & Buerkner, Bayesian Anal. 16
# (2021) 667, arXiv:1903.08008].
_RHAT = 1.01
# Effective sample size per chain above which draws are reliable (Vehtari et al.).
_ESS = 100.0
# Default levels of quantiles: the median and the ends of a 95 % interval.
_QUANTILES = (0.025, 0.5, 0.975)
# Arrays of a file with a value for every draw.
_ARRAYS = ("log_density", "diverging", "accepted", "steps")


@dataclasses.dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Samples:
    """Draws from the posterior of a fit, made by `FitResult.sample`.

    Attributes
    ----------
    fit : fit whose posterior was sampled
    x : draws in the variables of the solver, shape (chains, draws, size)
    values : draws of the free numbers, in their units, shape (chains, draws, size)
    log_density : up to a constant, shape (chains, draws)
    diverging, accepted, steps : for each draw, True if its trajectory diverged, its mean acceptance
        probability, and its number of evaluations of the density, shape (chains, draws)
    rhat : rank-normalised split R-hat of every parameter, 1 if the chains agree, shape (size,)
    ess : bulk effective sample size of every parameter, shape (size,)
    flat : variable in which parameters without a prior have a flat density, "x" or "values"
    warmup : discarded draws of each chain
    seconds : wall time
    """

    fit: FitRecord
    x: np.ndarray
    log_density: np.ndarray
    diverging: np.ndarray
    accepted: np.ndarray
    steps: np.ndarray
    rhat: np.ndarray
    ess: np.ndarray
    flat: str
    warmup: int
    seconds: float

    @property
    def names(self) -> tuple[str, ...]:
        """Key path of every free number."""
        return self.fit.names

    @property
    def values(self) -> np.ndarray:
        """Draws of the free numbers, shape (chains, draws, size)."""
        return self.fit.problem.values(self.x)

    @property
    def mean(self) -> np.ndarray:
        """Means of the values, shape (size,)."""
        return self._rows.mean(0)

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the values, shape (size, size)."""
        return np.cov(self._rows, rowvar=False).reshape(self._rows.shape[1], -1)

    @property
    def stderr(self) -> np.ndarray:
        """Standard deviations of the values, shape (size,)."""
        return self._rows.std(0, ddof=1)

    @property
    def _rows(self) -> np.ndarray:
        values = self.values
        return values.reshape(-1, values.shape[-1])

    @property
    def reliable(self) -> bool:
        """True if R-hat < 1.01, the effective sample size is > 100 per chain, and no trajectory diverged."""
        return not self._warnings()

    def quantiles(self, levels: Sequence[float] | float = _QUANTILES) -> np.ndarray:
        """Return quantiles of the values at levels within 0 ... 1.

        The result has the shape (levels, size), or (size,) if `levels` is a number.
        """
        asked = np.asarray(levels, float)
        if not ((asked >= 0) & (asked <= 1)).all():
            raise ValueError(f"levels = {asked.tolist()}: must be within 0 ... 1")
        return np.quantile(self._rows, asked, axis=0)

    def interval(self, level: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Return the lower and the upper ends of the central intervals of all values, of shape (size,)."""
        check_options(level=level)
        low, high = self.quantiles((0.5 - 0.5 * level, 0.5 + 0.5 * level))
        return low, high

    def band(
        self,
        velocity: ArrayLike,
        pressure: ArrayLike,
        temperature: ArrayLike | None = None,
        quantity: str = "friction",
        level: float = 0.95,
        draws: int = 200,
        scene: str | None = None,
    ) -> Band:
        """Return the median prediction of the draws, and a central band with the share `level` of the draws.

        Parameters
        ----------
        velocity, pressure, temperature, quantity, scene : as for `FitResult.band`
        level : share of the draws within the band
        draws : number of draws to use, evenly spaced
        """
        check_options(level=level, count=draws)
        x = self.x.reshape(-1, self.x.shape[-1])
        x = x[np.linspace(0, len(x) - 1, min(draws, len(x))).astype(int)]
        at = velocity, pressure, temperature

        def predicted(x):
            return self.fit.predicted(x, at, quantity, scene)

        curves = np.asarray(quick_jit()(lambda x: jax.lax.map(predicted, x))(jnp.asarray(x)))
        low, value, high = np.quantile(curves, (0.5 - 0.5 * level, 0.5, 0.5 + 0.5 * level), axis=0)
        return Band(value, low, high)

    def to_dataframe(self) -> Any:
        """Return a pandas.DataFrame: chain, draw, one column for each free number, and log_density."""
        chains, draws, _ = self.x.shape
        columns = {"chain": np.repeat(np.arange(chains), draws), "draw": np.tile(np.arange(draws), chains)}
        columns |= dict(zip(self.names, self._rows.T, strict=True))
        return optional_library("pandas").DataFrame(columns | {"log_density": self.log_density.ravel()})

    def report(self) -> str:
        """Return text of several lines with diagnostics of the draws and quantiles of all parameters."""
        chains, draws, _ = self.x.shape
        lines = [
            f"{chains * draws} draws of {chains} chain{'s' * (chains > 1)}, flat in {self.flat}",
            *(f"    NOT RELIABLE: {text}" for text in self._warnings()),
            f"    largest R-hat {self.rhat.max():.4f}, smallest effective number {self.ess.min():.0f}",
        ]
        heading = ("", "2.5 %", "median", "97.5 %", "fit", "R-hat", "effective")
        lines += [f"    {line}" for line in aligned_table([heading, *self._table()])]
        return "\n".join(lines) + "\n"

    def _repr_html_(self) -> str:
        headings = ("parameter", "2.5 %", "median", "97.5 %", "fit", "R-hat", "effective draws")
        chains, draws, _ = self.x.shape
        caption = "; ".join(self._warnings()) or f"{chains * draws} draws of {chains} chains"
        return html.table(self._table(), headings, caption)

    def __repr__(self) -> str:
        chains, draws, size = self.x.shape
        said = "" if self.reliable else ", not reliable"
        return f"<Samples: {chains} chains of {draws} draws, {size} numbers{said}>"

    def _table(self):
        columns = (*self.quantiles(), self.fit.values)
        return [
            (name, *(f"{column[i]:.5g}" for column in columns), f"{self.rhat[i]:.4f}", f"{self.ess[i]:.0f}")
            for i, name in enumerate(self.names)
        ]

    def _warnings(self):
        """Return the reasons why the draws are unreliable, with advice, one line of text per reason."""
        warnings, chains = [], self.x.shape[0]
        worst = int(np.argmax(self.rhat))
        if not self.rhat[worst] < _RHAT:
            warnings.append(
                f"chains disagree on {self.names[worst]}, R-hat {self.rhat[worst]:.3f}: draw more, or give"
                " this parameter a prior"
            )
        least = int(np.argmin(self.ess))
        if not self.ess[least] > _ESS * chains:
            warnings.append(
                f"{self.names[least]} has {self.ess[least]:.0f} effective draws, but needs"
                f" {_ESS * chains:.0f}: draw more"
            )
        if count := int(self.diverging.sum()):
            warnings.append(
                f"{count} trajectories diverged: draws may miss a narrow part of the posterior; give a prior"
            )
        return warnings

    def save(self, path: StrPath) -> None:
        """Write the fit and the draws to an HDF5 file (.h5), completely or not at all.

        `Samples.load` reads the fit with the draws, and `FitResult.load` reads only the fit.
        """
        fit_files.save(path, self.fit, samples=self._write)

    def _write(self, group: h5py.Group) -> None:
        hdf5.write_values(group, "x", self.x, "-")
        for name in ("rhat", "ess", *_ARRAYS):
            hdf5.write_values(group, name, np.asarray(getattr(self, name), float), "-")
        hdf5.write_values(group, "values", self.values, "as in /parameters/units")
        group.attrs.update(flat=self.flat, warmup=self.warmup, seconds=self.seconds)

    @classmethod
    def load(cls, path: StrPath) -> Self:
        """Load a fit and the draws from a file written by `save`, or raise ValueError with the fault."""
        fit = fit_files.load(path, FitRecord)
        with hdf5.reading(path, fit_files.FIT_FORMAT) as file:
            group = hdf5.subgroup(file, "samples")
            hdf5.check_names(group, ("x", "values", "rhat", "ess", *_ARRAYS), ("flat", "warmup", "seconds"))
            attributes = hdf5.attributes(group, {"flat": str, "warmup": int, "seconds": float})
            check_options(flat=attributes["flat"])
            x, size = hdf5.read_values(group, "x", "-"), fit.x.size
            if x.ndim != 3 or x.shape[2] != size:
                raise ValueError(f"/samples/x has shape {x.shape}: must be (chains, draws, {size})")
            arrays = {name: hdf5.read_array(group, name, "-", x.shape[:2]) for name in _ARRAYS}
            arrays |= {name: hdf5.read_array(group, name, "-", (size,)) for name in ("rhat", "ess")}
        arrays["diverging"] = arrays["diverging"] > 0
        return cls(fit=fit, x=np.asarray(x), **arrays, **attributes)


def drawn(
    fit: FitRecord,
    n: int,
    warmup: int,
    chains: int,
    key: jax.Array | None,
    flat: str,
    callback: DrawProgress | None,
) -> Samples:
    """Draw from the posterior of a fit. See `fitting.FitResult.sample`."""
    check_options(n=n, warmup=warmup, chains=chains, key=key, callback=callback, flat=flat)
    began = time.perf_counter()
    key = jax.random.key(0) if key is None else key
    chains_result = run_chains(fit, flat, -(-n // chains), warmup, chains, key, callback)
    rhat, ess = diagnosed(chains_result["x"])
    seconds = time.perf_counter() - began
    return Samples(fit=fit, **chains_result, rhat=rhat, ess=ess, flat=flat, warmup=warmup, seconds=seconds)
