r"""Boundary elements: steady sliding of one or two rough solids, solved point by point.

In the frame of the rough surface the contact is stationary, and the rubber has a complex stiffness:

.. math:: u(\mathbf q) = \frac{2\, p(\mathbf q)}{q E_r(q_x v)},\qquad
          p \ge 0,\; g = d + u - h \ge 0,\; p\, g = 0
.. math:: \mu = \frac{\langle p\, \partial_x h\rangle}{\sigma_0}
              = \frac{1}{\sigma_0}\sum_{\mathbf q} \frac{q\, q_x}{2}\,\mathrm{Im}E_r(q_x v)\,|u(\mathbf q)|^2

The second form sums the heat of all wavevectors. Half-space and Green's function are as in the theory
[Scaraggi & Persson, arXiv:1506.06955, eqs. (A6), (A8)]. Sums run over the modes of a period. A slab has the
stiffness of a half-space times a factor of q. If both solids are rough, the contact repeats after a path of
one period. The path s = v t is then a third axis of all fields, and the frequencies of a mode are q_s v in
the lower solid and (q_s + q_x) v in the upper solid.

The complementarity problem is monotone, 0 = A p + N p, because Re K > 0. Douglas-Rachford splitting
alternates a division in Fourier space and a projection in real space [Lions & Mercier, SIAM J. Numer. Anal.
16 (1979) 964],

.. math:: p(q) = \frac{K (z + h)}{1 + K},\qquad z \leftarrow z + \max(2 p - z, 0) - p

accelerated by Anderson's method [Fu, Zhang & Boyd, SIAM J. Sci. Comput. 42 (2020) A3560, arXiv:1908.11482].
"""

import functools
import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.analysis.random_roughness import random_surface
from rubberfric.base.checks import FINITE, POSITIVE, ArrayLike, check_kind, check_values, shown
from rubberfric.base.fixed_points import anderson
from rubberfric.base.quadrature import Quadrature
from rubberfric.materials.material import (
    E_r,
    Material,
    Rigid,
)
from rubberfric.scene.body import Body
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
    """Solve the steady sliding contact of random surfaces point by point.

    Parameters
    ----------
    scene : Scene of half-spaces or slabs, of which one or both are rough
        gamma, area_correction and contact shear are ignored.
    velocity, pressure, temperature : numbers [m/s], [Pa], [K]
    key : jax.random key of the surfaces
    grid, periods : see `random_surface`
        With two rough solids, `periods` counts the longer of their longest wavelengths, and the contact is
        solved at grid^3 points. A grid of 128 takes about a minute.
    tolerance, most_steps : see `solve_contact`

    Returns
    -------
    SlidingContact

    Raises
    ------
    ValueError : single precision; a grid that does not resolve the roughness; two smooth solids, a coating,
        heating, softening, adhesion.

    Notes
    -----
    With eight points per shortest wavelength, friction is too small by 0.8 % (median of 313 random cases), by
    4.6 % in one case of twenty, and by 11 % in the worst case. The error of the corrected area is 0.2 %, 2 %
    and 10 %. With 16 points, the errors are two thirds as large (light loads, 205 cases), with 32 points a
    quarter. Errors are largest where the rubber stiffens strongly at the smallest scales. They follow from
    grids with half as many points, because they are of second order in the grid
    (notebooks/law_elements.csv). Surfaces of 4 periods differ by 2 % in slow and 10 % in fast sliding, so
    average over several keys. Modes with wavevectors across the sliding direction stay relaxed at any
    velocity; their share falls with the number of periods.

    Examples
    --------
    The areas of one small surface and of the theory:

    >>> import jax
    >>> road = rf.Body(rf.Rigid(), rf.SelfAffine(q0=1e3, qr=1e3, q1=8e3, hurst=0.8, h_rms=50e-6))
    >>> scene = rf.Scene(road, rf.Body(rf.Prony(E_inf=3e6, E=[10e6], tau=[1e-3])))
    >>> contact = rf.analysis.boundary_element(scene, 0.5, 1e5, jax.random.key(0), grid=64, periods=2.0)
    >>> contact.converged, round(contact.area, 2), round(float(rf.contact_area(scene, 0.5, 1e5)), 2)
    (True, 0.14, 0.11)
    """
    bodies = _rough_first(scene)
    checked_arguments(scene, velocity, pressure, temperature, Quadrature())
    spectra = [body.spectrum for body in bodies if body.spectrum is not None]
    waves = [float(spectrum.power_law().q[0]) for spectrum in spectra]
    keys = [key, jax.random.fold_in(key, 1)]
    surfaces = [
        random_surface(spectrum, key, grid, periods * q0 / min(waves))
        for spectrum, q0, key in zip(spectra, waves, keys, strict=False)
    ]
    heights, length = [surface.heights for surface in surfaces], surfaces[0].length
    return _contact(heights, length, bodies, velocity, pressure, temperature, tolerance, most_steps)


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

    Examples
    --------
    Half of a wave is in contact at half the pressure of full contact [Westergaard]:

    >>> x = np.arange(64) / 64
    >>> heights = 10e-6 * np.cos(2 * np.pi * x)[:, None] * np.ones(64)
    >>> full = np.pi * 3e6 / 0.75 * 10e-6 / 1e-3  # pi E_r amplitude / wavelength
    >>> contact = rf.analysis.sliding_contact(heights, 1e-3, rf.Elastic(3e6, 0.5), 0.0, full / 2)
    >>> round(contact.area, 1), round(float(contact.pressure.mean() / full), 3)
    (0.5, 0.5)
    """
    bodies = Body(Rigid()), Body(material)
    return _contact([heights], length, bodies, velocity, pressure, temperature, tolerance, most_steps)


def _contact(surfaces, length, bodies, velocity, pressure, temperature, tolerance, most_steps):
    """Solve the contact of the bodies (lower, upper).

    `surfaces` has the heights of the lower body, and those of the upper body if both are rough.
    """
    if jnp.result_type(float) != jnp.float64:
        raise ValueError('double precision is required: call jax.config.update("jax_enable_x64", True) first')
    lower, *others = (np.asarray(heights, float) for heights in surfaces)
    n = lower.shape[0] if lower.ndim == 2 else 0
    if not n or n % 2 or lower.shape != (n, n):
        raise ValueError(f"heights has the shape {lower.shape}: it must be (n, n) with n even")
    check_values("heights", lower, FINITE)
    for name, value, rule in (("length", length, POSITIVE), ("pressure", pressure, POSITIVE)):
        check_values(name, value, rule)
    check_values("velocity", velocity, FINITE)
    heights = lower
    if others:
        # The upper surface travels through one period, after which everything repeats.
        steps = range(n) if velocity else range(1)
        heights = lower + np.stack([np.roll(others[0], step, 0) for step in steps])
    modes = _modes(n, length, bodies, velocity, temperature, heights.shape)
    power = modes.q**2 * np.abs(np.fft.rfftn(heights, norm="forward")) ** 2
    # The weights lie between those of heights and curvatures.
    stiff = np.log(np.abs(np.where(modes.q > 0, modes.stiffness, 1.0)))
    scale = math.exp(np.sum(power * stiff) / np.sum(power)) if power.any() else float(np.exp(stiff.max()))
    solution = solve_contact(
        jnp.asarray(heights * (scale / pressure)), jnp.asarray(modes.stiffness / scale), tolerance, most_steps
    )
    return _result(lower, heights, length, modes, pressure, scale, tolerance, solution)


class _Modes(NamedTuple):
    """Modes of `rfftn`. Arrays have the shape of the modes, or broadcast to it."""

    qx: np.ndarray  # [1/m]
    q: np.ndarray
    stiffness: np.ndarray  # K of both solids in series [Pa/m]
    loss: np.ndarray  # dissipation over |u|^2 and the velocity [Pa/m^2]
    lower: np.ndarray | float  # share of the displacement in the lower solid


def _modes(n, length, bodies, velocity, temperature, shape):
    """Return the `_Modes` of heights of a given shape.

    The highest mode of an axis has both signs of its wavevector, and therefore the mean modulus of both.
    """
    unit, k = 2 * math.pi / length, n * np.fft.fftfreq(n)
    signs = [np.where(k == -n // 2, end, k) for end in (-n // 2, n // 2)]
    rows, steps = [axis[:, None] for axis in signs], [np.zeros(1)]
    if len(shape) == 3:
        steps = [axis[:, None, None] for axis in signs] if shape[0] > 1 else [np.zeros((1, 1, 1))]
    q = unit * np.hypot(k[:, None], np.arange(n // 2 + 1))
    moduli, speeds = [], []
    for body, passing in zip(bodies, (0, 1), strict=True):
        along = [unit * (step + passing * row) for step in steps for row in rows]
        speeds.append(np.mean(along, 0))
        if not body.material.deforms:
            moduli.append(None)
            continue
        modulus = np.mean([_modulus_along(body.material, qx * velocity, temperature) for qx in along], 0)
        moduli.append(modulus * np.asarray(body.S_bar(jnp.asarray(np.maximum(q, unit)))))
    shares = [0.0 if modulus is None else 1.0 for modulus in moduli]
    if all(shares):
        shares = [moduli[1] / (moduli[0] + moduli[1]), moduli[0] / (moduli[0] + moduli[1])]
    stiffness, loss = np.zeros(()), np.zeros(())
    for modulus, speed, share in zip(moduli, speeds, shares, strict=True):
        if modulus is not None:
            stiffness = 0.5 * q * modulus * share
            loss = loss + 0.5 * q * speed * modulus.imag * np.abs(share) ** 2
    return _Modes(unit * np.mean(signs, 0)[:, None], q, stiffness, loss, shares[0])


def _result(lower, heights, length, modes, pressure, scale, tolerance, solution):
    """Convert the result of `solve_contact` to a `SlidingContact`.

    `solution` has pressures in units of `pressure`, and gaps in units of `pressure / scale`.
    """
    n = lower.shape[0]
    p, gap = pressure * np.asarray(solution.pressure), pressure / scale * np.asarray(solution.gap)
    count = np.where(np.arange(n // 2 + 1) % (n // 2) == 0, 1, 2)  # rfftn has half of the modes
    moved = np.fft.rfftn(gap + heights, norm="forward")
    heat = count * modes.loss * np.abs(moved) ** 2 / pressure
    surface = np.fft.rfftn(np.broadcast_to(lower, heights.shape), norm="forward") - modes.lower * moved
    slope = np.fft.irfftn(1j * modes.qx * surface, heights.shape, range(heights.ndim), norm="forward")
    ring = np.rint(modes.q * (length / (2 * np.pi))).astype(int).ravel()

    def by_ring(values):
        return np.bincount(ring, values.reshape(-1, ring.size).sum(0))[1:]

    touching = p > 0
    border = sum(np.sum(touching != np.roll(touching, 1, axis)) for axis in (-2, -1))
    # Pixels overestimate the area of smooth patches by half a pixel of border, averaged over its directions
    # [Yastrebov, Anciaux & Molinari, Tribol. Int. 114 (2017) 161, arXiv:1701.02727].
    jagged = (math.pi - 1 + math.log(2)) / 24 * border / p.size
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
        roughness=by_ring(count * np.abs(np.fft.rfftn(heights, norm="forward")) ** 2),
        iterations=int(solution.iterations),
        residual=float(solution.residual),
        converged=bool(solution.residual <= tolerance),
    )


def _modulus_along(material, omega, temperature):
    """Return E_r at angular frequencies of either sign, as complex numbers [Pa]."""
    modulus = np.asarray(_modulus_at(material, np.abs(omega), temperature), complex)
    return np.where(omega < 0, np.conj(modulus), modulus)


@jax.jit
def _modulus_at(material, omega, temperature):
    """Return E_r at angular frequencies >= 0 [Pa]."""
    return E_r(material, omega, temperature)


def _rough_first(scene):
    """Return the bodies of a scene; the first one is rough.

    A ValueError is raised if `boundary_element` does not cover the scene.
    """
    check_kind("scene", scene, Scene)
    bodies = scene.lower, scene.upper
    if not any(body.spectrum is not None for body in bodies):
        raise ValueError("boundary_element: both solids are smooth; one must have a spectrum")
    for body in bodies:
        if not body.separable:
            raise ValueError(f"boundary_element: a solid has a {body.geometry}; use a half-space or a Slab")
    parts = optional_parts(scene)
    for name in ("heating", "softening", "adhesion", "correlation"):
        if name in parts:
            raise ValueError(f"boundary_element: the scene has {name}; it must have none")
    return bodies if bodies[0].spectrum is not None else bodies[::-1]


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
    heights : shape (n, n), or (times, n, n)
    stiffness : K of the modes of `rfftn`, complex, 0 at q = 0
        Choose units in which the dominant stiffness is 1, because the number of steps depends on the units.
    tolerance : largest residual, which is rms step / rms pressure
    most_steps : static

    Returns
    -------
    GridContact. After `most_steps` steps the result is the last iterate. Pressure and gap are >= 0, and at
    every point one of the two is 0. Pressure and gap match the heights except for the residual.
    """
    pull, mean = jnp.fft.rfftn(heights), (0,) * heights.ndim
    share = stiffness / (1 + stiffness)

    def relaxed(z):
        modes = share * (jnp.fft.rfftn(z) + pull)
        return jnp.fft.irfftn(modes.at[mean].set(z.size), s=z.shape)

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
