"""Whether the numbers of a scene file can be in SI: what only a wrong unit would explain is an error.

Asked where a file is read that people write (TOML), unless it says `plausible = false`; what is asked
stands in `rubberfric.scene.plausibility`.
"""

from collections.abc import Iterator

from rubberfric.base.objects.physical import PhysicalObject
from rubberfric.io.scene_files.conditions import Conditions
from rubberfric.scene.plausibility import doubts_of_conditions, doubts_of_scene


def check_plausible_scene(where: str, scene: PhysicalObject) -> None:
    """ValueError naming the first number of a scene that is hardly in SI; `where` begins its line."""
    _raise(where, doubts_of_scene(scene))


def check_plausible_conditions(where: str, conditions: Conditions) -> None:
    """The same of conditions."""
    _raise(where, doubts_of_conditions(**conditions._asdict()))


def _raise(where: str, doubts: Iterator[str]) -> None:
    for text in doubts:
        raise ValueError(f"{where}{text} plausible = false at the top of the file accepts it")
