r"""A layer bonded to a deformable half-space.

Sbar is the reduced stiffness of layer and base divided by E_r1 of a half-space of the layer's material. With
rho = mu_1/mu_0, x = q d, a = 3 - 4 nu_1 and b = 3 - 4 nu_0,

.. math:: \bar S = \frac{N_0\rho^2 + N_1\rho + N_2}{D_0\rho^2 + D_1\rho + D_2}
          = \alpha + \frac{R_1\rho + R_2}{D_0\rho^2 + D_1\rho + D_2}
          = \alpha + \sum_{k=1,2} \frac{w_k \cdot w_k r_k/\rho}{w_k + w_k r_k/\rho}

with the roots -r_k of D. Sbar is the stiffness of the layer as a free plate, in parallel with two pairs of
layer and base in series. N and D follow from the continuity of displacements and stresses in plane strain.
R_1, R_2 and the discriminant are written as sums without cancellation. N_1 - alpha D_1 would lose all digits
for thick layers, and the roots would lose all digits for two incompressible solids. rho is complex if a solid
relaxes.
"""

from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp

from rubberfric.base.checks import POSITIVE
from rubberfric.base.objects.fields import Number, child, leaf
from rubberfric.base.objects.physical import physical
from rubberfric.materials.in_series import in_series, times
from rubberfric.materials.material import Material, poisson_of
from rubberfric.materials.shifts import Shift
from rubberfric.materials.slab import Layer, sinh_minus_linear


@physical
class Coating(Layer):
    """A layer of the body's material, bonded to a deformable half-space.

    Parameters
    ----------
    thickness : d [m], > 0
    base : material of the half-space, with a constant Poisson's ratio
        If a viscoelastic base has no shift, the shift of the body's material applies to the base.

    Examples
    --------
    >>> base, rubber = rf.Elastic(young=3e6, poisson=0.5), rf.Elastic(young=30e6, poisson=0.5)
    >>> body = rf.Body(rubber, layer=rf.Coating(thickness=1e-3, base=base))
    >>> q = np.array([1e-2, 1e5])
    >>> E_r = body.layer.E_r_S_bar(0.5, q, rubber.static_reduced(), base.static_reduced())
    >>> (0.75 * np.asarray(E_r)).round(-3)  # E = 3/4 E_r of an incompressible solid
    array([ 3000000., 30000000.])
    """

    multiplies: ClassVar[bool] = False

    thickness: Number = leaf(POSITIVE, unit="m")
    base: Material = child(hint=" (on a rigid base use Slab)")

    def _check(self):
        _check_solid("Coating.base", self.base)

    @property
    def below(self) -> Material | None:
        """Return `base`, the material of the half-space."""
        return self.base

    def varies(self, material: Material) -> bool:
        """Return True if temperature changes base and layer differently."""
        vertical = material.shift is not None and material.shift.vertical is not None
        return self.shift is not None or (vertical and not self.base.relaxes)

    def base_shift(self, material: Material) -> Shift | None:
        """Return the shift of the base if the layer consists of `material`."""
        return material.shift if self.shift is None and self.base.relaxes else self.shift

    def check_material(self, material: Material) -> None:
        """Raise ValueError unless `material` deforms and has a constant Poisson's ratio."""
        _check_solid("Body.material with a Coating", material)

    def E_r_S_bar(
        self, poisson: jax.Array, q: jax.Array, layer: jax.Array, base: jax.Array | None
    ) -> jax.Array:
        """Return E_r Sbar of the coated body, which tends to E_r of the layer for q d -> infinity.

        `Layer.E_r_S_bar` describes the arguments. For q d -> 0 the result tends to E_r of the base. For a
        base that is much stiffer it is that of a bonded Slab.
        """
        assert base is not None
        nu_0 = poisson_of(self.base)
        pairs = _pairs(q * self.thickness, 2 * (1 - 2 * poisson), 2 * (1 - 2 * nu_0))
        base = times(pairs.of_base * ((1 - nu_0) / (1 - poisson)), base)
        free = times(pairs.free, layer)
        first, second = (
            times(size, in_series(times(of_layer, layer), base))
            for size, of_layer in zip(pairs.size, pairs.of_layer, strict=True)
        )
        return free + (first + second)


def _check_solid(name, material):
    if not material.deforms or material.poisson is None:
        raise ValueError(
            f"{name} is a {type(material).__name__}: must be a deformable material with a constant Poisson's "
            "ratio, such as Elastic, Prony or TabulatedModulus; on a rigid base use Slab"
        )


class _Pairs(NamedTuple):
    """E_r Sbar = free E_r1 + sum_k size_k times of_layer_k E_r1 in series with of_base E_r0, k = 1, 2."""

    free: jax.Array
    # A separate factor, because it may round to 0, where the pair must stay finite.
    size: tuple[jax.Array, jax.Array]
    of_layer: tuple[jax.Array, jax.Array]
    of_base: jax.Array


def _pairs(x, alpha, beta):
    """Return the `_Pairs` at x = q d, without the ratio of mu_0 / mu_1 to E_r0 / E_r1."""
    free, R1, _, D0, D1, D2 = _rational(x, alpha, beta)
    root = jnp.sqrt(_discriminant(x, alpha, beta))
    parts, _ = _parts(x)
    skew = parts.one / parts.sum * _skew(x, alpha, beta) / root
    # If one of the two sums is much larger, rounding may make the smaller sum negative.
    size = jnp.maximum(R1 + skew, 0.0), jnp.maximum(R1 - skew, 0.0)
    # D2 only in the layer's factor: for a thin incompressible layer it is x^3, and its derivative is x.
    return _Pairs(free, size, (1 / (D1 + root), (D1 + root) / (4 * D0 * D2)), 1 / (2 * D0))


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


def _parts(x):
    # There every correction to 1 is below e^-2x (2x)^2, and R^2 e^-4x does not underflow.
    x = jnp.minimum(x, 40.0 if x.dtype == jnp.float64 else 20.0)
    one, rise = jnp.exp(-2 * x), -jnp.expm1(-2 * x)
    cosh1, sinh = 0.5 * rise**2, 0.5 * rise * (1 + one)
    return _Parts(one, cosh1, sinh, cosh1 + one, sinh + 2 * x * one, 2 * x), x


def _rational(x, alpha, beta):
    """Return the `_Rational` at x = q d, where alpha = 2 - 4 nu_1 and beta = 2 - 4 nu_0.

    alpha is 0 for an incompressible layer, and beta is 0 for an incompressible base.
    """
    (one, cosh1, sinh, cosh, both, X), x = _parts(x)
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


def _discriminant(x, alpha, beta):
    """Return (D1^2 - 4 D0 D2) e^(-4x) as a square plus a remainder.

    For two incompressible solids, the difference of D1^2 and 4 D0 D2 would lose all digits.
    """
    (one, _, sinh, cosh, _, X), _ = _parts(x)
    # D1 without its share of X sinh: alpha beta e^2x + 2 alpha cosh 2x + 2 beta (cosh 2x - 2x)
    split = alpha * beta + 2 * alpha * cosh + 2 * beta * (cosh - X * one)
    remainder = (
        16 * (1 + X * X) * one
        + 16 * beta * ((1 + X * X) * one - X * cosh)
        + 16 * alpha * (one - X * sinh)
        + alpha * beta * (12 * one - 4 * one**3 - 16 * X * sinh)
    )
    return split**2 + one * remainder


def _skew(x, alpha, beta):
    """Return (D1 R1 - 2 D0 R2) (sinh 2x + 2x) e^(-4x) without cancellation.

    The result is computed as a polynomial in alpha and beta. The names o, c and s stand for e^(-2x),
    (cosh 2x - 1) e^(-2x) and sinh 2x e^(-2x).
    """
    (o, c, s, cosh, _, X), _ = _parts(x)
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
