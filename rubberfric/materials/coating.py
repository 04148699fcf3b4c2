r"""A layer bonded to a deformable half-space, where layer and base are elastic or Prony solids.

Sbar is the reduced stiffness of layer and base divided by E_r1 of a half-space of the layer's material. With
rho = mu_1/mu_0, x = q d, a = 3 - 4 nu_1 and b = 3 - 4 nu_0,

.. math:: \bar S = \frac{N_0\rho^2 + N_1\rho + N_2}{D_0\rho^2 + D_1\rho + D_2}
          = \alpha + \frac{R_1\rho + R_2}{D_0\rho^2 + D_1\rho + D_2}
          = \alpha + \sum_{k=1,2} \frac{w_k \cdot w_k r_k/\rho}{w_k + w_k r_k/\rho}

with the roots -r_k of D. Sbar is the stiffness of the layer as a free plate, in parallel with two pairs of
layer and base in series. A body of two Prony solids is therefore a Prony series at every q. N and D follow
from the continuity of displacements and stresses in plane strain. R_1, R_2 and the discriminant are written
as sums without cancellation. N_1 - alpha D_1 would lose all digits for thick layers, and the roots would
lose all digits for two incompressible solids.
"""

from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
from jax.typing import ArrayLike

from rubberfric.base.checks import POSITIVE, either
from rubberfric.base.objects.fields import Number, child, leaf
from rubberfric.base.objects.physical import kinds, physical
from rubberfric.materials.material import (
    Coatable,
    Material,
    Series,
    apply_vertical_shift,
    poisson_of,
    series_of,
)
from rubberfric.materials.slab import Layer, sinh_minus_linear
from rubberfric.materials.solids_in_series import two_in_series


@physical
class Coating(Layer):
    """A layer of the body's material, bonded to a deformable half-space.

    Parameters
    ----------
    thickness : d [m], > 0
    base : Elastic or Prony
        material of the half-space. If a Prony base has no shift, the shift of the body's material applies to
        the base.
    """

    multiplies: ClassVar[bool] = False

    thickness: Number = leaf(POSITIVE, unit="m")
    base: Coatable = child(hint=" (on a rigid base use Slab)")

    @property
    def below(self) -> Material:
        """Return `base`, the material of the half-space."""
        return self.base

    def varies(self, material: Material) -> bool:
        """Return True if temperature changes base and layer differently."""
        vertical = material.shift is not None and material.shift.vertical is not None
        return self.shift is not None or (vertical and not self.base.relaxes)

    def _base_shift(self, material):
        return material.shift if self.shift is None and self.base.relaxes else self.shift

    def _bonded(self, material):
        return Bonded(self.thickness, poisson_of(material), poisson_of(self.base))

    def check_material(self, material: Material) -> None:
        """Raise ValueError unless `material` is a `Coatable`, such as Elastic or Prony."""
        if not isinstance(material, Coatable):
            raise ValueError(
                f"Body.material is a {type(material).__name__} with a Coating: must be "
                f"{either(kinds(Coatable))}"
            )

    def static_reduced(
        self, material: Material, scale: ArrayLike, q: jax.Array, temperature: jax.Array | None = None
    ) -> jax.Array:
        """Return E_r Sbar of the coated body at zero frequency, divided by `scale` [-].

        `scale` is in Pa, `q` is the wavevector [1/m], and `temperature` is in K. E_r is the reduced modulus
        of the layer's material, and Sbar is the stiffness of the body relative to a half-space of this
        material.
        """
        layer, base = (
            apply_vertical_shift(solid.static_reduced() / scale, shift, temperature)
            for solid, shift in ((material, material.shift), (self.base, self._base_shift(material)))
        )
        return coated_spring(self._bonded(material), layer, base, q)

    def glassy_stiffening(self, material: Material, q: jax.Array) -> jax.Array:
        """Return Sbar [-] at wavevectors q [1/m] of any shape if layer and base are glassy."""
        layer, base = material.glassy_reduced(), self.base.glassy_reduced()
        return coated_spring(self._bonded(material), layer, base, q) / layer

    def reduced_series(
        self, material: Material, scale: ArrayLike, q: jax.Array, temperature: jax.Array | None = None
    ) -> Series:
        """Return E_r Sbar divided by `scale` [Pa] as a Prony series at every q [1/m] of shape (nodes,).

        All values belong to one temperature [K]. `coated_series` describes the shapes of the result. The
        relaxation times do not include a_T of the material. If the base has another shift, the relaxation
        times of the base therefore change with temperature.
        """
        layer, base = (series_of(solid, scale) for solid in (material, self.base))
        if temperature is not None:
            layer, base = (
                Series(
                    apply_vertical_shift(x.rest, shift, temperature),
                    apply_vertical_shift(x.weight, shift, temperature),
                    x.tau,
                )
                for x, shift in ((layer, material.shift), (base, self._base_shift(material)))
            )
            if self.shift is not None:
                factor = self.shift.log_factor(temperature)
                if material.shift is not None:
                    factor = factor - material.shift.log_factor(temperature)
                base = base._replace(tau=jnp.exp(factor) * base.tau)
        return coated_series(self._bonded(material), layer, base, q)


class Bonded(NamedTuple):
    """Thickness of a layer, and Poisson's ratios of the layer and of its base."""

    thickness: jax.Array  # d of the layer [m]
    layer: jax.Array  # nu_1 [-]
    base: jax.Array  # nu_0 [-]


class _Rational(NamedTuple):
    """Coefficients of Sbar = free + (R1 rho + R2) / (D0 rho^2 + D1 rho + D2).

    All fields except `free` are multiplied by e^(-2x), where x = q times the thickness of the layer.
    """

    free: jax.Array  # alpha, of the layer alone
    R1: jax.Array
    R2: jax.Array
    D0: jax.Array
    D1: jax.Array
    D2: jax.Array


class _Parts(NamedTuple):
    """Functions of 2x, where x = q times the thickness of the layer.

    All fields except `X` are multiplied by e^(-2x).
    """

    one: jax.Array  # 1
    cosh1: jax.Array  # cosh 2x - 1
    sinh: jax.Array  # sinh 2x
    cosh: jax.Array  # cosh 2x
    sum: jax.Array  # sinh 2x + 2x
    X: jax.Array  # 2x, without the factor


def _parts(bonded, q):
    x = q * bonded.thickness
    # There every correction to 1 is below e^-2x (2x)^2, and R^2 e^-4x does not underflow.
    x = jnp.minimum(x, 40.0 if x.dtype == jnp.float64 else 20.0)
    one, rise = jnp.exp(-2 * x), -jnp.expm1(-2 * x)
    cosh1, sinh = 0.5 * rise**2, 0.5 * rise * (1 + one)
    return _Parts(one, cosh1, sinh, cosh1 + one, sinh + 2 * x * one, 2 * x), x


def _rational(bonded, alpha, beta, q):
    """Return the `_Rational` at wavevectors q, where alpha = 2 - 4 nu_1 and beta = 2 - 4 nu_0.

    alpha is 0 for an incompressible layer, and beta is 0 for an incompressible base.
    """
    (one, cosh1, sinh, cosh, both, X), x = _parts(bonded, q)
    half = jnp.exp(-x)
    # 2 (sinh x - x)(sinh x + x) / (sinh 2x + 2x)
    plus = 0.5 * -jnp.expm1(-2 * x) + x * half
    free = 2 * sinh_minus_linear(0.5 * x, half) * plus / both
    square = 0.5 * X * X
    R1 = (
        2 * (2 + alpha + beta) * (cosh1 + X * sinh + square * cosh)
        + alpha * beta * (cosh1 * (1 + X + square) + sinh * (X + square) + square * one)
        + beta * (X * X * sinh + 2 * X * cosh1)
    )
    R2 = (2 + alpha) * (2 * X * cosh + sinh * (2 + alpha + X * X) + alpha * X * one)
    D0 = 2 * (1 + beta) * both
    D1 = 2 * (2 + alpha + beta) * cosh + alpha * beta - 2 * X * beta * one
    D2 = 2 * ((1 + alpha) * sinh_minus_linear(x, one) + alpha * X * one)
    scale = one / both
    return _Rational(free, scale * R1, scale * R2, D0, D1, D2)


def _discriminant(bonded, alpha, beta, q):
    """Return (D1^2 - 4 D0 D2) e^(-4x) as a square plus a remainder.

    For two incompressible solids, the difference of D1^2 and 4 D0 D2 would lose all digits.
    """
    (one, _, sinh, cosh, _, X), _ = _parts(bonded, q)
    # D1 without its share of X sinh: alpha beta e^2x + 2 alpha cosh 2x + 2 beta (cosh 2x - 2x)
    split = alpha * beta + 2 * alpha * cosh + 2 * beta * (cosh - X * one)
    remainder = (
        16 * (1 + X * X) * one
        + 16 * beta * ((1 + X * X) * one - X * cosh)
        + 16 * alpha * (one - X * sinh)
        + alpha * beta * (12 * one - 4 * one**3 - 16 * X * sinh)
    )
    return split**2 + one * remainder


def _skew(bonded, alpha, beta, q):
    """Return (D1 R1 - 2 D0 R2) (sinh 2x + 2x) e^(-4x) without cancellation.

    The result is computed as a polynomial in alpha and beta. The names o, c and s stand for e^(-2x),
    (cosh 2x - 1) e^(-2x) and sinh 2x e^(-2x).
    """
    (o, c, s, cosh, _, X), _ = _parts(bonded, q)
    X2, X3 = X * X, X * X * X
    falling = -16 * o * c + 8 * X * s * (c - 2 * o) + 4 * X2 * (c * c - 2 * o * o)
    last = -4 * o * c + 4 * X * s * (c - o) + 2 * X2 * (c * c + 2 * o * c - o * o)
    none = (
        -8 * o * (2 * c + X2 * (o + 2 * c) + 2 * X * s + X3 * s),
        -16 * o * (c + X * s)
        - 8 * X2 * o * (o + 2 * c)
        - 8 * X3 * o * s
        - 4 * X3 * o * cosh
        + 4 * X2 * s * (c - o)
        + 8 * X * c * c,
        4 * c * cosh
        + 4 * X * s * cosh
        + 2 * X2 * (o * o + c * c)
        + 2 * X2 * s * (c - o)
        - 2 * X3 * o * (cosh + s)
        + 4 * X * c * c,
    )
    first = (
        falling - 4 * X3 * o * s,
        falling + 12 * X * c * cosh + 4 * c * s + 2 * X2 * s * (o + 3 * c) - 2 * X3 * o * (cosh + 2 * s),
        4 * c * cosh
        + 6 * X * c * cosh
        + 2 * c * s
        + 2 * X * s * (2 * o + 3 * c)
        + X2 * (2 * o * o + 4 * o * c + 3 * c * c)
        + X2 * s * (o + 3 * c)
        - X3 * o * (cosh + s),
    )
    second = (
        last,
        last + 6 * X * o * c + 4 * X * c * c + 2 * c * s + 2 * X2 * s * cosh,
        0.5 * X2 * o * o
        + (X + X2) * o * s
        + (1 + 3 * X + 2 * X2) * o * c
        + (1 + 2 * X + X2) * c * s
        + (1 + 2 * X + X2) * c * c,
    )
    in_beta = [p[0] + beta * (p[1] + beta * p[2]) for p in (none, first, second)]
    return in_beta[0] + alpha * (in_beta[1] + alpha * in_beta[2])


def _numbers(bonded):
    """Return alpha = 2 - 4 nu_1, beta = 2 - 4 nu_0 and the ratio (mu_0 / mu_1) / (E_r0 / E_r1)."""
    layer, base = bonded.layer, bonded.base
    return 2 * (1 - 2 * layer), 2 * (1 - 2 * base), (1 - base) / (1 - layer)


def coated_spring(bonded: Bonded, layer: jax.Array, base: jax.Array, q: jax.Array) -> jax.Array:
    """Return the stiffness E_r1 Sbar of a coated body whose solids do not relax, at wavevectors q [1/m].

    `layer` and `base` are E_r1 and E_r0 >= 0 in the unit of the result, which tends to E_r1 for q d ->
    infinity and to E_r0 for q d -> 0. For E_r0 -> infinity the result is that of a bonded Slab.
    """
    alpha, beta, ratio = _numbers(bonded)
    free, R1, R2, D0, D1, D2 = _rational(bonded, alpha, beta, q)
    base = base * ratio
    largest = jax.lax.stop_gradient(jnp.maximum(layer, base))
    largest = jnp.where(largest > 0, largest, 1.0)  # two liquids at rest: 0
    one, two = layer / largest, base / largest
    bottom = D0 * one * one + D1 * one * two + D2 * two * two
    shared = two * (R1 * one + R2 * two) / jnp.where(bottom > 0, bottom, 1.0)
    return layer * (free + shared)


def coated_series(bonded: Bonded, layer: Series, base: Series, q: jax.Array) -> Series:
    """Return the stiffness E_r1 Sbar of a coated body as a Prony series at every q [1/m] of shape (nodes,).

    `layer` and `base` are the series of E_r1 and of E_r0, with shapes (), (n,) and (n,), n >= 0. The result
    has the shapes (nodes,), (nodes, terms) and (nodes, terms).
    """
    free, size, of_layer, of_base = _in_series(bonded, q)
    rest, weight, tau = _times(layer, free)
    # The two pairs are evaluated together, which halves the compile time.
    pairs = two_in_series(_times(layer, of_layer.reshape(-1)), _times(base, jnp.tile(of_base, 2)))
    pairs = _times(pairs, size.reshape(-1))
    rests, weights, times = (x.reshape(2, q.size, *x.shape[1:]) for x in pairs)
    return Series(
        rest + rests.sum(0),
        jnp.concatenate([weight, *weights], -1),
        jnp.concatenate([jnp.broadcast_to(tau, weight.shape), *times], -1),
    )


def _times(series, factor):
    rest, weight, tau = series
    return factor * rest, factor[:, None] * weight, tau


def _in_series(bonded, q):
    """Return `free`, `size`, `of_layer` and `of_base`, which express E_r1 Sbar by solids in series.

    E_r1 Sbar = free E_r1 + sum_k size_k f_k g / (f_k + g) with f_k = of_layer_k E_r1 and g = of_base E_r0.
    The index k numbers the two pairs of layer and base, so `size` and `of_layer` have the shape (2, nodes).
    `size` is a separate factor because it may round to 0, where f_k g / (f_k + g) must stay finite.
    """
    alpha, beta, ratio = _numbers(bonded)
    free, R1, _, D0, D1, D2 = _rational(bonded, alpha, beta, q)
    root = jnp.sqrt(_discriminant(bonded, alpha, beta, q))
    parts, _ = _parts(bonded, q)
    skew = parts.one / parts.sum * _skew(bonded, alpha, beta, q) / root
    # If one of the two sums is much larger, rounding may make the smaller sum negative.
    size = jnp.maximum(jnp.stack([R1 + skew, R1 - skew]), 0.0)
    # D2 only in the layer's factor: for a thin incompressible layer it is x^3, and its derivative is x.
    of_layer = jnp.stack([1 / (D1 + root), (D1 + root) / (4 * D0 * D2)])
    return free, size, of_layer, ratio / (2 * D0)
