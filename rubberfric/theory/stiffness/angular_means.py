r"""Angular integrals of the series stiffness over the direction of sliding.

For F(omega), omega = q v cos(phi), three means over phi:

    power       <|F|^2>            enters G
    dissipation <cos(phi) Im F>    enters mu
    storage     <Re F>             enters u_bar

and for anisotropic roughness their harmonics: the same with cos(2 m phi), and <sin(phi) Im F
sin(2 m phi)>, the transverse friction. In closed form for Prony series, by the residues at
s = i omega = 1/tau_i: with a_i = q v tau_i and r_i = sqrt(1 + a_i^2),

.. math:: \langle|F|^2\rangle = F_\infty^2 + 2\sum_i F_i F(s = 1/\tau_i)\,(1 - 1/r_i)
.. math:: \langle\cos\varphi\,\mathrm{Im} F\rangle = \sum_i F_i \frac{a_i}{r_i (1 + r_i)},\qquad
          \langle\mathrm{Re} F\rangle = F_\infty + \sum_i F_i (1 - 1/r_i)

.. math:: \left\langle\frac{a^2\cos^2\varphi}{1 + a^2\cos^2\varphi}\cos 2m\varphi\right\rangle
          = \frac{(-1)^{m-1}}{r}\rho^m,\qquad \rho = \left(\frac{a}{1+r}\right)^2

One square root and one division for each node, term and velocity: no angular grid.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.theory.stiffness.series import Relaxing, Tabulated
from rubberfric.theory.stiffness.tabulated_means import means_table, tabulated_means


class Means(NamedTuple):
    """Angular means of F; those not asked for, and a dissipation that is zero, are None.

    Each is a tuple: one array, but of the power two, <F'^2> and <F''^2>, if they are asked for apart.
    """

    power: tuple | None
    dissipation: tuple | None
    storage: tuple | None
    transverse: tuple | None = None


def with_means(F, wanted, split=False, mix=None):
    """F with the table of its means, if it is Tabulated and they depend on q v alone.

    No velocity or temperature changes the table: it is made once, for every call of `angular_means`
    with the same split and mix.
    """
    if not isinstance(F, Tabulated):
        return F
    return F._replace(table=means_table(F, wanted, split, mix))


def angular_means(F, qv, wanted, split=False, mix=None):
    """Means of F for roughness passing at q v.

    Parameters
    ----------
    F : Relaxing or Tabulated
    qv : q v a_T [1/s], shape (points, nodes); negative for reversed sliding
    wanted : set of "power", "dissipation", "storage", "transverse"
    split : bool
        whether <F'^2> and <F''^2> are wanted apart.
    mix : shares (c_m, s_m) of the harmonics, which are added to the means, shape (harmonics,) each, or
        (harmonics, ...) broadcastable with qv where they depend on q; None: no harmonics. Not with split.

    Returns
    -------
    Means, arrays of the shape of qv.
    """
    if isinstance(F, Relaxing):
        if split:
            return _split_form(F, qv, wanted)
        means = _closed_form(F, qv, wanted)
        return means if mix is None else _with_harmonics(F, qv, wanted, mix, means)
    return Means(*tabulated_means(F, qv, wanted, split, mix))


def static_means(F, wanted):
    """The same for a stiffness that does not relax (Static): no dissipation."""
    return Means(
        (F.value**2,) if "power" in wanted else None, None, (F.value,) if "storage" in wanted else None
    )


def _closed_form(F, qv, wanted):
    weights = {
        "power": 2 * F.weight * _at_own_rates(F) if "power" in wanted else None,
        "dissipation": F.weight if "dissipation" in wanted else None,
        "storage": F.weight if "storage" in wanted else None,
    }
    if F.tau.ndim == 1:
        sums = _sums(weights, F.tau, qv)
    else:
        weights = {name: None if w is None else w.T[:, None, :] for name, w in weights.items()}
        sums = _sums_of_rows(weights, F.tau.T[:, None, :] * qv)
    return Means(
        None if sums["power"] is None else (F.rest**2 + sums["power"],),
        None if sums["dissipation"] is None else (sums["dissipation"],),
        None if sums["storage"] is None else (F.rest + sums["storage"],),
    )


def _with_harmonics(F, qv, wanted, mix, means):
    """The closed forms with their harmonics added, summed by Horner's scheme for each node and term."""
    if F.tau.ndim == 1:
        front = (slice(None), *(None,) * qv.ndim)
        a, weight, at_rates = F.tau[front] * qv, F.weight[front], _at_own_rates(F)[front]
    else:
        a, weight, at_rates = (x.T[:, None, :] for x in (F.tau, F.weight, _at_own_rates(F)))
        a = a * qv
    _, sine, r, _ = _relaxation_parts(a)
    quotient = sine * r  # a / (1 + r), at most 1
    ratio = quotient**2
    # Terms of the first harmonic.
    first = {
        "power": 2 * weight * at_rates * (ratio / r),
        "dissipation": weight * (sine / (1 + r)),
        "storage": weight * (ratio / r),
        "transverse": weight * (quotient / (1 + r)),
    }
    series = {"transverse": _series(mix[1], -ratio) if "transverse" in wanted else None}
    cosine = _series(mix[0], -ratio)

    def mixed(name):
        added = jnp.sum(first[name] * series.get(name, cosine), 0)
        isotropic = getattr(means, name)
        return (added if isotropic is None else isotropic[0] + added,)

    return Means(*(mixed(name) if name in wanted else None for name in Means._fields))


@jax.custom_jvp
def _series(coefficients, x):
    """Polynomial in x, its coefficients ascending along their first axis."""
    value = jnp.zeros_like(x)
    for c in coefficients[::-1]:
        value = value * x + c
    return value


@_series.defjvp
def _series_jvp(primals, tangents):
    # Only the slope is kept for reverse mode, not every step.
    coefficients, x = primals
    order = jnp.arange(1, coefficients.shape[0], dtype=x.dtype)
    slope = _series(order.reshape(-1, *(1,) * (coefficients.ndim - 1)) * coefficients[1:], x)
    return _series(coefficients, x), _series(tangents[0], x) + slope * tangents[1]


def _split_form(F, qv, wanted):
    r"""The same with the power in two, sums over pairs of terms, all positive.

    .. math:: \langle F''^2\rangle = \sum_{ij} \frac{F_i F_j s_i s_j}{r_i + r_j},\quad s = \frac{a}{r},\qquad
              \langle F'^2\rangle = \Big(F_\infty + \sum_i F_i o_i\Big)^2
              + \sum_{ij} \frac{F_i F_j o_i o_j}{r_i + r_j},\quad o = 1 - \frac{1}{r}
    """
    front = (slice(None), *(None,) * qv.ndim)
    weight = F.weight[front]
    one, sine, r, _ = _relaxation_parts(F.tau[front] * qv)
    ones, sines = weight * one, weight * (sine * (1 + r))
    storage = F.rest + jnp.sum(ones, 0)
    power = None
    if "power" in wanted:
        power = storage**2 + _pairs(ones, r), _pairs(sines, r)
    return Means(
        power,
        (jnp.sum(weight * sine, 0),) if "dissipation" in wanted else None,
        (storage,) if "storage" in wanted else None,
    )


@jax.custom_jvp
def _pairs(x, r):
    """sum_ij x_i x_j / (r_i + r_j)."""
    total = 0.0
    for i in range(r.shape[0]):
        # The pairs i < j twice.
        total = total + x[i] * (2 * jnp.sum(x[i:] / (r[i] + r[i:]), 0) - x[i] / (2 * r[i]))
    return total


@_pairs.defjvp
def _pairs_jvp(primals, tangents):
    # Row by row, so that reverse mode keeps two numbers for each term instead of one for each pair.
    (x, r), (dx, dr) = primals, tangents
    rows = [1 / (r[i] + r) for i in range(r.shape[0])]
    first = jnp.stack([jnp.sum(x * share, 0) for share in rows])
    second = jnp.stack([jnp.sum(x * share * share, 0) for share in rows])
    return jnp.sum(x * first, 0), 2 * jnp.sum(first * dx - x * second * dr, 0)


@jax.custom_jvp
def _sums(weights, tau, qv):
    """Sums over the terms at every q v, in one pass: nothing of the size terms x points is stored."""
    front = (slice(None), *(None,) * qv.ndim)
    weights = {name: None if w is None else w[front] for name, w in weights.items()}
    return _sums_of_rows(weights, tau[front] * qv)


@_sums.defjvp
def _sums_jvp(primals, tangents):
    return jax.jvp(_sums_as_products, primals, tangents)


def _sums_as_products(weights, tau, qv):
    """The same as matrix products over one long row of points: slower, but its derivative is quicker."""
    one, sine = _relaxation(tau[:, None] * qv.reshape(-1))
    parts = {"power": one, "dissipation": sine, "storage": one}
    return {name: None if w is None else (w @ parts[name]).reshape(qv.shape) for name, w in weights.items()}


def _sums_of_rows(weights, a):
    """Sums over the first axis."""
    one, sine = _relaxation(a)
    parts = {"power": one, "dissipation": sine, "storage": one}
    return {name: None if w is None else jnp.sum(w * parts[name], 0) for name, w in weights.items()}


@jax.custom_jvp
def _relaxation(a):
    """1 - 1/r and a / (r (1 + r)) for r = sqrt(1 + a^2), the first without cancellation."""
    return _relaxation_parts(a)[:2]


@_relaxation.defjvp
def _relaxation_jvp(primals, tangents):
    # d(1 - 1/r) = a/r^3 da and d sine = (1/r^3 - 1/(r (1 + r))) da: products only, where
    # differentiating the expressions themselves would divide and take roots again.
    one, sine, r, inverse = _relaxation_parts(*primals)
    cube = (inverse * (1 + r)) ** 3
    return (one, sine), (primals[0] * cube * tangents[0], (cube - inverse) * tangents[0])


def _relaxation_parts(a):
    # a^2 must not overflow; beyond the bound 1 - 1/r is 1 to the last bit anyway.
    bound = 1e150 if a.dtype == jnp.float64 else 1e18
    a = jnp.clip(a, -bound, bound)
    r = jnp.sqrt(1 + a * a)
    inverse = 1 / (r * (1 + r))
    sine = a * inverse
    return a * sine, sine, r, inverse


def _at_own_rates(F):
    """F(s = 1/tau_i) = F_inf + sum_j F_j tau_j / (tau_i + tau_j), shape of the weights."""
    tau = F.tau
    # tau_j / (tau_i + tau_j) through logarithms: 40 decades of tau leave float32 otherwise,
    # in the value or in the derivative.
    log_tau = jnp.log(tau)
    share = jax.nn.sigmoid(log_tau[..., None, :] - log_tau[..., :, None])
    rest = F.rest if tau.ndim == 1 else F.rest[:, None]
    return rest + jnp.sum(share * F.weight[..., None, :], -1)
