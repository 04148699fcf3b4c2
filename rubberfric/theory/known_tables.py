"""Tables of angular means that outlive a call: those of tabulated moduli whose numbers are known.

To build one takes as long as to look up fifty velocities. A plain call, and a function under `jit` that a
scene is closed over in, find it made; where a number of a modulus is traced it is part of the program.
"""

import functools
from typing import Any

import jax
import numpy as np

from rubberfric.base.checks import is_concrete
from rubberfric.scene.pairs import Pair, pairs_of
from rubberfric.scene.scene import Scene, cast
from rubberfric.theory.quantities import Needs, needs_of
from rubberfric.theory.stiffness.means_table import MeansTable, means_table
from rubberfric.theory.stiffness.series import modulus_scale, tabulated_stiffness

# How many scenes are remembered, of 0.4 MB for each kind of mean.
_KEPT = 4

Tables = tuple[MeansTable | None, ...]


def known_tables(scene: Scene, quantities: tuple[str, ...], dtype: np.dtype) -> Tables | None:
    """The table of every pair of a scene, None for those that have none; None if nothing is known.

    Parameters
    ----------
    scene : Scene
    quantities : fields of `Solution`
    dtype : of the tables
    """
    materials = scene.lower.material, scene.upper.material
    if scene.heating is not None or not any(one.deforms and one.needs_quadrature for one in materials):
        return None
    needs = needs_of(scene, quantities)
    if not needs.power or not all(map(is_concrete, jax.tree.leaves(scene))):
        return None
    # In a program that is being traced, too, now and not there.
    with jax.ensure_compile_time_eval():
        return _made(_Known(scene, needs, dtype))


class _Known:
    """A scene, equal to another if their tables are: by numbers, as arrays may be changed in place."""

    def __init__(self, scene: Scene, needs: Needs, dtype: np.dtype):
        self.scene, self.needs, self.dtype = scene, needs, dtype
        materials = [
            (x.shape, x.tobytes())
            for body in (scene.lower, scene.upper)
            for x in (np.asarray(leaf, dtype) for leaf in jax.tree.leaves(body.material))
        ]
        self.key: Any = jax.tree.structure(scene), tuple(materials), needs, dtype

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Known) and self.key == other.key


@functools.lru_cache(maxsize=_KEPT)
def _made(known):
    tables = _build(cast(known.scene, known.dtype), known.needs)
    del known.scene  # which may hold large roughness
    return tables if any(table is not None for table in tables) else None


# It runs once: what is spent on compiling it is the time that counts.
@functools.partial(jax.jit, static_argnums=1, compiler_options={"xla_backend_optimization_level": 0})
def _build(scene, needs):
    scale = modulus_scale(scene)
    return tuple(_table(pair, scale, needs) for pair in pairs_of(scene))


def _table(pair: Pair, scale, needs):
    F = tabulated_stiffness(pair, scale)
    return None if F is None or pair.harmonics else means_table(F, needs, pair.softens_apart, None)
