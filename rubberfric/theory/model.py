r"""Contact area, friction and separation of a sliding scene: the public functions.

Scaraggi & Persson's general case in three lines, for roughness on either solid and
series stiffness K_j (see `rubberfric.theory.stiffness.complex_stiffness`):

.. math:: G(q) = \frac{1}{2\sigma_0^2}\int_{q_0}^{q} d^2q \sum_j C_j |K_j|^2,\qquad
          P = \mathrm{erf}\frac{1}{2\sqrt G}
.. math:: \mu = \frac{1}{\sigma_0}\int d^2q\, S P \sum_j C_j\, q\cos\varphi\,\mathrm{Im} K_j
.. math:: \bar u = \int d^2q \sum_j C_j\,\mathrm{Re} K_j
          \int_{\sigma_0}^\infty \frac{dp}{2p}\frac{\partial[SP]}{\partial p}

mu is the viscoelastic friction. Contact shear (`rubberfric.scene.interface`) adds to it. Strain softening
(`rubberfric.scene.softening`) and frictional heating (`rubberfric.scene.heating`) change K_j.
"""

import functools
from collections.abc import Mapping, Sequence

import jax

from rubberfric.base.blocks import over_points
from rubberfric.base.checks import ArrayLike
from rubberfric.base.quadrature import Quadrature
from rubberfric.scene.scene import Scene, iterates
from rubberfric.theory.arguments import check_quantities, span_of_speeds, validate, warn_of_last_iterates
from rubberfric.theory.integrals import evaluate, prepare
from rubberfric.theory.stiffness.means import known_tables
from rubberfric.theory.structure import QUANTITIES, Solution

# Points that are evaluated together.
BLOCK = 512


def contact_area(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    quadrature: Quadrature | None = None,
) -> jax.Array:
    r"""Return the relative area of real contact [Scaraggi & Persson, eqs. (10), (A11)].

    .. math:: A/A_0 = \mathrm{erf}\frac{1}{2\sqrt{G(q_1)}},\qquad
              G(q_1) = \frac{1}{2\sigma_0^2}\int d^2q \sum_j C_j |K_j(q v \cos\varphi)|^2

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
        temperature None: every shift is at its reference temperature. A heated scene requires a
        temperature, far from the contact.
    quadrature : Quadrature, static, or None
        None: the quadrature of the scene (`rubberfric.tuned`). If the scene has none, a quadrature is chosen
        with errors below 1e-9 (`rf.analysis.default_quadrature`). If `jit` or `vmap` traces a number of the
        scene, it is `Quadrature()`.

    Returns
    -------
    array, broadcast shape [-], 0 ... 1

    Raises
    ------
    ValueError : concrete pressure <= 0 or below 1e-100 Pa, speeds above 1e100 m/s, any NaN, a temperature
        outside a shift's range, a temperature if nothing in the scene depends on it, no temperature if the
        scene is heated, conditions that broadcast to more than 5e7 points; in float32 also pressures below
        1e-7 Pa, speeds above 1e15 m/s and values that single precision cannot represent.

    Notes
    -----
    Only G at the largest wavevector is computed, without graded panels and cumulative integrals.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> rf.contact_area(scene, 0.01, np.array([0.1e6, 0.2e6])).round(4)
    Array([0.0109, 0.0219], dtype=float64)
    """
    return _alone("area", scene, velocity, pressure, temperature, quadrature)


def friction(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    quadrature: Quadrature | None = None,
) -> jax.Array:
    r"""Return the friction coefficient of steady sliding [Scaraggi & Persson, eq. (A17) / (v sigma_0)].

    .. math:: \mu = \frac{1}{\sigma_0} \int d^2q\, S P \sum_j C_j\, q \cos\varphi\,
              \mathrm{Im} K_j(q v \cos\varphi) \;[\,+\,\mu_\mathrm{con}\,]

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
    quadrature : Quadrature, static, or None; see `contact_area`

    Returns
    -------
    array, broadcast shape [-]; odd in the velocity. The viscoelastic part, plus contact shear if the
    scene has it; `solve` returns the parts.

    Raises
    ------
    ValueError : as `contact_area`.

    Notes
    -----
    The viscoelastic part is zero and not computed if no rough solid faces a viscoelastic one
    (Cases II, III).

    For rubber-like solids with `area_correction`, friction divided by the friction of boundary elements is
    0.5 in slow sliding, 1.7 in fast sliding, and 0.85 to 1.25 at heavy load. The values of the paper's theory
    are a quarter smaller (notebooks/boundary_elements.md). `rubberfric.analysis.theory_error` estimates the
    error for a scene.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> rf.friction(scene, np.array([1e-4, 1e-2, 1.0]), 0.15e6).round(4)
    Array([0.0623, 0.0831, 0.1297], dtype=float64)
    """
    return _alone("friction", scene, velocity, pressure, temperature, quadrature)


def separation(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    quadrature: Quadrature | None = None,
) -> jax.Array:
    r"""Return the mean interfacial separation [Scaraggi & Persson, eq. (A18)].

    .. math:: \bar u = \int d^2q \sum_j C_j\,\mathrm{Re} K_j\, \frac{x}{2\sigma_0}\Psi(x),\qquad
              x = \frac{1}{2\sqrt{G(q)}}

    with the pressure integral in closed form (`rubberfric.theory.area.partial_contact.separation_weight`).

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
    quadrature : Quadrature, static, or None; see `contact_area`

    Returns
    -------
    array, broadcast shape [m], >= 0

    Raises
    ------
    ValueError : as `contact_area`.

    Notes
    -----
    `scene.area_correction` does not change the separation. Ratios of separations differ from boundary
    elements by 1 % with the plain G, and by 9 to 18 % with S in G.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> round(1e6 * float(rf.separation(scene, 0.01, 0.15e6)))  # in µm
    812
    """
    return _alone("separation", scene, velocity, pressure, temperature, quadrature)


def _alone(name, scene, velocity, pressure, temperature, quadrature):
    solution = solve(scene, velocity, pressure, temperature, quadrature=quadrature, quantities=(name,))
    return getattr(solution, name)


def solve(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    quadrature: Quadrature | None = None,
    quantities: str | Sequence[str] = QUANTITIES,
    compiler_options: Mapping[str, bool | int | float | str] | None = None,
) -> Solution:
    """Return several quantities, which share the stiffness and G(q).

    Parameters
    ----------
    scene : Scene
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
    quadrature : Quadrature, static, or None; see `contact_area`
    quantities : names of the quantities to compute
        "area", "friction" and "separation" are the three basic quantities. "viscoelastic_friction" and
        "shear_friction" are the two parts of the friction. "transverse_friction" is the force on the lower
        solid 90 degrees to the left of positive velocities, which anisotropic roughness causes. If this force
        is negative, the upper solid is pushed to the left. "flash_temperature" is the temperature of a heated
        scene at the largest wavevector. "converged" is False where the temperatures of a heated scene, or
        the areas with adhesion, are a last iterate instead of a solution.
    compiler_options : of XLA, as for jax.jit, or None
        Not allowed within a transformation. The compiled function is not kept for other calls.

    Returns
    -------
    Solution, with fields of the broadcast shape; None for quantities that were not requested.

    Raises
    ------
    ValueError : as `contact_area`; an unknown quantity; a quantity of heating for a scene without it.

    Warns
    -----
    RuntimeWarning : temperatures of a heated scene that did not converge, with their points. Not within
        jit or another transformation, and not if "converged" is requested.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> solution = rf.solve(scene, np.logspace(-3, 0, 4), 0.15e6)
    >>> solution.friction.round(3)
    Array([0.071, 0.083, 0.101, 0.13 ], dtype=float64)
    """
    quantities = (quantities,) if isinstance(quantities, str) else tuple(quantities)
    for name in quantities:
        if name not in Solution._fields:
            raise ValueError(f"quantities has {name!r}: must be one of {', '.join(Solution._fields)}")
    unvalidated = scene
    separated = "separation" in quantities
    scene, conditions, quadrature = validate(scene, velocity, pressure, temperature, quadrature, separated)
    check_quantities(scene, quantities)
    # The arrays of `conditions` are traced within jit, also for concrete arguments.
    span = span_of_speeds(scene, velocity, temperature)
    compute = functools.partial(_compute, compiler_options, quadrature, span)
    if not iterates(scene) or "converged" in quantities:
        tables = known_tables(unvalidated, quantities, conditions[0].dtype)
        return compute(quantities, scene, *conditions, tables)
    solution = compute((*quantities, "converged"), scene, *conditions, None)
    warn_of_last_iterates(scene, solution.converged, conditions)
    return solution._replace(converged=None)


def _compute(options, quadrature, span, quantities, *arguments):
    static = {"quadrature": quadrature, "quantities": quantities, "span": span}
    if options is None:
        return _solve(*arguments, **static)
    lowered = _solve.lower(*arguments, **static)
    return lowered.compile(dict(options))(*arguments)


# Jitted, so that a plain call compiles once per structure instead of once per operation. Inside a user's
# jit it is traced through.
@functools.partial(jax.jit, static_argnames=("quadrature", "quantities", "span"))
def _solve(scene, velocity, pressure, temperature, tables, quadrature, quantities, span):
    prepared = prepare(scene, quantities, quadrature, tables=tables, span=span)
    block = functools.partial(evaluate, prepared, quantities)
    return Solution(**over_points(block, (velocity, pressure, temperature), BLOCK))
