"""The result of a fit: values, uncertainty, predictions, and friction tables for other programs."""

import dataclasses
from collections.abc import Sequence
from typing import Self

import jax
import numpy as np

from fitting.parameters.constraints import cutoff_path, last_wavevector
from fitting.parameters.priors import Prior
from fitting.parameters.scenes import by_name
from fitting.parameters.variables import Array
from fitting.results import hdf5
from fitting.results.budget import Budget, budget_of
from fitting.results.plot import plot_fit
from fitting.results.record import FitRecord
from fitting.results.report import headlines, report, tied_lines, variable_rows
from fitting.results.samples import Samples, drawn
from fitting.solvers.runs import Callback
from fitting.uncertainty.intervals import LEVEL
from fitting.uncertainty.likelihood_profile import LikelihoodProfile
from fitting.uncertainty.posterior import DrawProgress, log_density, prior_of
from rubberfric.analysis import friction_table as table_of_scene
from rubberfric.base import ArrayLike, StrPath, html, object_html
from rubberfric.io import FrictionTable
from rubberfric.plot import style


@dataclasses.dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FitResult(FitRecord):
    """Result of `fitting.fit`: values and uncertainty as attributes, and methods for their use.

    Examples
    --------
    Moduli from E' and E'' with errors of 5 %, and the prior of another fit with twice these errors:

    >>> omega, scene = np.logspace(0, 4, 9), rf.load_scene("data/tread_on_asphalt.toml")
    >>> scene = scene.replace("upper.material", rf.Prony(E_inf=2e6, E=[1e7], tau=[1e-2]))
    >>> E = np.asarray(rf.complex_modulus(scene.upper.material, omega))
    >>> data = fitting.ModulusData(omega, E.real, E.imag, relative=0.05, body="upper")
    >>> free = {f"upper.material.{name}": fitting.Positive() for name in ("E_inf", "E")}
    >>> result = fitting.fit(scene, data, free)
    >>> (result.stderr / result.values).round(4)
    array([0.0268, 0.0144])
    >>> list(result.as_prior("lower", widen=2.0))
    ['lower.material.E_inf, lower.material.E']
    >>> result.save("fit.h5")
    >>> again = fitting.FitResult.load("fit.h5")
    >>> again.success, again.report() == result.report()
    (True, True)
    """

    def predict(
        self,
        velocity: ArrayLike,
        pressure: ArrayLike,
        temperature: ArrayLike | None = None,
        quantity: str = "friction",
        scene: str | None = None,
    ) -> jax.Array:
        """Return a quantity of the fitted scene, as computed by `rubberfric.solve`."""
        return self.predicted(self.x, (velocity, pressure, temperature), quantity, scene)

    def profile_cutoff(
        self,
        path: str | None = None,
        level: float = 0.95,
        values: ArrayLike | None = None,
        callback: Callback | None = None,
    ) -> LikelihoodProfile:
        """Return the profile likelihood of a spectrum's cut-off q1, with all other parameters fitted again.

        `fitting.plot.plot_profile` draws the profile.

        Parameters
        ----------
        path : key path that ends in .q1, free in this fit or not. If None, the only rough solid is used.
        level : confidence level of the interval
        values : values of q1 [1/m]. If None, 12 values from 0.1 to 10 times the fitted value are used, as far
            as a tabulated spectrum contains them.
        """
        path = cutoff_path(self.scene, path)
        fit = self if path in self.names else self.freed(path)
        if values is None:
            around = fit[path].value * np.geomspace(0.1, 10.0, 12)
            values = around[around <= last_wavevector(self.scene, path)]
        return fit.profile(path, level, callback=callback, values=values)

    def log_density(self, x: Array) -> jax.Array:
        """Return the log density at x, which is -cost up to a constant. See `fitting.log_density`."""
        return log_density(self)(x)

    def sample(
        self,
        n: int = 2000,
        *,
        warmup: int = 500,
        chains: int = 4,
        key: jax.Array | None = None,
        flat: str = "x",
        callback: DrawProgress | None = None,
    ) -> Samples:
        """Draw from the posterior with the residuals, errors, loss, priors and bounds of the fit.

        The draws use the No-U-Turn sampler of numpyro and the diagnostics of arviz-stats (pip install
        'rubberfric[sampling]'). The metric and the starts follow from the covariance of the fit, see
        `fitting.uncertainty.posterior`. Errors that were estimated from the scatter are treated as known.

        Parameters
        ----------
        n : number of draws of all chains together
        warmup : number of draws of each chain that adapt the sampler and are discarded
        chains : number of independent chains, which run one after the other
        key : jax.random.key, or None for key(0); the same key gives the same draws
        flat : "x" or "values", the variable in which numbers without a prior are uniform, see `log_density`
        callback : called as callback(chain, draw) after every draw, warm-up included, or None

        Raises
        ------
        ValueError : an option is wrong, or data and priors do not determine a direction, along which the
            density has no finite integral.
        ModuleNotFoundError : numpyro or arviz-stats is not installed.
        """
        return drawn(self, n, warmup, chains, key, flat, callback)

    def as_prior(self, body: str | None = None, widen: float = 1.0) -> dict[str, Prior]:
        """Return the fitted values and covariance as the `prior` of another fit.

        Parameters
        ----------
        body : "lower" or "upper", the body in the other scene. If None, the body stays the same.
        widen : factor by which all standard deviations are multiplied
            A factor > 1 allows for model error, or for a scene that does not explain the data.

        Returns
        -------
        dict of one `Correlated`, to be joined with other priors by "|"

        Raises
        ------
        ValueError : the fit did not converge, or the parameters belong to both bodies and `body` is given.
        """
        if not self.success:
            raise ValueError(f"as_prior: the fit did not converge ({self.message}); use a converged fit")
        return dict(prior_of(self, body, widen))

    def budget(
        self,
        *,
        temperature: float | None = None,
        velocity: float | None = None,
        pressure: float | None = None,
        moduli: float | None = None,
        roughness: float | None = None,
        gamma: float | None = None,
    ) -> Budget:
        r"""Return the error budget: how far noise, theory, conditions and fixed numbers move each parameter.

        .. math:: \Delta x = -(J^T J)^{-1} J^T\, (r_\mathrm{changed} - r)

        Parameters
        ----------
        temperature : error of all temperatures of friction and area data [K], >= 0, by default 1
        velocity, pressure : relative error of all velocities and pressures [-], by default 0.02 and 0.05
            2.0 stands for a factor of 3.
        moduli : relative error of the fixed moduli of a body, common to all of them [-], by default 0.1
        roughness : relative error of each fixed height and wavevector of a spectrum [-], by default 0.1
            The Hurst exponent changes by half of it.
        gamma : error of a fixed gamma of the theory [-], by default 0.1

        Returns
        -------
        Budget, with `report`, `plot`, `save` and the contributions

        Raises
        ------
        ValueError : a size is negative or not finite.

        Notes
        -----
        0 leaves out a source. A `Gaussian` prior on a fixed number states its error, which replaces the
        default. The contact model is changed from the theory to the law fitted to boundary elements. If the
        law does not allow the scene, the ratio of law and theory without the missing parts is used, which
        the report says. The numerical error is the change with 1.5 times as many nodes.

        Shifts equal new fits to 10 % if they are below half a standard error. Shifts of several standard
        errors are estimates.

        Examples
        --------
        >>> print(result.budget(temperature=3.0).report())  # doctest: +SKIP
        """
        sizes = {"temperature": temperature, "velocity": velocity, "pressure": pressure}
        return budget_of(self, sizes | {"moduli": moduli, "roughness": roughness, "gamma": gamma})

    def report(self) -> str:
        """Return the fit as text of several lines, laid out as lmfit does. See `fitting.results.report`."""
        return report(self)

    def plot(self, ax: style.Panels | None = None) -> style.Panels:
        """Draw data, fit and band with residuals below. See `fitting.plot.plot_fit`."""
        return plot_fit(self, ax)

    def save(self, path: StrPath) -> None:
        """Write the fit to an HDF5 file (.h5), completely or not at all. See `fitting.results.hdf5`."""
        hdf5.save(path, self)

    @classmethod
    def load(cls, path: StrPath) -> Self:
        """Load a fit from a file written by `save`. See `fitting.results.hdf5.load`."""
        return hdf5.load(path, cls)

    def _repr_html_(self) -> str:
        return _html(self)


def _html(result: FitRecord) -> str:
    rows = []
    for row in variable_rows(result):
        if isinstance(row, tuple):
            name, value, error, unit, share, start, remark = row
            row = (name, f"{value} +/- {error} {unit}", share, f"{start} {unit}", remark)
        rows.append(row)
    rows += tied_lines(result)
    rows += [f"budget: {result.largest_error}"] * bool(result.largest_error)
    rows += [f"not identified, {i}: {d.text}" for i, d in enumerate(result.unidentified, 1)]
    redchi = f"{result.redchi:.4g}" if np.isfinite(result.redchi) else "none"
    count = result.problem.targets.measured.size
    rows.append(f"measured values: {count}; reduced chi-square [-]: {redchi}; cost [-]: {result.cost:.6g}")
    caption = "; ".join(headlines(result)) or f"{result.message}; the scene {result.verdict.text}"
    headings = ("parameter", "value", "relative error", "start", "")
    below = [html.folded("report", html.preformatted(report(result)))]
    for name, scene in by_name(result.scene).items():
        below.append(html.folded(f"scene {name}".rstrip(), object_html(scene)))
    return "\n".join([html.table(rows, headings, caption), *below])


def friction_table(
    result: FitResult,
    velocity: float | Sequence[float],
    pressure: float | Sequence[float],
    temperature: float | Sequence[float] | None = None,
    *,
    error: float = 0.01,
    title: str = "",
) -> FrictionTable:
    """Return mu(v, p, T) of a fit with standard errors, on a grid for multilinear interpolation.

    See `rubberfric.analysis.friction_table` for the arguments and errors. `sigma` of the table is the
    standard error of mu from the width of `FitResult.band`.
    """
    options = {"error": error, "quadrature": result.problem.structure.quadrature, "title": title}
    table = table_of_scene(result.problem.scene(result.x), velocity, pressure, temperature, **options)
    T = None if table.temperature is None else table.temperature[:, None, None]
    band = result.band(table.velocity, table.pressure[:, None], T, level=LEVEL)
    sigma = band.value * np.log(band.high / band.value) / result.quantile(LEVEL)
    return table._replace(sigma=sigma.reshape(table.friction.shape))
