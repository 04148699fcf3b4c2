r"""Angular integrals of the series stiffness over the direction of sliding.

For F(omega), omega = q v cos(phi), three means over phi:

    mean_abs2      <|F|^2>            enters G
    mean_cos_loss  <cos(phi) Im F>    enters mu
    mean_storage   <Re F>             enters u_bar

Anisotropic roughness also needs their harmonics, means with the additional factor cos(2 m phi), and <sin(phi)
Im F sin(2 m phi)> for the transverse friction. For Prony series the residues at s = i omega = 1/tau_i give
closed forms, with a_i = q v tau_i and r_i = sqrt(1 + a_i^2),

.. math:: \langle|F|^2\rangle = F_\infty^2 + 2\sum_i F_i F(s = 1/\tau_i)\,(1 - 1/r_i)
.. math:: \langle\cos\varphi\,\mathrm{Im} F\rangle = \sum_i F_i \frac{a_i}{r_i (1 + r_i)},\qquad
          \langle\mathrm{Re} F\rangle = F_\infty + \sum_i F_i (1 - 1/r_i)

.. math:: \left\langle\frac{a^2\cos^2\varphi}{1 + a^2\cos^2\varphi}\cos 2m\varphi\right\rangle
          = \frac{(-1)^{m-1}}{r}\rho^m,\qquad \rho = \left(\frac{a}{1+r}\right)^2

These formulas take one square root and one division for each node, term and velocity, without an angular
grid.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.compilation import exact_products
from rubberfric.materials.material import clip_for_square
from rubberfric.theory.structure import RequiredMeans

# By kind, "mean_abs2", "mean_cos_loss", "mean_storage" and "mean_sin_loss": one array each. <|F|^2> has two,
# <F'^2> and <F''^2>, if they are needed separately.
Means = dict[str, tuple[jax.Array, ...]]
# Shares (c_m, s_m) of the harmonics of anisotropic roughness, m = 1, 2, ... along the first axis.
Harmonics = tuple[jax.Array, jax.Array]


class PronyStiffness(NamedTuple):
    """F(s) = rest + sum_i weight_i s tau_i / (1 + s tau_i).

    The parameters differ between nodes, or are common to all nodes.
    """

    rest: jax.Array  # [-], shape () or (nodes,)
    weight: jax.Array  # [-], shape (n,) or (nodes, n)
    tau: jax.Array  # [s], same shape
    square_weight: jax.Array | None = None  # result of `with_square_weight` [-], same shape

    def with_square_weight(self) -> "PronyStiffness":
        """Return F with the weights 2 F_i F(s = 1/tau_i) of <|F|^2>, which do not depend on the velocity."""
        return self._replace(square_weight=_square_weight(self))

    @property
    def by_node(self) -> bool:
        """Return True if F differs between nodes."""
        return self.tau.ndim > 1

    def means(
        self, qv: jax.Array, needs: RequiredMeans, split: bool = False, harmonics: Harmonics | None = None
    ) -> Means:
        """Return the means of F for roughness that passes with the frequency q v.

        Parameters
        ----------
        qv : q v a_T [1/s], any shape; (points, nodes) if F differs between nodes; negative for
            reversed sliding
        needs : RequiredMeans
        split : True if <F'^2> and <F''^2> are needed separately
        harmonics : coefficients (c_m, s_m) of anisotropic roughness, or None. Each has the shape
            (harmonics,), or (harmonics, ...) broadcastable with qv if it depends on q. The means then include
            the harmonics. Not allowed with split.

        Returns
        -------
        Means, arrays of the shape of qv
        """
        if split:
            return _split_form(self, qv, needs)
        means = _closed_form(self, qv, needs)
        return means if harmonics is None else _with_harmonics(self, qv, needs, harmonics, means)


def _closed_form(F, qv, needs):
    weights = _weights(F, [kind for kind in needs.kinds if kind != "mean_sin_loss"])
    if F.by_node:
        weights = {kind: weight.T[:, None, :] for kind, weight in weights.items()}
        sums = _sums_of_rows(weights, F.tau.T[:, None, :] * qv)
    else:
        sums = _sums(weights, F.tau, qv)
    if needs.mean_abs2:
        sums["mean_abs2"] = F.rest**2 + sums["mean_abs2"]
    if needs.mean_storage:
        sums["mean_storage"] = F.rest + sums["mean_storage"]
    return {kind: (value,) for kind, value in sums.items()}


def _weights(F, kinds):
    """Return the weights of the terms by kind of mean."""
    return {kind: _square_weight(F) if kind == "mean_abs2" else F.weight for kind in kinds}


def _square_weight(F):
    return 2 * F.weight * _at_own_rates(F) if F.square_weight is None else F.square_weight


def _with_harmonics(F, qv, needs, harmonics, means):
    weights = _weights(F, needs.kinds)
    front = (slice(None), *(None,) * qv.ndim)
    tau, weights = jax.tree.map(lambda x: x.T[:, None, :] if F.by_node else x[front], (F.tau, weights))
    sums = _sums_of_harmonics(qv, tau, weights, harmonics)
    return {kind: (means[kind][0] + value if kind in means else value,) for kind, value in sums.items()}


@jax.custom_jvp
def _sums_of_harmonics(qv, tau, weights, harmonics):
    # Terms lie along the first axis of tau and of the weights.
    return {kind: jnp.sum(x, 0) for kind, x in _terms_of_harmonics(qv, tau, weights, harmonics).items()}


@_sums_of_harmonics.defjvp
def _sums_of_harmonics_jvp(primals, tangents):
    qv, tau, weights, harmonics = primals

    # Term by term, recomputed for the gradient, because dozens of arrays of terms x points would be stored.
    @functools.partial(jax.checkpoint, prevent_cse=False)
    def add(sums, term):
        (tau, weights), (tau_dot, weights_dot) = term
        at, along = (qv, tau, weights, harmonics), (tangents[0], tau_dot, weights_dot, tangents[3])
        return jax.tree.map(jnp.add, sums, jax.jvp(_terms_of_harmonics, at, along)[1]), None

    sums = _sums_of_harmonics(*primals)
    terms = (tau, weights), tuple(tangents[1:3])
    return sums, jax.lax.scan(add, jax.tree.map(jnp.zeros_like, sums), terms)[0]


def _terms_of_harmonics(qv, tau, weights, harmonics):
    """Return, for each term of the series, the sum of all harmonics.

    The sum is the first harmonic times a polynomial in -rho, which Horner's scheme evaluates.
    """
    _, sine, r, _ = _relaxation_parts(tau * qv)
    quotient = sine * r  # a / (1 + r), at most 1
    ratio = quotient**2
    along = _series(harmonics[0], -ratio)
    first = {"mean_abs2": ratio / r * along, "mean_cos_loss": sine / (1 + r) * along}
    first["mean_storage"] = first["mean_abs2"]
    if "mean_sin_loss" in weights:
        first["mean_sin_loss"] = quotient / (1 + r) * _series(harmonics[1], -ratio)
    return {kind: weight * first[kind] for kind, weight in weights.items()}


@jax.custom_jvp
def _series(coefficients, x):
    """Evaluate a polynomial in x, with coefficients ascending along the first axis."""
    value = jnp.zeros_like(x)
    for c in coefficients[::-1]:
        value = value * x + c
    return value


@_series.defjvp
def _series_jvp(primals, tangents):
    # Reverse mode keeps only the slope, not every step.
    coefficients, x = primals
    order = jnp.arange(1, coefficients.shape[0], dtype=x.dtype)
    slope = _series(order.reshape(-1, *(1,) * (coefficients.ndim - 1)) * coefficients[1:], x)
    return _series(coefficients, x), _series(tangents[0], x) + slope * tangents[1]


def _split_form(F, qv, needs):
    r"""Return the means with <F'^2> and <F''^2> instead of <|F|^2>.

    <F'^2> and <F''^2> are sums over pairs of positive terms,

    .. math:: \langle F''^2\rangle = \sum_{ij} \frac{F_i F_j s_i s_j}{r_i + r_j},\quad s = \frac{a}{r},\qquad
              \langle F'^2\rangle = \Big(F_\infty + \sum_i F_i o_i\Big)^2
              + \sum_{ij} \frac{F_i F_j o_i o_j}{r_i + r_j},\quad o = 1 - \frac{1}{r}
    """
    front = (slice(None), *(None,) * qv.ndim)
    weight = F.weight[front]
    one, sine, r, _ = _relaxation_parts(F.tau[front] * qv)
    ones, sines = weight * one, weight * (sine * (1 + r))
    storage = F.rest + jnp.sum(ones, 0)
    means = {}
    if needs.mean_abs2:
        means["mean_abs2"] = storage**2 + _pairs(ones, r), _pairs(sines, r)
    if needs.mean_cos_loss:
        means["mean_cos_loss"] = (jnp.sum(weight * sine, 0),)
    if needs.mean_storage:
        means["mean_storage"] = (storage,)
    return means


@jax.custom_jvp
def _pairs(x, r):
    """Return sum_ij x_i x_j / (r_i + r_j)."""
    total = 0.0
    for i in range(r.shape[0]):
        # Pairs i < j count twice.
        total = total + x[i] * (2 * jnp.sum(x[i:] / (r[i] + r[i:]), 0) - x[i] / (2 * r[i]))
    return total


@_pairs.defjvp
def _pairs_jvp(primals, tangents):
    # Row by row, so that reverse mode keeps two numbers per term instead of one per pair.
    (x, r), (dx, dr) = primals, tangents
    rows = [1 / (r[i] + r) for i in range(r.shape[0])]
    first = jnp.stack([jnp.sum(x * share, 0) for share in rows])
    second = jnp.stack([jnp.sum(x * share * share, 0) for share in rows])
    return jnp.sum(x * first, 0), 2 * jnp.sum(first * dx - x * second * dr, 0)


@jax.custom_jvp
def _sums(weights, tau, qv):
    """Sum over the terms at every q v in one pass. No array of size terms x points is stored."""
    front = (slice(None), *(None,) * qv.ndim)
    stored = {name: _stored(weight)[front] for name, weight in weights.items()}
    return _sums_of_rows(stored, _stored(tau)[front] * qv)


def _stored(values):
    """Return the values unchanged, computed as sums.

    XLA stores the result of a sum. XLA would repeat any other operation for every point.
    """
    return jnp.sum(jnp.where(jnp.eye(values.shape[0], dtype=bool), values, 0.0), -1)


@_sums.defjvp
@exact_products
def _sums_jvp(primals, tangents):
    return jax.jvp(_sums_as_products, primals, tangents)


def _sums_as_products(weights, tau, qv):
    """Return the sums of `_sums` as matrix products.

    Matrix products are slower than one pass, but have a faster derivative.
    """
    one, sine = _relaxation(tau[:, None] * qv.reshape(-1))
    parts = {"mean_abs2": one, "mean_cos_loss": sine, "mean_storage": one}
    return {name: (weight @ parts[name]).reshape(qv.shape) for name, weight in weights.items()}


def _sums_of_rows(weights, a):
    one, sine = _relaxation(a)
    parts = {"mean_abs2": one, "mean_cos_loss": sine, "mean_storage": one}
    return {name: jnp.sum(weight * parts[name], 0) for name, weight in weights.items()}


@jax.custom_jvp
def _relaxation(a):
    """Return 1 - 1/r and a / (r (1 + r)) for r = sqrt(1 + a^2), without cancellation."""
    return _relaxation_parts(a)[:2]


@_relaxation.defjvp
def _relaxation_jvp(primals, tangents):
    # d(1 - 1/r) = a/r^3 da and d sine = (1/r^3 - 1/(r (1 + r))) da need only products. Differentiating the
    # expressions would repeat divisions and roots.
    one, sine, r, inverse = _relaxation_parts(*primals)
    cube = (inverse * (1 + r)) ** 3
    return (one, sine), (primals[0] * cube * tangents[0], (cube - inverse) * tangents[0])


def _relaxation_parts(a):
    a = clip_for_square(a)
    r = jnp.sqrt(1 + a * a)
    inverse = 1 / (r * (1 + r))
    sine = a * inverse
    return a * sine, sine, r, inverse


def _at_own_rates(F):
    """Return F(s = 1/tau_i) = F_inf + sum_j F_j tau_j / (tau_i + tau_j), with the shape of the weights."""
    rest = F.rest if F.tau.ndim == 1 else F.rest[:, None]
    # By logarithms, because 40 decades of tau overflow float32 in the value or the derivative.
    return rest + _sum_of_shares(F.weight, jnp.log(F.tau))


@jax.custom_jvp
def _sum_of_shares(weight, log_tau):
    """Return sum_j weight_j tau_j / (tau_i + tau_j)."""
    return jnp.sum(_pair_shares(log_tau) * weight[..., None, :], -1)


@_sum_of_shares.defjvp
@exact_products
def _sum_of_shares_jvp(primals, tangents):
    # Matrix products: elementwise derivatives of n^2 shares take several times as long.
    (weight, log_tau), (weight_dot, log_tau_dot) = primals, tangents
    share = _pair_shares(log_tau)
    slope = share * jnp.swapaxes(share, -1, -2) * weight[..., None, :]
    moved = _rows(slope, log_tau_dot) - jnp.sum(slope, -1) * log_tau_dot
    return _rows(share, weight), _rows(share, weight_dot) + moved


def _pair_shares(log_tau):
    """Return tau_j / (tau_i + tau_j), a matrix with rows i; the transposed matrix is 1 minus the matrix."""
    return jax.nn.sigmoid(log_tau[..., None, :] - log_tau[..., :, None])


def _rows(matrix, vector):
    return jnp.einsum("...ij,...j->...i", matrix, vector)
