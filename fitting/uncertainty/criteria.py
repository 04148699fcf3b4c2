r"""Predictive accuracy of a fit: likelihood, information criteria, and leave-one-out densities.

.. math:: \ln p_i = -\tfrac12 \ln 2\pi e_i^2 - \tfrac12 r_i^2,\qquad
          \ln p_{i|-i} = -\tfrac12 \ln 2\pi e_i^2 + \tfrac12 \ln(1 - h_i) - \tfrac12 \frac{r_i^2}{1 - h_i}

r_i are residuals in units of their errors e_i. Their leverages h_i are the diagonal of J (J^T J)^-1 J^T, with
the rows of the priors in J^T J. The second equation is exact for a model that is linear in its parameters
[Allen, Technometrics 16 (1974) 125; Vehtari, Mononen, Tolvanen, Sivula & Winther, J. Mach. Learn. Res. 17
(2016) 103, sec. 3.2, arXiv:1412.7461], and for others it is the Laplace approximation. With a robust loss,
one Newton step gives the fit without the value. The density of the value under the loss is then averaged over
the normal distribution of its prediction.

If errors are correlated (`Discrepancy`), W whitens the rows, and H = J (J^T J)^-1 J^T of the whitened rows.
Then 1 - h_i is the diagonal of Q = W^T (1 - H) W, and r_i / (1 - h_i) is (W^T r)_i / Q_ii [Sundararajan &
Keerthi, Neural Comput. 13 (2001) 1103; Buerkner, Gabry & Vehtari, Comput. Stat. 36 (2021) 1243,
arXiv:1810.10559].

AIC = -2 ln L + 2 k [Akaike, IEEE Trans. Autom. Control 19 (1974) 716],
AICc = AIC + 2 k (k + 1) / (n - k - 1) [Hurvich & Tsai, Biometrika 76 (1989) 297],
BIC = -2 ln L + k ln n [Schwarz, Ann. Stat. 6 (1978) 461];
k is the effective number of parameters that the data determine, plus the number of estimated errors. All
parameters count if all are identified and there are no priors.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from fitting.solvers.objective import factors, rho
from fitting.solvers.problem import Problem
from fitting.uncertainty.covariance import OPEN, data_residuals, linearised, weighted_rows
from fitting.uncertainty.intervals import SolvedProblem

# Leverage above which a value alone determines a parameter, and its left-out density is unreliable.
ALONE = 0.7
# Lower bound of 1 - h, which may round to 0.
_ROUNDING = 1e-12
# Gauss-Hermite nodes of the mean over a left-out density. Fewer are less accurate for robust losses.
_NODES = 64


class Criteria(NamedTuple):
    """Likelihood of a fit, and predictive density of left-out values."""

    values: int  # n
    parameters: float  # k
    deviance: float  # -2 ln L
    left_out: np.ndarray  # ln p of every value, predicted from all others, in the order of the data, (n,)
    leverage: np.ndarray  # h of every value, shape (n,)

    @property
    def aic(self) -> float:
        """Akaike information criterion."""
        return self.deviance + 2 * self.parameters

    @property
    def aicc(self) -> float:
        """AIC corrected for a small number of values, or inf if n - k - 1 <= 0."""
        rest = self.values - self.parameters - 1
        return self.aic + 2 * self.parameters * (self.parameters + 1) / rest if rest > 0 else np.inf

    @property
    def bic(self) -> float:
        """Bayesian information criterion of Schwarz."""
        return self.deviance + self.parameters * np.log(self.values)

    @property
    def loo(self) -> float:
        """Leave-one-out deviance: -2 times the sum of `left_out`."""
        return -2 * float(np.sum(self.left_out))


def criteria(solved: SolvedProblem, estimated: int = 0) -> Criteria:
    """Return the criteria of a fit, with functions that the fit has compiled.

    `estimated` counts further estimated parameters, such as the amplitude of a `Discrepancy`.
    """
    problem = solved.problem
    r, h, left_out = _left_out(solved)
    error = np.asarray(problem.targets.error, float)
    own = _density(problem, r) - np.log(error)
    deviance, scales = -2 * float(np.sum(own)), estimated
    if problem.numbers.whitening is not None:
        deviance -= 2 * float(np.sum(np.log(np.diag(problem.numbers.whitening))))  # it is triangular
    pairs = list(zip(problem.order, solved.estimated, strict=True))
    groups = [where for where, scale in pairs if scale is not None]
    if solved.error_scale != 1:
        groups.append(np.concatenate([where for where, scale in pairs if scale is None]))
    for where in groups:
        scales += 1
        if problem.structure.loss == "linear":  # errors of the greatest likelihood, not the unbiased ones
            square = max(float(np.mean(r[where] ** 2)), np.finfo(float).tiny)
            deviance += where.size * (np.log(square) + 1) - float(np.sum(r[where] ** 2))
    order, parameters = np.concatenate(problem.order), solved.uncertainty.parameters + scales
    return Criteria(r.size, parameters, deviance, (left_out - np.log(error))[order], h[order])


def _left_out(solved):
    """Return residuals in units of their errors, leverages, and ln p of residuals of left-out values."""
    problem, known = solved.problem, solved.uncertainty
    count = problem.targets.measured.size
    model = linearised(problem, solved.x)
    r = data_residuals(problem, model).astype(float)
    jacobian = weighted_rows(problem, model).jacobian
    along = (jacobian[:count] * known.stretch) @ (known.directions * np.minimum(known.deviations, OPEN))
    h = np.clip(np.sum(along**2, axis=1), 0.0, 1 - _ROUNDING)
    if problem.numbers.whitening is not None:
        W = np.asarray(problem.numbers.whitening, float)
        precision = np.diag(W.T @ (np.eye(count) - along @ along.T) @ W)
        h = np.clip(1 - precision / np.sum(W**2, axis=0), 0.0, 1 - _ROUNDING)
        return r, h, 0.5 * np.log(precision / (2 * np.pi)) - 0.5 * (W.T @ r) ** 2 / precision
    if problem.structure.loss == "linear":
        return r, h, -0.5 * np.log(2 * np.pi) + 0.5 * np.log(1 - h) - 0.5 * r**2 / (1 - h)
    # The factor of the Jacobian squared is the loss's curvature, r times both factors its slope.
    slope, curvature = (np.asarray(part, float) for part in factors(*_loss(problem), jnp.asarray(r)))
    spread = h / (1 - h) / curvature**2
    without = r + spread * r * slope * curvature
    t, weight = np.polynomial.hermite_e.hermegauss(_NODES)
    density = np.exp(_density(problem, without[:, None] + np.sqrt(spread)[:, None] * t))
    return r, h, np.log(density @ weight / weight.sum())


def _density(problem: Problem, r):
    """Return ln p of residuals in units of the errors, not normalised for robust losses."""
    return -0.5 * np.asarray(rho(*_loss(problem), jnp.asarray(r))[0], float) - 0.5 * np.log(2 * np.pi)


def _loss(problem):
    return problem.structure.loss, float(problem.numbers.width)
