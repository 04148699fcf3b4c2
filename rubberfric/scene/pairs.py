"""Each rough surface of a scene with the solid that it strains in sliding: what the theory asks of a scene.

Roughness of one solid strains the other periodically, and its own solid only statically
[Scaraggi & Persson, eq. (A6) with the solids at v_1 and v_2].
"""

from typing import NamedTuple

from rubberfric.roughness.spectra import BrokenPowerLaw
from rubberfric.scene.scene import Body, Scene, relaxes
from rubberfric.scene.softening import Softened


class Pair(NamedTuple):
    """A rough surface and the solid that it strains."""

    rough: Body
    strained: Body
    side: str  # which solid is strained: "lower" or "upper"
    law: BrokenPowerLaw  # of the roughness, all directions together
    softened: Softened | None  # strain softening of the scene's viscoelastic solids

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
        layered = self.rough.layer is not None or self.strained.layer is not None
        return (layered and self.both_deform) or has_coating(self.strained)

    @property
    def harmonics(self) -> int:
        """Highest m of the cos(2 m phi) in the roughness that a viscoelastic solid sees."""
        return self.rough.spectrum.harmonic_count() if self.relaxes else 0

    @property
    def softens_apart(self) -> bool:
        """Whether <E'^2> and <E''^2> count apart, for softening changes them differently."""
        return self.relaxes and self.softened is not None and not self.both_deform

    @property
    def kinked(self) -> bool:
        """Whether the angular means have kinks over q: they are taken at the contact nodes themselves."""
        softens = self.softened is not None and self.both_deform
        return self.relaxes and (softens or self.rough.spectrum.harmonics_vary)

    @property
    def steep(self) -> bool:
        """Whether <|F|^2>, where smooth in ln q, may rise by 1e9 within an e-fold of it."""
        return (
            self.relaxes
            and not self.kinked
            and (self.strained.material.needs_quadrature or self.by_wavevector)
        )


def has_coating(body: Body) -> bool:
    """Whether a body's layer does more than to multiply its stiffness."""
    return body.layer is not None and not body.layer.multiplies


def pairs_of(scene: Scene) -> tuple[Pair, ...]:
    """The pair of every rough surface, that of the lower solid first."""
    facing = (("upper", scene.lower, scene.upper), ("lower", scene.upper, scene.lower))
    facing = [(side, rough, strained) for side, rough, strained in facing if rough.spectrum is not None]
    laws = tuple(rough.spectrum.power_law() for _, rough, _ in facing)
    softened = None if scene.softening is None else Softened(scene.softening, laws)
    return tuple(
        Pair(rough, strained, side, law, softened)
        for (side, rough, strained), law in zip(facing, laws, strict=True)
    )
