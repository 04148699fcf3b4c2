r"""Materials: the complex Young's modulus E(omega) = E' + i E'', with E'' > 0 for omega > 0.

Contact mechanics uses the reduced modulus E_r = E / (1 - nu^2). Means of the stiffness over the direction of
sliding have closed forms for a Prony series. For every other material they follow from `Material.modulus`.
Solids without relaxation are defined here.
"""

from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.blocks import broadcast_shape
from rubberfric.base.checks import (
    PLAUSIBLE_STRESS,
    POSITIVE,
    ArrayLike,
    NumberLike,
    as_numbers,
    between,
    is_concrete,
)
from rubberfric.base.compilation import exact_products
from rubberfric.base.objects.fields import Number, leaf
from rubberfric.base.objects.physical import Kind, check_kind, kinds, physical
from rubberfric.materials.in_series import times
from rubberfric.materials.shifts import Shift, log_vertical

# Poisson's ratios of stable solids that do not widen when stretched. 0.5 is incompressible.
POISSON = between(0.0, 0.5)


class Series(NamedTuple):
    r"""Prony series f(omega) = rest + sum_i weight_i i omega tau_i / (1 + i omega tau_i)."""

    rest: jax.Array  # shape ()
    weight: jax.Array  # same unit, shape (n,), n >= 0
    tau: jax.Array  # [s], shape (n,)


class Material(Kind):
    """Modulus of a solid: base class of Rigid, Elastic, Prony, PronyShear and TabulatedModulus.

    A subclass implements `modulus` and `frequency_range`. If E_r is a Prony series, it implements
    `reduced_series` instead. The base class derives the other methods.
    """

    deforms: ClassVar[bool] = True
    # True if E depends on omega.
    relaxes: ClassVar[bool] = True
    # Poisson's ratio [-]; None if it depends on the frequency. Such a body has no layer.
    poisson: jax.Array | None = None
    # Change with temperature, E(omega, T) = b_T E(a_T omega).
    shift: Shift | None = None

    @property
    def has_series(self) -> bool:
        """Return True if E_r is a Prony series."""
        return type(self).reduced_series is not Material.reduced_series

    @property
    def loss_beyond(self) -> str:
        """Return the form of E'' beyond `frequency_range`, where E' is constant.

        With "fall", E'' is proportional to omega below the range and to 1/omega above the range. With "hold",
        E'' is constant. With "none", E'' is zero.
        """
        return "fall"

    @property
    def detail(self) -> float | None:
        """Return the width in ln omega of the finest detail of E [-], or None.

        E is as smooth as a function that is convolved with a Gaussian of this width. None: E is a
        relaxation spectrum convolved with i omega tau / (1 + i omega tau), as every model of springs and
        dashpots is. A material with sharper features states their width.
        """
        return None

    @property
    def loss_at_rest(self) -> bool:
        """Return True if E'' stays above 0 for omega -> 0.

        The friction then jumps at v = 0, where the velocity changes sign.
        """
        return self.loss_beyond == "hold"

    def modulus(self, omega: jax.Array) -> jax.Array:
        """Return the complex modulus E(omega) [Pa] at the reference temperature.

        omega [rad/s] must be >= 0 and may have any shape. Beyond `frequency_range`, E' tends to constants and
        E'' follows `loss_beyond`.
        """
        if not self.has_series:
            raise NotImplementedError(f"{type(self).__name__}.modulus")
        return series_modulus(series_of(self, plane_strain_factor(self)), omega)

    def frequency_range(self) -> tuple[jax.Array, jax.Array] | None:
        """Return the lowest and highest omega [rad/s] between which E changes, or None if E is constant."""
        times = self.relaxation_times()
        if times is None or times.size == 0:
            return None
        # Concrete numbers by NumPy, which compiles nothing.
        times = np.asarray(times) if is_concrete(times) else times
        return 1 / times.max(), 1 / times.min()

    def reduced_series(self, scale: NumberLike) -> Series | None:
        """Return E_r divided by `scale` [Pa] as a Prony series, or None if E_r is not a Prony series.

        The series of an elastic solid has no terms.
        """
        del scale

    def relaxation_times(self) -> jax.Array | None:
        """Return the relaxation times [s] of shape (n,), or None if E_r is not a Prony series."""
        series = self.reduced_series(1.0)
        return None if series is None else series.tau

    def reduced_modulus(self, omega: jax.Array) -> jax.Array:
        """Return E_r = E / (1 - nu^2) [Pa], complex, at the reference temperature; see `modulus`."""
        return times(plane_strain_factor(self), self.modulus(omega))

    def reduced_on_grid(self, first: jax.Array, step: float, count: int) -> jax.Array:
        """Return E_r [Pa], complex, at ln omega = step (first + k) for k = 0 ... count - 1."""
        return self.reduced_modulus(jnp.exp(step * (first + jnp.arange(count, dtype=jnp.result_type(first)))))

    def quick(self) -> "Material":
        """Return a material with the same E that is evaluated quickly at many frequencies."""
        return self

    def static_modulus(self) -> jax.Array:
        """Return E(omega = 0) [Pa], real."""
        return series_of(self, plane_strain_factor(self)).rest if self.has_series else self._end(0)

    def static_reduced(self) -> jax.Array:
        """Return E_r(omega = 0) [Pa], real."""
        return self.static_modulus() * plane_strain_factor(self)

    def glassy_reduced(self) -> jax.Array:
        """Return E_r at infinite frequency [Pa], which is real and the largest absolute value of E_r."""
        if not self.has_series:
            return self._end(1) * plane_strain_factor(self)
        series = series_of(self, plane_strain_factor(self))
        return (series.rest + jnp.sum(series.weight)) * plane_strain_factor(self)

    def is_liquid(self) -> bool:
        """Return True if the static modulus is 0.

        Return False if the static modulus is traced, because the value is then unknown.
        """
        static = self.static_modulus()
        # NumPy arrays, because operations on JAX arrays within jit would be traced.
        return is_concrete(static) and not np.any(np.asarray(static))

    def _end(self, which):
        """Return E' [Pa] at the lower end (`which` = 0) or upper end (1) of `frequency_range`."""
        ends = self.frequency_range()
        if ends is None:
            raise ValueError(
                f"material is {type(self).__name__}, which has no modulus; use a deformable material"
            )
        return jnp.real(self.modulus(jnp.asarray(ends[which])))


@physical
class Rigid(Material):
    """Rigid solid: the compliance M is 0.

    Examples
    --------
    >>> road = rf.Body(rf.Rigid(), rf.SelfAffine(q0=100.0, qr=1000.0, q1=1e5, hurst=0.8, h_rms=0.5e-3))
    >>> scene = rf.Scene(lower=road, upper=rf.Body(rf.Elastic(young=3e6, poisson=0.5)))
    >>> rf.quantities_of(scene)
    ('area', 'friction', 'separation')
    """

    deforms: ClassVar[bool] = False
    relaxes: ClassVar[bool] = False


@physical
class Elastic(Material):
    """Elastic solid, E(omega) = young.

    Parameters
    ----------
    young : Young's modulus [Pa], > 0
    poisson : Poisson's ratio [-], 0 ... 0.5

    Examples
    --------
    >>> glass = rf.Elastic(young=70e9, poisson=0.22)
    >>> round(float(glass.static_reduced()) / 1e9, 2)
    73.56
    """

    relaxes: ClassVar[bool] = False

    young: Number = leaf(POSITIVE, unit="Pa", plausible=PLAUSIBLE_STRESS)
    poisson: Number = leaf(POISSON, unit="-")

    def reduced_series(self, scale: NumberLike) -> Series:
        """Return E_r divided by `scale` [Pa] as a Prony series without terms."""
        nothing = jnp.zeros(0, jnp.result_type(self.young))
        return Series(self.young * (plane_strain_factor(self) / scale), nothing, nothing)


def poisson_of(material: Material) -> jax.Array:
    """Return the constant Poisson's ratio of a material [-]; ValueError if it depends on the frequency."""
    if material.poisson is None:
        raise ValueError(f"material must have a constant Poisson's ratio, got a {type(material).__name__}")
    return material.poisson


def series_of(material: Material, scale: NumberLike) -> Series:
    """Return `material.reduced_series(scale)`, or raise ValueError if E_r is not a Prony series."""
    series = material.reduced_series(scale)
    if series is None:
        raise ValueError(f"material must be a Prony series, got a {type(material).__name__}")
    return series


def plane_strain_factor(material: Material) -> jax.Array:
    """Return 1 / (1 - poisson^2) [-], without cancellation for poisson -> 1."""
    poisson = poisson_of(material)
    return 1.0 / ((1.0 - poisson) * (1.0 + poisson))


def E_r(
    material: Material, omega: jax.Array | None, T: NumberLike | None = None, shift: Shift | None = None
) -> jax.Array:
    """Return E / (1 - nu^2) [Pa], complex, with the shifts a_T and b_T.

    Parameters
    ----------
    material : Material that deforms
    omega : [rad/s], any sign and shape; None: omega = 0
    T : [K], broadcastable to omega; None: the reference temperature
    shift : None: the shift of the material
    """
    shift = material.shift if shift is None else shift
    if omega is not None and T is not None and shift is not None:
        omega = omega * jnp.exp(shift.log_factor(T))
    reduced = (
        material.static_reduced() if omega is None else _signed(material, material.reduced_modulus, omega)
    )
    return apply_vertical_shift(reduced, shift, T)


def _signed(material, modulus, omega):
    """Return a modulus at omega of any sign; E(-omega) is the complex conjugate of E(omega).

    `modulus` is a method of the material for omega >= 0.
    """
    if material.has_series:
        return modulus(omega)
    # ln 0 has no finite derivative. Below the least frequency E' is constant and E'' is linear, with the
    # right derivative at rest; if E'' does not vanish there, only its sign remains.
    least = float(jnp.finfo(omega.dtype).tiny) ** (1 / 3)
    E = modulus(jnp.maximum(jnp.abs(omega), least))
    odd = jnp.sign(omega) if material.loss_at_rest else jnp.clip(omega / least, -1.0, 1.0)
    return jax.lax.complex(jnp.real(E), odd * jnp.imag(E))


def complex_modulus(material: Material, omega: ArrayLike, temperature: ArrayLike | None = None) -> jax.Array:
    r"""Return the complex Young's modulus E(omega, T) [Pa].

    Plots, fits of master curves and tests use this function. The contact integrals are defined with this
    modulus but computed by closed forms, or by quadrature over E' and E''.

    Parameters
    ----------
    material : Elastic, Prony, PronyShear or TabulatedModulus
    omega : angular frequency, any real number [rad/s]
    temperature : broadcastable to omega [K], or None for the reference temperature

    Raises
    ------
    ValueError : if the material is Rigid or not a material, if frequencies or temperatures are not numbers,
        if a concrete temperature is <= 0, or if the shapes do not broadcast.

    Examples
    --------
    >>> rubber = rf.Prony(E_inf=1e6, E=[1e7], tau=[1e-3], poisson=0.5)
    >>> f"{complex(rf.complex_modulus(rubber, 1e3)):.3g}"
    '6e+06+5e+06j'
    """
    rigid = [cls for cls in kinds(Material).values() if not cls.deforms]
    if isinstance(material, tuple(rigid)):
        raise ValueError(
            f"material is {type(material).__name__}, which has no modulus; use a deformable material"
        )
    check_kind("material", material, Material, rigid)
    omega = as_numbers("omega", omega)
    if temperature is not None:
        temperature = as_numbers("temperature", temperature, POSITIVE)
    broadcast_shape(omega=omega, temperature=temperature)
    return _modulus(material, omega, temperature)


# Jitted, so that a call compiles once instead of once per operation.
@jax.jit
@exact_products
def _modulus(material, omega, temperature):
    omega = jnp.asarray(omega, jnp.result_type(omega, float))
    if temperature is not None and material.shift is not None:
        omega = omega * jnp.exp(material.shift.log_factor(temperature))
    E = _signed(material, material.modulus, omega)
    return apply_vertical_shift(E, material.shift, temperature)


def apply_vertical_shift(
    modulus: jax.Array, shift: Shift | None, temperature: NumberLike | None
) -> jax.Array:
    """Return b_T times a modulus, or the modulus without a vertical shift or temperature."""
    log_factor = log_vertical(shift, temperature)
    return modulus if log_factor is None else times(jnp.exp(log_factor), modulus)


def series_modulus(series: Series, omega: jax.Array) -> jax.Array:
    """Return the complex value of a Prony series at omega, which may have any shape and sign."""
    return _series_value(*map(jnp.asarray, series), omega)


@jax.custom_jvp
def _series_value(rest, weight, tau, omega):
    # Term by term: XLA makes one pass of it, which takes half as long as a sum over an axis.
    storage, loss = rest, jnp.zeros(omega.shape, rest.dtype)
    for k in range(tau.shape[0]):
        a = clip_for_square(omega * tau[k])
        term = weight[k] * (a / (1 + a * a))
        storage, loss = storage + a * term, loss + term
    return jax.lax.complex(*jnp.broadcast_arrays(storage, loss))


@_series_value.defjvp
@exact_products
def _series_value_jvp(primals, tangents):
    # Products of few matrices: derivatives of the single terms take ten times as long in reverse mode.
    (_, weight, tau, omega), (rest_dot, weight_dot, tau_dot, omega_dot) = primals, tangents
    # The derivatives are by ln omega, so omega = 0 is moved by a number whose square is finite.
    omega = jnp.where(omega == 0, omega + float(jnp.finfo(omega.dtype).tiny) ** (1 / 3), omega)
    a = clip_for_square(tau[:, None] * omega.reshape(-1))
    loss = a / (1 + a * a)
    storage = a * loss
    slopes = 2 * storage * (1 - storage), loss * (1 - 2 * storage)  # by ln a
    log_omega_dot = (omega_dot / omega).reshape(-1)
    changes = [
        weight_dot @ part + (weight * (tau_dot / tau)) @ slope + (weight @ slope) * log_omega_dot
        for part, slope in zip((storage, loss), slopes, strict=True)
    ]
    storage_dot, loss_dot = (change.reshape(omega.shape) for change in changes)
    return _series_value(*primals), jax.lax.complex(rest_dot + storage_dot, loss_dot)


def clip_for_square(a: jax.Array) -> jax.Array:
    """Limit a = omega tau such that a^2 is finite; at the limit a Prony term has its glassy value."""
    bound = 1e150 if a.dtype == jnp.float64 else 1e18
    return jnp.clip(a, -bound, bound)
