r"""Boundary elements: steady sliding of smooth rubber over a rigid rough surface, solved point by point.

In the frame of the rough surface the contact is stationary, and the rubber has a complex stiffness:

.. math:: u(\mathbf q) = \frac{2\, p(\mathbf q)}{q E_r(q_x v)},\qquad
          p \ge 0,\; g = d + u - h \ge 0,\; p\, g = 0
.. math:: \mu = \frac{\langle p\, \partial_x h\rangle}{\sigma_0}
              = \frac{1}{\sigma_0}\sum_{\mathbf q} \frac{q\, q_x}{2}\,\mathrm{Im}E_r(q_x v)\,|u(\mathbf q)|^2

The second form sums the heat of all wavevectors. Half-space and Green's function are as in the theory
[Scaraggi & Persson, arXiv:1506.06955, eqs. (A6), (A8)]. Sums run over the modes of a period.

The complementarity problem is monotone, 0 = A p + N p, because Re K > 0. Douglas-Rachford splitting
alternates a division in Fourier space and a projection in real space [Lions & Mercier, SIAM J. Numer. Anal.
16 (1979) 964],

.. math:: p(q) = \frac{K (z + h)}{1 + K},\qquad z \leftarrow z + \max(2 p - z, 0) - p

accelerated by Anderson's method [Fu, Zhang & Boyd, SIAM J. Sci. Comput. 42 (2020) A3560, arXiv:1908.11482].
Random surfaces have modes 2 pi / L sqrt(C(q)) with random phases [Jacobs, Junge & Pastewka, Surf. Topogr. 5
(2017) 013001, arXiv:1607.03040].
"""

import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.checks import FINITE, POSITIVE, check_values, shown
from rubberfric.base.fixed_points import anderson
from rubberfric.base.objects.physical import check_kind
from rubberfric.base.quadrature import Quadrature
from rubberfric.materials.material import (
    Material,
    apply_vertical_shift,
    plane_strain_factor,
    series_modulus,
    series_of,
)
from rubberfric.roughness.spectra import Spectrum, power_spectrum
from rubberfric.scene.scene import Scene, optional_parts
from rubberfric.theory.arguments import checked_arguments


class SlidingContact(NamedTuple):
    """Results of `boundary_element` and `sliding_contact`. Sliding is along the first axis, x."""

    area: float  # A/A0, corrected for the jagged border of the pixels [-]
    pixel_area: float  # share of the pixels with pressure [-]
    friction: float  # mu = <p h_x> / sigma_0, viscoelastic [-]
    friction_of_heat: float  # mu from the heat, which needs a less fine grid [-]
    separation: float  # mean gap [m]
    pressure: np.ndarray  # [Pa], (grid, grid)
    gap: np.ndarray  # [m]
    heights: np.ndarray  # [m]
    length: float  # of the period [m]
    wavevector: np.ndarray  # of rings of modes one mode wide [1/m], (rings,)
    friction_by_wavevector: np.ndarray  # parts of `friction_of_heat` [-]
    displacement: np.ndarray  # mean square in each ring [m^2]
    roughness: np.ndarray  # mean square of the heights in each ring [m^2]
    iterations: int
    residual: float  # rms of the last step divided by rms of the pressure [-]
    converged: bool

    def distribution(self, field: str = "pressure", bins: int = 50) -> tuple[np.ndarray, np.ndarray]:
        """Return a histogram of the nonzero values of the field "pressure" or "gap".

        Returns
        -------
        (values, density), arrays of shape (bins,)
            Values are the centres of the bins in Pa or m, and densities are in 1/Pa or 1/m. The density
            integrates to the share of points with pressure, or with a gap.
        """
        if field not in ("pressure", "gap"):
            raise ValueError(f'field = {shown(field)}: must be "pressure" or "gap"')
        values = getattr(self, field)
        density, edges = np.histogram(values[values > 0], bins, (0.0, values.max()), density=True)
        return 0.5 * (edges[1:] + edges[:-1]), density * np.mean(values > 0)

    def heat_beyond(self, q: float) -> float:
        """Return the share of the dissipation at wavevectors above q [1/m].

        The share is 0 if there is no dissipation.
        """
        beyond = float(self.friction_by_wavevector[self.wavevector > q].sum())
        return beyond / self.friction_of_heat if self.friction_of_heat else 0.0


def boundary_element(
    scene: Scene,
    velocity: float,
    pressure: float,
    key: jax.Array,
    temperature: float | None = None,
    *,
    grid: int = 512,
    periods: float = 4.0,
    tolerance: float = 1e-5,
    most_steps: int = 2000,
) -> SlidingContact:
    """Solve the steady sliding contact of one random surface point by point.

    Parameters
    ----------
    scene : Scene of a rigid body with an isotropic spectrum and a smooth half-space, elastic or viscoelastic
        gamma, area_correction and contact shear are ignored.
    velocity, pressure, temperature : numbers [m/s], [Pa], [K]
    key : jax.random key of the surface
    grid, periods : see `random_surface`
    tolerance, most_steps : see `solve_contact`

    Returns
    -------
    SlidingContact

    Raises
    ------
    ValueError : single precision; a grid that does not resolve the roughness; two deformable or two rough
        solids, layers, heating, softening, adhesion, anisotropy.

    Notes
    -----
    With eight points per shortest wavelength the errors are 1-2 % in friction and 1 % in the corrected area;
    with 16 points 0.5 %. Surfaces of 4 periods differ by 2 % in slow and 10 % in fast sliding, so average
    over several keys. Modes with wavevectors across the sliding direction stay relaxed at any velocity; their
    share falls with the number of periods.
    """
    spectrum, material = _rough_and_smooth(scene)
    checked_arguments(scene, velocity, pressure, temperature, Quadrature())
    surface = random_surface(spectrum, key, grid, periods)
    return sliding_contact(
        *surface, material, velocity, pressure, temperature, tolerance=tolerance, most_steps=most_steps
    )


def sliding_contact(
    heights: ArrayLike,
    length: float,
    material: Material,
    velocity: float,
    pressure: float,
    temperature: float | None = None,
    *,
    tolerance: float = 1e-5,
    most_steps: int = 2000,
) -> SlidingContact:
    """Solve the contact of a smooth half-space with one period of a rigid surface of given heights.

    Parameters
    ----------
    heights : [m], shape (n, n), n even; the half-space slides along the first axis, above the surface
    length : length of the period along either axis [m]
    material : Elastic, Prony, PronyShear, TabulatedModulus or a user-defined one
    velocity, pressure, temperature, tolerance, most_steps : as in `boundary_element`, with the same errors
    """
    if jnp.result_type(float) != jnp.float64:
        raise ValueError('double precision is required: call jax.config.update("jax_enable_x64", True) first')
    heights = np.asarray(heights, float)
    n = heights.shape[0] if heights.ndim == 2 else 0
    if not n or n % 2 or heights.shape != (n, n):
        raise ValueError(f"heights has the shape {heights.shape}: it must be (n, n) with n even")
    check_values("heights", heights, FINITE)
    for name, value, rule in (("length", length, POSITIVE), ("pressure", pressure, POSITIVE)):
        check_values(name, value, rule)
    check_values("velocity", velocity, FINITE)
    unit = 2 * math.pi / length
    qx, qy = unit * np.fft.fftfreq(n, 1 / n)[:, None], unit * np.arange(n // 2 + 1)
    q = np.hypot(qx, qy)
    modulus = _modulus_along(material, qx * velocity, temperature)
    # The highest mode along x has both signs of q_x, and therefore neither slope nor loss.
    modulus[n // 2] = np.real(modulus[n // 2])
    qx[n // 2] = 0.0
    power = np.abs(np.fft.rfft2(heights - heights.mean(), norm="forward")) ** 2
    # A wavevector between the main wavevectors of heights and curvatures.
    middle = (np.sum(q**4 * power) / np.sum(power)) ** 0.25
    typical = _modulus_along(material, np.array(middle * velocity), temperature)
    scale = 0.5 * middle * float(np.abs(typical))
    stiffness = 0.5 * q * modulus
    found = solve_contact(
        jnp.asarray(heights * (scale / pressure)), jnp.asarray(stiffness / scale), tolerance, most_steps
    )
    return _result(heights, length, (qx, q), stiffness, pressure, scale, tolerance, found)


def _result(heights, length, wavevectors, stiffness, pressure, scale, tolerance, found):
    """Convert the result of `solve_contact` to a `SlidingContact`.

    `found` has pressures in units of `pressure`, and gaps in units of `pressure / scale`.
    """
    qx, q = wavevectors
    n = heights.shape[0]
    p, gap = pressure * np.asarray(found.pressure), pressure / scale * np.asarray(found.gap)
    count = np.where(np.arange(n // 2 + 1) % (n // 2) == 0, 1, 2)  # rfft2 has half of the modes
    modes = np.fft.rfft2(heights, norm="forward")
    moved = np.fft.rfft2(gap + heights, norm="forward")
    heat = count * qx * stiffness.imag * np.abs(moved) ** 2 / pressure
    slope = np.fft.irfft2(1j * qx * modes, heights.shape, norm="forward")
    ring = np.rint(q * (length / (2 * np.pi))).astype(int).ravel()

    def by_ring(values):
        return np.bincount(ring, values.ravel())[1:]

    touching = p > 0
    border = sum(np.sum(touching != np.roll(touching, 1, axis)) for axis in (0, 1))
    # Pixels overestimate the area of smooth patches by half a pixel of border, averaged over its directions
    # [Yastrebov, Anciaux & Molinari, Tribol. Int. 114 (2017) 161, arXiv:1701.02727].
    jagged = (math.pi - 1 + math.log(2)) / 24 * border / n**2
    return SlidingContact(
        area=float(np.mean(touching) - jagged),
        pixel_area=float(np.mean(touching)),
        friction=float(np.mean(p * slope) / pressure),
        friction_of_heat=float(np.sum(heat)),
        separation=float(np.mean(gap)),
        pressure=p,
        gap=gap,
        heights=heights,
        length=float(length),
        wavevector=2 * np.pi / length * np.arange(1, ring.max() + 1),
        friction_by_wavevector=by_ring(heat),
        displacement=by_ring(count * np.abs(moved) ** 2),
        roughness=by_ring(count * np.abs(modes) ** 2),
        iterations=int(found.iterations),
        residual=float(found.residual),
        converged=bool(found.residual <= tolerance),
    )


def _modulus_along(material, omega, temperature):
    """Return E_r at angular frequencies of either sign, as complex numbers [Pa]."""
    at = np.abs(omega)
    if temperature is not None and material.shift is not None:
        at = at * float(jnp.exp(material.shift.log_factor(temperature)))
    if material.has_series:
        modulus = series_modulus(series_of(material, 1.0), jnp.asarray(at))
    else:
        modulus = material.modulus(jnp.asarray(at)) * plane_strain_factor(material)
    modulus = np.asarray(apply_vertical_shift(modulus, material.shift, temperature), complex)
    return np.where(omega < 0, np.conj(modulus), modulus)


def _rough_and_smooth(scene):
    """Return the spectrum of the rigid body and the material of the other body.

    A ValueError is raised if `boundary_element` does not cover the scene.
    """
    if not isinstance(scene, Scene):
        raise ValueError(f"scene is a {type(scene).__name__}: must be a Scene")
    rough = [body for body in (scene.lower, scene.upper) if not body.material.deforms]
    if not rough:
        raise ValueError("boundary_element: both solids deform; one must be Rigid")
    smooth = scene.upper if rough[0] is scene.lower else scene.lower
    if rough[0].spectrum is None:
        raise ValueError("boundary_element: the rigid body is smooth; it must have a spectrum")
    if smooth.spectrum is not None:
        raise ValueError("boundary_element: the deformable body is rough; it must be smooth")
    if smooth.layer is not None:
        kind = type(smooth.layer).__name__
        raise ValueError(f"boundary_element: the deformable body is a {kind}; it must be a half-space")
    parts = optional_parts(scene)
    for name in ("heating", "softening", "adhesion"):
        if name in parts:
            raise ValueError(f"boundary_element: the scene has {name}; it must have none")
    return rough[0].spectrum, smooth.material


_HISTORY = 5  # steps of Anderson's method
_RISE = 1e2  # it restarts when the residual rises this far above its minimum


class GridContact(NamedTuple):
    """Results of `solve_contact`, in the units of its arguments."""

    pressure: jax.Array
    gap: jax.Array
    iterations: jax.Array
    residual: jax.Array


@functools.partial(jax.jit, static_argnames=("most_steps",))
def solve_contact(
    heights: jax.Array, stiffness: jax.Array, tolerance: float, most_steps: int = 2000
) -> GridContact:
    """Solve for pressures and gaps at a mean pressure of 1.

    Parameters
    ----------
    heights : shape (n, n)
    stiffness : K of the modes of `rfft2`, shape (n, n/2 + 1), complex; the mean mode is ignored
        Choose units in which the dominant stiffness is 1, because the number of steps depends on the units.
    tolerance : largest residual, which is rms step / rms pressure
    most_steps : static

    Returns
    -------
    GridContact. After `most_steps` steps the result is the last iterate. Pressure and gap are >= 0, and at
    every point one of the two is 0. Pressure and gap match the heights except for the residual.
    """
    pull = jnp.fft.rfft2(heights)
    share = stiffness / (1 + stiffness)

    def relaxed(z):
        modes = share * (jnp.fft.rfft2(z) + pull)
        return jnp.fft.irfft2(modes.at[0, 0].set(z.size), s=z.shape)

    def change_at(row):
        z = row.reshape(heights.shape)
        p = relaxed(z)
        change = jnp.maximum(2 * p - z, 0.0) - p
        return change.reshape(1, -1), jnp.sqrt(jnp.sum(change**2) / jnp.sum(p**2))[None]

    z, _, residual, steps = anderson(
        change_at,
        jnp.ones((1, heights.size), heights.dtype),
        lambda _z, _change, residual: residual <= tolerance,
        also=jnp.zeros(1, heights.dtype),
        history=_HISTORY,
        most_steps=most_steps,
        rise=_RISE,
    )
    z = z.reshape(heights.shape)
    reflected = 2 * relaxed(z) - z
    return GridContact(jnp.maximum(reflected, 0.0), jnp.maximum(-reflected, 0.0), steps, residual[0])


_COARSEST = 4  # least points per shortest wavelength. The error of friction is 5 %, with eight points 1 %


class Surface(NamedTuple):
    """One period of a rough surface."""

    heights: np.ndarray  # [m], (grid, grid); sliding is along the first axis
    length: float  # of the period along either axis [m]


def random_surface(spectrum: Spectrum, key: jax.Array, grid: int = 512, periods: float = 4.0) -> Surface:
    """Generate a periodic surface with a given spectrum and random phases, in double precision.

    Parameters
    ----------
    spectrum : Spectrum, isotropic
    key : jax.random key; a key gives the same surface on every grid
    grid : points along each side, even; at least 4 per shortest wavelength
    periods : number of longest wavelengths along each side, >= 1; with few periods there are few
        long-wavelength modes and more scatter between surfaces

    Returns
    -------
    Surface

    Raises
    ------
    ValueError : an anisotropic spectrum; a grid that does not resolve it.
    """
    check_kind("spectrum", spectrum, Spectrum)
    if spectrum.harmonic_count():
        raise ValueError(f"spectrum is a {type(spectrum).__name__}: must be isotropic")
    if not periods >= 1:
        raise ValueError(f"periods = {shown(periods)}: must be >= 1")
    q0, q1 = (float(spectrum.power_law().q[i]) for i in (0, -1))
    length, most = 2 * math.pi * periods / q0, periods * q1 / q0
    needed = 2 * math.ceil(_COARSEST / 2 * most * (1 - 1e-9))
    if not isinstance(grid, int) or grid % 2 or grid < needed:
        raise ValueError(
            f"grid = {shown(grid)}: must be even and >= {needed}, so that the shortest wavelength has"
            f" {_COARSEST} points in a period of {periods:g} times the longest wavelength (q1 / q0 ="
            f" {q1 / q0:g}); {2 * needed} reduces the error of friction to 1 %"
        )
    # Modes are drawn independently of the grid.
    reach = math.floor(most * (1 + 1e-9))
    kx, ky = np.arange(-reach, reach + 1)[:, None], np.arange(reach + 1)
    # Include the first and the last wavevector despite rounding.
    q = np.clip(np.hypot(kx, ky) / periods, 1 - 1e-9, q1 / q0 * (1 + 1e-9))
    inside = np.abs(q * periods - np.hypot(kx, ky)) < 1e-6
    C = np.asarray(power_spectrum(spectrum, np.clip(q * q0, q0, q1)), float)
    phase = 2 * np.pi * np.asarray(jax.random.uniform(key, (2 * reach + 1, reach + 1)), float)
    mode = np.where(inside, 2 * np.pi / length * np.sqrt(C), 0.0) * np.exp(1j * phase)
    mode[:reach, 0] = np.conj(mode[:reach:-1, 0])  # heights are real
    modes = np.zeros((grid, grid // 2 + 1), complex)
    modes[kx[:, 0] % grid, : reach + 1] = mode
    return Surface(np.fft.irfft2(modes, (grid, grid), norm="forward"), length)
