"""Validity of results: error of the theory, and share of extrapolated moduli.

The error of the theory is looked up in a comparison with boundary elements (notebooks/boundary_elements.md).
"""

from collections.abc import Mapping
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import ArrayLike, is_concrete
from rubberfric.base.quadrature import Quadrature
from rubberfric.materials.tabulated_modulus import TabulatedModulus
from rubberfric.roughness.spectra import SelfAffine
from rubberfric.scene.body import relaxes
from rubberfric.scene.scene import Scene, optional_parts, rough_surfaces
from rubberfric.theory.model import solve

# Limits of the intervals of the contact area in the table.
AREAS = (0.003, 0.01, 0.03, 0.1, 0.3, 0.8)
# Range of q1/qr with cases.
_RATIOS = (2.0, 512.0)
# Range of H with cases.
_HURST = (0.5, 1.0)
# Range of gamma with cases.
_GAMMA = (0.4, 0.55)
# Largest q1/q0 of the cases.
WIDEST = 512.0
# Growth of the law's error per decade of q1/q0 beyond `WIDEST`, in ln of area and ln of friction, from
# tests/rubberfric/theory/area/test_law_and_boundary_elements.py.
GROWTH = (0.025, 0.05)
# Largest q1/q0 of most cases of the law.
_COMMON = 64.0
# Growth of the law's error in ln of friction per decade of q1/q0 between `_COMMON` and `WIDEST`.
_BROADER = 0.1
_BROAD = 1e3  # relaxation times over this ratio are broad, below nearly a single time

# Ranges of theory over boundary elements, by (version of the theory, width of relaxation) in each interval of
# the area by the theory: (area low, area high, friction low, friction high). The version is True for S in G,
# and "boundary_elements" for the fitted law. The ranges are from the half-spaces with `part` "test" of
# notebooks/law_elements.csv: the j-th smallest and largest ln(ratio) of the n cases in the interval and its
# neighbours, n + 1 - j = 0.05 (n + 1), moved away from the median by the factor `WIDER`. The other cases test
# the table (tests/rubberfric/theory/area/test_law_and_boundary_elements.py).
WIDER = 1.2  # then the ranges from two classes of materials contain 94 to 97 % of the cases of a third class
RATIOS = {
    (False, "narrow"): (
        (0.63, 2.15, 0.23, 1.87),
        (0.64, 2.08, 0.25, 1.78),
        (0.67, 1.48, 0.28, 1.26),
        (0.72, 1.46, 0.30, 1.20),
        (0.74, 1.15, 0.36, 1.20),
    ),
    (False, "broad"): (
        (0.65, 1.33, 0.23, 1.27),
        (0.66, 1.08, 0.23, 1.19),
        (0.66, 1.31, 0.27, 1.06),
        (0.68, 1.05, 0.32, 1.05),
        (0.74, 1.04, 0.37, 1.04),
    ),
    (True, "narrow"): (
        (0.89, 3.03, 0.35, 2.57),
        (0.89, 3.03, 0.35, 2.59),
        (0.93, 2.95, 0.39, 2.01),
        (0.97, 1.92, 0.49, 1.48),
        (0.96, 1.93, 0.50, 1.48),
    ),
    (True, "broad"): (
        (0.92, 1.88, 0.32, 1.74),
        (0.93, 1.52, 0.32, 1.62),
        (0.93, 1.87, 0.39, 1.45),
        (0.96, 1.43, 0.49, 1.25),
        (0.97, 1.43, 0.49, 1.13),
    ),
    ("boundary_elements", "narrow"): (
        (0.90, 1.20, 0.84, 1.22),
        (0.89, 1.18, 0.88, 1.16),
        (0.89, 1.13, 0.89, 1.16),
        (0.91, 1.07, 0.88, 1.13),
        (0.96, 1.07, 0.88, 1.14),
    ),
    ("boundary_elements", "broad"): (
        (0.91, 1.09, 0.75, 1.22),
        (0.91, 1.07, 0.81, 1.15),
        (0.91, 1.04, 0.86, 1.12),
        (0.97, 1.04, 0.88, 1.10),
        (0.97, 1.04, 0.89, 1.10),
    ),
}


class TheoryError(NamedTuple):
    """Ranges of the ratio of theory to boundary elements that contain at least nine of ten cases."""

    area: tuple[float, float]
    friction: tuple[float, float]  # viscoelastic
    contact: tuple[float, float]  # smallest and largest A/A0 included
    relaxation: str  # "narrow" or "broad"
    extrapolated: float = 0.0  # decades of q1/q0 beyond the cases, for the law fitted to boundary elements


def contact_model_name(scene: Scene) -> str:
    """Return the contact model of a scene as text: the theory, with or without S in G, or the fitted law.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> rf.analysis.contact_model_name(scene)
    'theory as in the paper'
    """
    if scene.contact_model == "boundary_elements":
        return "law fitted to boundary elements"
    return "theory with S in G" if scene.area_correction else "theory as in the paper"


def theory_error(scene: Scene, area: ArrayLike | None = None) -> TheoryError | None:
    """Look up the error of the theory in similar scenes, as its ratio to boundary elements.

    Parameters
    ----------
    scene : Scene
    area : A/A0 by the theory at the conditions of interest, any shape [-]; None: 0.003 ... 0.8

    Returns
    -------
    TheoryError over all areas between 0.003 and 0.8; None without such areas, or if there are no similar
    cases. There are cases for a rigid self-affine surface, H = 0.5 ... 1, q1/qr = 2 ... 512, q1/q0 up to 512,
    under a smooth viscoelastic half-space without heating or softening, with gamma about 1/2. With
    `contact_model="boundary_elements"`, wider spectra are included: the law is extrapolated, and the limits
    of the ranges move by 5 % (friction) and 2.5 % (area) in each decade of q1/q0 beyond 512. The limits for
    friction move by 10 % per decade between 64 and 512.

    The ranges are widened, because the materials of a scene may differ from the materials of the cases. They
    contain at least 90 % of the area and of the friction of cases that the ranges were not made from, 91 % if
    relaxation times are closer than a decade (notebooks/law_elements.py, kind "other material").

    Examples
    --------
    Where A/A0 is 2 %, boundary elements have 0.93 to 1.5 times the area of the theory:

    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> ratios = rf.analysis.theory_error(scene, area=0.02)
    >>> ratios.area, ratios.friction, ratios.relaxation  # theory / boundary elements
    ((0.66, 1.08), (0.23, 1.19), 'broad')
    """
    if not _covered(scene):
        return None
    area = np.sqrt(np.multiply(AREAS[1:], AREAS[:-1])) if area is None else np.asarray(area).ravel()
    bins = np.searchsorted(AREAS, area, side="right") - 1
    inside = (bins >= 0) & (bins < len(AREAS) - 1)
    if not inside.any():
        return None
    smooth = scene.upper if relaxes(scene.upper) else scene.lower
    low, high = map(float, smooth.material.frequency_range() or (1.0, 1.0))
    relaxation = "broad" if high / low >= _BROAD else "narrow"
    version = scene.area_correction if scene.contact_model == "paper" else scene.contact_model
    rows = np.array([RATIOS[version, relaxation][k] for k in sorted(set(bins[inside].tolist()))])
    decades, growths = 0.0, np.zeros(2)
    if scene.contact_model == "boundary_elements":
        q = rough_surfaces(scene)[0][0].power_law().q
        ratio = float(q[-1] / q[0])
        decades = max(0.0, float(np.log10(ratio / WIDEST)))
        broader = _BROADER * np.log10(np.clip(ratio, _COMMON, WIDEST) / _COMMON)
        growths = np.array(GROWTH) * decades + [0.0, broader]
    area_factor, friction_factor = np.exp(growths).tolist()
    return TheoryError(
        (float(rows[:, 0].min()) / area_factor, float(rows[:, 1].max()) * area_factor),
        (float(rows[:, 2].min()) / friction_factor, float(rows[:, 3].max()) * friction_factor),
        (float(area[inside].min()), float(area[inside].max())),
        relaxation,
        decades,
    )


def _covered(scene):
    for rough, smooth in ((scene.lower, scene.upper), (scene.upper, scene.lower)):
        spectrum = rough.spectrum
        if (
            not rough.material.deforms
            and isinstance(spectrum, SelfAffine)
            and smooth.spectrum is None
            and smooth.half_space
            and smooth.material.relaxes
            and optional_parts(scene) <= {"shear", "area_correction", "boundary_elements"}
            and is_concrete(spectrum.q1)
        ):
            by_law = scene.contact_model == "boundary_elements"
            values = (
                (spectrum.q1 / spectrum.qr, (_RATIOS[0], np.inf if by_law else _RATIOS[1])),
                (spectrum.q1 / spectrum.q0, (0.0, np.inf if by_law else WIDEST)),
                (spectrum.hurst, _HURST),
                (scene.gamma, _GAMMA),
            )
            return all(low * (1 - 1e-9) <= float(x) <= high * (1 + 1e-9) for x, (low, high) in values)
    return False


def tabulated_solids(scene: Scene) -> list[str]:
    """Return the names of the solids with a tabulated modulus: "lower", "upper" or both."""
    bodies = {"lower": scene.lower, "upper": scene.upper}
    return [name for name, body in bodies.items() if isinstance(body.material, TabulatedModulus)]


def friction_outside_table(
    scene: Scene,
    velocity: ArrayLike,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    quadrature: Quadrature | None = None,
    compiler_options: Mapping[str, bool | int | float | str] | None = None,
) -> jax.Array:
    r"""Compute the share of the viscoelastic friction from frequencies outside the tabulated moduli.

    .. math:: 1 - \mu_\mathrm{none} / \mu

    with :math:`\mu` the viscoelastic friction, without contact shear, and
    :math:`\mu_\mathrm{none}` its value with E'' = 0 outside the tables (`TabulatedModulus.outside` = "none").
    A share near 1 means that friction depends mostly on the extrapolation.

    Parameters
    ----------
    scene : Scene with at least one TabulatedModulus
    velocity, pressure, temperature, quadrature : as for `friction`
    compiler_options : as for `solve`

    Returns
    -------
    array, broadcast shape [-]; 0 without viscoelastic friction

    Raises
    ------
    ValueError : as `contact_area`, or a scene without a tabulated modulus.

    Examples
    --------
    The share of the friction that follows from the table itself, at 0.1 nm/s and at 1 cm/s:

    >>> scene = rf.load_scene("data/tabulated_tread.toml")
    >>> outside = rf.analysis.friction_outside_table(scene, np.array([1e-10, 1e-2]), 0.15e6)
    >>> (1 - outside).round(2)
    Array([0.62, 1.  ], dtype=float64)
    """
    tabulated = tabulated_solids(scene)
    if not tabulated:
        raise ValueError("scene has no TabulatedModulus; at least one material must be tabulated")
    cut = scene.replace({f"{solid}.material.outside": "none" for solid in tabulated})
    conditions = (velocity, pressure, temperature)
    part = "viscoelastic_friction"
    options = {"quadrature": quadrature, "quantities": (part,), "compiler_options": compiler_options}
    return _share_beyond(*(getattr(solve(s, *conditions, **options), part) for s in (scene, cut)))


@jax.jit
def _share_beyond(whole, inside):
    return jnp.where(whole != 0, 1 - inside / jnp.where(whole != 0, whole, 1.0), 0.0)
