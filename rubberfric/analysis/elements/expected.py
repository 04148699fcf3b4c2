"""How far the theory is from boundary elements, in scenes like those of notebooks/boundary_elements.md."""

from typing import NamedTuple

import numpy as np
from jax.typing import ArrayLike

from rubberfric.base.checks import is_concrete
from rubberfric.roughness.spectra import SelfAffine
from rubberfric.scene.scene import Scene, present, relaxes

# Of the table: contact areas, and what q1/qr, H and gamma are covered. A plateau below qr tells little.
AREAS = (0.003, 0.01, 0.03, 0.1, 0.3, 0.8)
_RATIOS, _HURST, _GAMMA = (8.0, 64.0), (0.6, 1.0), (0.4, 0.55)
# Relaxation times over so much are those of a rubber, of less nearly one time.
_BROAD = 1e3

# Theory over boundary elements, 5 and 95 % of the cases, for S in G or not and a narrow or a broad
# relaxation: in each interval of the theory's area (area low, area high, friction low, friction high).
RATIOS = {
    (False, "narrow"): (
        (0.64, 0.95, 0.33, 1.64),
        (0.82, 0.98, 0.59, 1.17),
        (0.70, 0.93, 0.37, 1.31),
        (0.92, 0.95, 0.64, 0.84),
        (0.85, 0.93, 0.56, 0.64),
    ),
    (False, "broad"): (
        (0.62, 0.85, 0.48, 1.24),
        (0.70, 0.84, 0.34, 0.92),
        (0.79, 0.85, 0.51, 0.86),
        (0.76, 0.88, 0.41, 0.85),
        (0.89, 0.95, 0.83, 0.89),
    ),
    (True, "narrow"): (
        (0.90, 1.36, 0.46, 2.31),
        (1.08, 1.39, 1.02, 1.83),
        (0.98, 1.36, 0.51, 1.70),
        (1.12, 1.25, 0.84, 1.31),
        (1.01, 1.14, 0.66, 0.77),
    ),
    (True, "broad"): (
        (0.86, 1.21, 1.02, 1.75),
        (0.98, 1.19, 0.48, 1.28),
        (1.04, 1.20, 0.96, 1.25),
        (1.04, 1.16, 0.55, 1.05),
        (0.98, 1.05, 0.85, 0.97),
    ),
}


class TheoryError(NamedTuple):
    """Theory over boundary elements in nine cases of ten."""

    area: tuple[float, float]
    friction: tuple[float, float]  # viscoelastic
    contact: tuple[float, float]  # smallest and largest A/A0 that this is about
    relaxation: str  # "narrow" or "broad"


def theory_error(scene: Scene, area: ArrayLike) -> TheoryError | None:
    """What the theory's error has been in scenes like this one.

    Parameters
    ----------
    scene : Scene
    area : A/A0 by the theory at the conditions of interest, any shape [-]

    Returns
    -------
    TheoryError, of all areas between 0.003 and 0.8 together; None if none is, or of a scene that the table
    does not cover: it has a rigid self-affine surface, H = 0.6 ... 1, q1/qr = 8 ... 64, under a smooth
    viscoelastic half-space without heating or softening, gamma about 1/2.

    Source: notebooks/boundary_elements.csv, made by notebooks/boundary_elements.py.
    """
    if not _covered(scene):
        return None
    area = np.asarray(area).ravel()
    bins = np.searchsorted(AREAS, area, side="right") - 1
    inside = (bins >= 0) & (bins < len(AREAS) - 1)
    if not inside.any():
        return None
    smooth = scene.upper if relaxes(scene.upper) else scene.lower
    low, high = map(float, smooth.material.frequency_range() or (1.0, 1.0))
    relaxation = "broad" if high / low >= _BROAD else "narrow"
    rows = np.array(
        [RATIOS[scene.area_correction, relaxation][k] for k in sorted(set(bins[inside].tolist()))]
    )
    return TheoryError(
        (float(rows[:, 0].min()), float(rows[:, 1].max())),
        (float(rows[:, 2].min()), float(rows[:, 3].max())),
        (float(area[inside].min()), float(area[inside].max())),
        relaxation,
    )


def _covered(scene):
    """Whether the table has scenes like this one."""
    for rough, smooth in ((scene.lower, scene.upper), (scene.upper, scene.lower)):
        spectrum = rough.spectrum
        if (
            not rough.material.deforms
            and isinstance(spectrum, SelfAffine)
            and smooth.spectrum is None
            and smooth.layer is None
            and smooth.material.relaxes
            and present(scene) <= {"shear", "area_correction"}
            and is_concrete(spectrum.q1)
        ):
            values = (spectrum.q1 / spectrum.qr, _RATIOS), (spectrum.hurst, _HURST), (scene.gamma, _GAMMA)
            return all(low * (1 - 1e-9) <= float(x) <= high * (1 + 1e-9) for x, (low, high) in values)
    return False
