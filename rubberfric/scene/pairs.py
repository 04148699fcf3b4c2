"""Each rough surface of a scene with the solid that it strains in sliding: what the theory asks of a scene.

Roughness of one solid strains the other periodically, and its own solid only statically
[Scaraggi & Persson, eq. (A6) at omega = q v_j].
"""

from typing import NamedTuple

import jax

from rubberfric.roughness.spectra import BrokenPowerLaw, Spectrum
from rubberfric.scene.scene import Body, Scene, relaxes, shifts_of, softening_of
from rubberfric.scene.softening import Softened


class PairTemperatures(NamedTuple):
    """Temperatures of the two solids of a pair [K]: None (all at reference), (points,), or by wavevector."""

    strained: jax.Array | None = None
    rough: jax.Array | None = None


AT_REFERENCE = PairTemperatures()


class Pair(NamedTuple):
    """A rough surface and the solid that it strains."""

    rough: Body
    strained: Body
    side: str  # which solid is strained: "lower" or "upper"
    spectrum: Spectrum  # of the rough body
    law: BrokenPowerLaw  # the spectrum, all directions together
    softened: Softened | None = None  # how the strained solid softens
    softened_rough: Softened | None = None  # and the rough one

    @property
    def relaxes(self) -> bool:
        """Whether the strained solid is viscoelastic: else nothing depends on the velocity."""
        return relaxes(self.strained)

    @property
    def both_deform(self) -> bool:
        """Whether the rough solid deforms as well, in series with the strained one."""
        return self.rough.material.deforms

    @property
    def by_wavevector(self) -> bool:
        """Whether the stiffness depends on q itself: a coating, or two deformable solids with a layer."""
        layers = self.rough.layer, self.strained.layer
        coated = layers[1] is not None and not layers[1].multiplies
        return coated or (self.both_deform and any(layer is not None for layer in layers))

    @property
    def varies(self) -> bool:
        """Whether the series changes its form with temperature, not its times and by a common factor alone.

        A vertical shift changes one of two deformable solids; the base of a coating may have another shift.
        """
        vertical = any(
            shift.vertical is not None for body in (self.rough, self.strained) for shift in shifts_of(body)
        )
        layer = self.strained.layer
        if layer is not None and layer.varies(self.strained.material):
            return True
        return self.both_deform and vertical

    @property
    def static(self) -> bool:
        """Whether its stiffness is a constant at every wavevector."""
        return not (self.relaxes or self.varies)

    @property
    def harmonics(self) -> int:
        """Highest m of the cos(2 m phi) in the roughness that a viscoelastic solid sees."""
        return self.spectrum.harmonic_count() if self.relaxes else 0

    @property
    def separate_storage_loss(self) -> bool:
        """Whether <E'^2> and <E''^2> count apart, for softening changes them differently."""
        return self.softened is not None and not self.both_deform

    @property
    def softenings(self) -> list[Softened]:
        """How those of the two solids soften that do."""
        return [one for one in (self.softened, self.softened_rough) if one is not None]

    @property
    def softens_in_series(self) -> bool:
        """Whether either of two deformable solids softens."""
        return self.both_deform and bool(self.softenings)

    @property
    def kinked(self) -> bool:
        """Whether the angular means have kinks over q: they are taken at the contact nodes themselves."""
        return not self.static and (self.softens_in_series or (self.relaxes and self.spectrum.harmonics_vary))

    @property
    def steep(self) -> bool:
        """Whether <|F|^2>, where smooth in ln q, may rise by 1e9 within an e-fold of it."""
        return not (self.static or self.kinked) and self.by_wavevector

    @property
    def detail(self) -> float | None:
        """Finest detail of the angular means over ln q [-]; None of a series, which has none."""
        material = self.strained.material
        return material.detail if self.relaxes and material.needs_quadrature else None


def pairs_of(scene: Scene) -> tuple[Pair, ...]:
    """The pair of every rough surface, that of the lower solid first."""
    pairs = []
    for side, rough, strained in (("upper", scene.lower, scene.upper), ("lower", scene.upper, scene.lower)):
        if rough.spectrum is not None:
            pairs.append(Pair(rough, strained, side, rough.spectrum, rough.spectrum.power_law()))
    laws = tuple(pair.law for pair in pairs)

    def softened(body):
        softening = softening_of(scene, body)
        return None if softening is None else Softened(softening, laws)

    return tuple(
        pair._replace(softened=softened(pair.strained), softened_rough=softened(pair.rough)) for pair in pairs
    )
