r"""Steady sliding of smooth rubber over a rigid rough surface, point by point: what the theory approximates.

In the frame of the rough surface nothing moves, and the rubber is a solid of complex stiffness,

.. math:: u(\mathbf q) = \frac{2\, p(\mathbf q)}{q E_r(q_x v)},\qquad p \ge 0,\; g \ge 0,\; p\, g = 0,\qquad
          \mu = \frac{\langle p\, \partial_x h\rangle}{\sigma_0}
              = \frac{1}{\sigma_0}\sum_{\mathbf q} \frac{q\, q_x}{2}\,\mathrm{Im}E_r(q_x v)\,|u(\mathbf q)|^2

the second form being the heat by wavevector. Half-space and Green's function as in the theory [Scaraggi &
Persson, arXiv:1506.06955, eqs. (A6), (A8)]; the sums are over the modes of a period.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike

from rubberfric.analysis.elements.complementarity import solve_contact
from rubberfric.analysis.elements.realisation import random_surface
from rubberfric.base.checks import FINITE, POSITIVE, check_values, shown
from rubberfric.base.quadrature import Quadrature
from rubberfric.materials.material import Material, plane_strain, series_modulus, series_of, stiffer
from rubberfric.scene.scene import Scene, present
from rubberfric.theory.arguments import checked


class SlidingContact(NamedTuple):
    """Results of `boundary_element` and `sliding_contact`; the rubber slides along the first axis, x."""

    area: float  # A/A0, corrected for the jagged border of the pixels [-]
    pixel_area: float  # share of the pixels with pressure [-]
    friction: float  # mu = <p h_x> / sigma_0, viscoelastic [-]
    friction_of_heat: float  # the same from the heat, which needs a coarser grid [-]
    separation: float  # mean gap [m]
    pressure: np.ndarray  # [Pa], (grid, grid)
    gap: np.ndarray  # [m]
    heights: np.ndarray  # [m]
    length: float  # of the period [m]
    wavevector: np.ndarray  # of rings of modes one mode wide [1/m], (rings,)
    friction_by_wavevector: np.ndarray  # parts of `friction_of_heat` [-]
    displacement: np.ndarray  # mean square in each ring [m^2]
    roughness: np.ndarray  # the same of the heights [m^2]
    iterations: int
    residual: float  # of the last step over the pressure, root mean squares [-]
    converged: bool

    def distribution(self, field: str = "pressure", bins: int = 50) -> tuple[np.ndarray, np.ndarray]:
        """Values and their density among all points where they are not 0, of "pressure" or "gap".

        Returns
        -------
        (values, density), shape (bins,): in Pa and 1/Pa, or m and 1/m. The density integrates to the share of
        the points at which there is pressure, or a gap.
        """
        if field not in ("pressure", "gap"):
            raise ValueError(f'field = {shown(field)}: must be "pressure" or "gap"')
        values = getattr(self, field)
        density, edges = np.histogram(values[values > 0], bins, (0.0, values.max()), density=True)
        return 0.5 * (edges[1:] + edges[:-1]), density * np.mean(values > 0)

    def heat_beyond(self, q: float) -> float:
        """Share of the dissipation at wavevectors above q [1/m], 0 of none; the theory has none above q1."""
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
    """One random surface of a scene in steady sliding contact: no theory of partial contact.

    Parameters
    ----------
    scene : Scene of a rigid body with an isotropic spectrum and a smooth half-space, elastic or viscoelastic
        gamma and area_correction are the theory's and do nothing here; contact shear is left out.
    velocity, pressure, temperature : numbers [m/s], [Pa], [K]
    key : of jax.random, of the surface
    grid, periods : see `random_surface`
    tolerance, most_steps : see `rubberfric.analysis.elements.complementarity.solve_contact`

    Returns
    -------
    SlidingContact

    Raises
    ------
    ValueError : single precision; a grid that does not resolve the roughness; a scene with what is not
        computed here, by name: two deformable solids, two rough ones, layers, heating, softening, anisotropy.

    Notes
    -----
    With eight points a shortest wavelength friction is good to 1-2 %, the corrected area to 1 %; with 16 to
    0.5 %. One surface of 4 periods differs from the next by 2 % in slow and 10 % in fast sliding: take the
    mean of several keys. Modes across the sliding stay relaxed at any velocity: a longer period has fewer.
    """
    spectrum, material = _rough_and_smooth(scene)
    checked(scene, velocity, pressure, temperature, Quadrature())
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
    """Contact of a smooth half-space with one period of a rigid surface of given heights.

    Parameters
    ----------
    heights : [m], shape (n, n), n even; the half-space slides along the first axis, above the surface
    length : of the period along either axis [m]
    material : Elastic, Prony, PronyShear, TabulatedModulus or one of your own
    velocity, pressure, temperature, tolerance, most_steps, errors : as `boundary_element`
    """
    if jnp.result_type(float) != jnp.float64:
        raise ValueError('boundary elements need double precision: jax.config.update("jax_enable_x64", True)')
    heights = np.asarray(heights, float)
    n = heights.shape[0] if heights.ndim == 2 else 0
    if not n or n % 2 or heights.shape != (n, n):
        raise ValueError(f"heights of shape {heights.shape}: must be (n, n), n even")
    check_values("heights", heights, FINITE)
    for name, value, rule in (("length", length, POSITIVE), ("pressure", pressure, POSITIVE)):
        check_values(name, value, rule)
    check_values("velocity", velocity, FINITE)
    unit = 2 * math.pi / length
    qx, qy = unit * np.fft.fftfreq(n, 1 / n)[:, None], unit * np.arange(n // 2 + 1)
    q = np.hypot(qx, qy)
    modulus = _modulus_along(material, qx * velocity, temperature)
    # The highest mode along x has both signs: no slope, and no loss.
    modulus[n // 2] = np.real(modulus[n // 2])
    qx[n // 2] = 0.0
    power = np.abs(np.fft.rfft2(heights - heights.mean(), norm="forward")) ** 2
    # Between the wavevectors that make heights and those that make curvatures.
    middle = (np.sum(q**4 * power) / np.sum(power)) ** 0.25
    typical = _modulus_along(material, np.array(middle * velocity), temperature)
    scale = 0.5 * middle * float(np.abs(typical))
    stiffness = 0.5 * q * modulus
    found = solve_contact(
        jnp.asarray(heights * (scale / pressure)), jnp.asarray(stiffness / scale), tolerance, most_steps
    )
    return _result(heights, length, (qx, q), stiffness, pressure, scale, tolerance, found)


def _result(heights, length, wavevectors, stiffness, pressure, scale, tolerance, found):
    """`SlidingContact` of a solution in units of the pressure and of pressure / scale."""
    qx, q = wavevectors
    n = heights.shape[0]
    p, gap = pressure * np.asarray(found.pressure), pressure / scale * np.asarray(found.gap)
    count = np.where(np.arange(n // 2 + 1) % (n // 2) == 0, 1, 2)  # modes that rfft2 leaves out
    modes = np.fft.rfft2(heights, norm="forward")
    moved = np.fft.rfft2(gap + heights, norm="forward")
    heat = count * qx * stiffness.imag * np.abs(moved) ** 2 / pressure
    slope = np.fft.irfft2(1j * qx * modes, heights.shape, norm="forward")
    ring = np.rint(q * (length / (2 * np.pi))).astype(int).ravel()

    def by_ring(values):
        return np.bincount(ring, values.ravel())[1:]

    touching = p > 0
    border = sum(np.sum(touching != np.roll(touching, 1, axis)) for axis in (0, 1))
    # Of smooth patches drawn in pixels [Yastrebov, Anciaux & Molinari, Tribol. Int. 114 (2017) 161,
    # arXiv:1701.02727]: half a pixel of border is too much, on average over its directions.
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
    """E_r at angular frequencies of either sign [Pa], complex."""
    at = np.abs(omega)
    if temperature is not None and material.shift is not None:
        at = at * float(jnp.exp(material.shift.log_factor(temperature)))
    if material.has_series:
        modulus = series_modulus(series_of(material, 1.0), jnp.asarray(at))
    else:
        modulus = material.modulus(jnp.asarray(at)) * plane_strain(material)
    modulus = np.asarray(stiffer(modulus, material.shift, temperature), complex)
    return np.where(omega < 0, np.conj(modulus), modulus)


def _rough_and_smooth(scene):
    """The spectrum of the rigid body and the other's material, or ValueError naming what is in the way."""
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
    parts = present(scene)
    for name in ("heating", "softening", "adhesion"):
        if name in parts:
            raise ValueError(f"boundary_element: the scene has {name}; it must have none")
    return rough[0].spectrum, smooth.material
