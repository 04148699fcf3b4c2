r"""A Prony series on given relaxation times as a least-squares problem in NumPy.

.. math:: E' = E_\infty + \sum_i E_i \frac{a_i^2}{1 + a_i^2},\qquad
          E'' = \sum_i E_i \frac{a_i}{1 + a_i^2},\qquad a_i = \omega\tau_i

It is linear in E, so that its derivatives by ln E are E times the columns; nothing is compiled.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from fitting.characterise.prony.bounded import nonnegative, nonnegative_logarithmic
from fitting.parameters.variables import Group, Variables, element_names
from fitting.solvers.problem import ASSUMED
from fitting.uncertainty.covariance import Uncertainty, from_jacobian

# Part of E' or E'' that a term makes up somewhere, or it is none.
_ROUNDING = 1e-9
_STEPS = 200
# Fits, each weighted with the errors that the one before it estimated.
_ROUNDS = 2
# Strengths of a smooth prior that are tried, in changes of the slope from term to term.
_STRENGTHS = np.geomspace(0.03, 30.0, 19)


class Solution(NamedTuple):
    """A minimum: moduli, what they are worth, and whether it is one."""

    E: np.ndarray  # E_i, and E_inf last where it is free; > 0
    scale: float | None  # relative error estimated from the scatter; None where errors were given
    uncertainty: Uncertainty  # of ln E
    slope: float  # largest cosine between the residuals and a change of ln E, 0 at a minimum


@dataclasses.dataclass(frozen=True, eq=False)
class Series:
    """What is measured, and the columns of the terms that are to meet it.

    Attributes
    ----------
    columns : E' and then E'' of every term with E = 1, shape (rows, terms)
    known : what is not fitted, shape (rows,)
    measured, error : shape (rows,); `error` of the logarithm where `logarithmic`, else absolute
    estimate : whether `error` has the right ratios only
    tau : relaxation times [s]; inf, the last, is E_inf
    body : whose material it is, for names
    """

    columns: np.ndarray
    known: np.ndarray
    measured: np.ndarray
    error: np.ndarray
    logarithmic: bool
    estimate: bool
    tau: np.ndarray
    body: str

    @property
    def variables(self) -> Variables:
        """The moduli as free parameters of a scene's body."""
        terms, path = int(np.isfinite(self.tau).sum()), f"{self.body}.material"
        groups = [Group(f"{path}.E", "Positive", 0, tuple(range(terms)), (0, terms))]
        if terms < self.tau.size:
            groups.append(Group(f"{path}.E_inf", "Positive", 1, None, (terms, self.tau.size)))
        return Variables(None, tuple(groups), self.tau.size)

    @property
    def names(self) -> tuple[str, ...]:
        """Key paths of the moduli."""
        return tuple(element_names(self.variables))

    def only(self, kept: np.ndarray) -> "Series":
        """The same with some of the terms only."""
        return dataclasses.replace(self, columns=self.columns[:, kept], tau=self.tau[kept])

    def bounded(self) -> np.ndarray:
        """E at the minimum over E >= 0, zeros exact."""
        if self.logarithmic:
            E = nonnegative_logarithmic(self.columns, self.measured, self.known, self.error)
        else:
            E = nonnegative(self.columns / self.error[:, None], (self.measured - self.known) / self.error)
        # What is nowhere more than rounding is absent, too: data without noise leave such terms.
        model = self.columns @ E + self.known
        return np.where((self.columns * E > _ROUNDING * model[:, None]).any(0), E, 0.0)

    def rows(self, x: np.ndarray, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals at x = ln E in units of errors, and their derivatives."""
        parts = self.columns * np.exp(x)
        model = parts.sum(1) + self.known
        if self.logarithmic:
            return np.log(model / self.measured) / error, parts / (model * error)[:, None]
        return (model - self.measured) / error, parts / error[:, None]

    def solved(self, E: np.ndarray, smooth: float | None = None) -> Solution:
        """The minimum beside E > 0, which without `smooth` it is already, and its uncertainty.

        Errors that are unknown follow from the scatter, as in `fitting.fit`.
        """
        bends = np.zeros((0, E.size)) if smooth is None else self._bends() / smooth
        x, error, scale = np.log(E), self.error, None
        if self.estimate:
            scale, error = ASSUMED, ASSUMED * self.error
        for i in range(_ROUNDS + 1):
            if smooth is not None:
                x = self._minimum(x, error, bends)
            known, slope = self._known(x, error, bends)
            if scale is None or i == _ROUNDS or self.measured.size - known.parameters < 0.5:
                break
            scatter = np.sqrt(known.chisqr / (self.measured.size - known.parameters))
            # Data without noise are met to rounding; they must not get an error of zero.
            scale = max(scale * float(scatter), 1e-10)
            error = scale * self.error
        return Solution(np.exp(x), scale, known, slope)

    def cross_validated(self, E: np.ndarray) -> float:
        r"""Strength of `Smooth` that predicts best what is left out, sigma [-].

        .. math:: \min_\sigma \frac{n \sum_k r_k^2}{(n - \mathrm{tr} H)^2}

        generalised cross-validation [Golub, Heath & Wahba, Technometrics 21 (1979) 215], H the matrix
        that makes the fit of the data. It needs no size of the errors, their ratios only.
        """
        bends, x, count = self._bends(), np.log(E), self.measured.size
        scores, unit = [], None
        for sigma in _STRENGTHS[::-1]:
            scaled = bends / sigma
            if unit is None:
                # The weakest prior hardly disturbs: what it leaves is noise.
                x = self._minimum(x, ASSUMED * self.error if self.estimate else self.error, scaled)
                r, _ = self.rows(x, self.error)
                unit = max(float(np.sqrt(np.mean(r**2))), 1e-10) if self.estimate else 1.0
            error = unit * self.error
            x = self._minimum(x, error, scaled)
            known, _ = self._known(x, error, scaled)
            scores.append(known.chisqr / max(count - known.parameters, 1e-3) ** 2)
        return float(_STRENGTHS[::-1][int(np.argmin(scores))])

    def _bends(self) -> np.ndarray:
        """Changes of d ln E / d log10 tau from term to term, shape (terms - 2, terms)."""
        terms = np.flatnonzero(np.isfinite(self.tau))
        order = terms[np.argsort(self.tau[terms])]
        if order.size < 3:
            raise ValueError("smooth: must have three or more different relaxation times")
        slopes = np.diff(np.eye(self.tau.size)[order], axis=0) / np.diff(np.log10(self.tau[order]))[:, None]
        return np.diff(slopes, axis=0)

    def _minimum(self, x, error, bends):
        """x of least squares of data and prior, by Levenberg and Marquardt."""
        damping, (r, J) = 1e-3, self._all(x, error, bends)
        for _ in range(_STEPS):
            H, g = J.T @ J, J.T @ r
            step = -np.linalg.solve(H + damping * np.diag(np.diag(H) + 1e-300), g)
            trial = x + np.clip(step, -3.0, 3.0)
            new, slopes = self._all(trial, error, bends)
            gained = r @ r - new @ new
            if not gained > 0:
                if damping > 1e12 or np.abs(step).max() < 1e-12:
                    break
                damping *= 10.0
                continue
            x, r, J, damping = trial, new, slopes, max(damping / 10, 1e-12)
            if gained <= 1e-15 * (r @ r):
                break
        return x

    def _all(self, x, error, bends):
        r, J = self.rows(x, error)
        return np.concatenate([r, bends @ x]), np.concatenate([J, bends])

    def _known(self, x, error, bends):
        r, J = self._all(x, error, bends)
        count = self.measured.size
        known = from_jacobian(
            self.variables, J, count, slope=np.exp(x), chisqr=float(r[:count] @ r[:count]), x=x
        )
        size = np.linalg.norm(J, axis=0) * np.linalg.norm(r)
        return known, float(np.max(np.abs(J.T @ r) / np.where(size > 0, size, 1.0)))


def columns(omega: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """E' and E'' of every term with E = 1, shape (2 frequencies, terms); of tau = inf, E_inf, too."""
    finite = np.isfinite(tau)
    a = omega[:, None] * np.where(finite, tau, 1.0)
    terms = np.concatenate([a**2 / (1 + a**2), a / (1 + a**2)])
    return np.where(finite, terms, np.repeat([1.0, 0.0], omega.size)[:, None])
