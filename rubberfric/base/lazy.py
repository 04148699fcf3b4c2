"""Packages whose public names are imported when they are first used.

`rubberfric --help` therefore does not wait for the import of JAX. A package lists its names once, in imports
that only type checkers follow:

    TYPE_CHECKING = False
    if TYPE_CHECKING:
        from rubberfric.scene import Scene as Scene

    lazily(__name__, __file__)
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from typing import Any


class LazyPackage(ModuleType):
    """A package that imports its public names and modules when they are first used."""

    _places: dict[str, str]  # module of each name
    _elsewhere: str | None

    def __getattr__(self, name: str) -> Any:
        """Import a public name or a module of the package, and return the imported object."""
        place = self._places.get(name, self.__name__)
        source = self if place == self.__name__ else importlib.import_module(place)
        if source is not self and hasattr(source, name):
            value = getattr(source, name)
        else:
            from importlib.util import find_spec  # slow to import and rarely needed

            if name.startswith("_") or find_spec(f"{place}.{name}") is None:
                raise AttributeError(self._missing(name))
            value = importlib.import_module(f"{place}.{name}")
        vars(self)[name] = value
        return value

    def _missing(self, name):
        other = self._elsewhere
        if other is not None and not name.startswith("_") and name in dir(importlib.import_module(other)):
            return f"{self.__name__} has no {name!r}, {other} has: from {other} import {name}"
        return f"module {self.__name__!r} has no attribute {name!r}"

    def __setattr__(self, name: str, value: object) -> None:
        """Set an attribute, but do not let a module replace a public name.

        For example, importing the module `fitting.fit` does not replace the function `fitting.fit`.
        """
        if name in self._places and isinstance(value, ModuleType):
            place = self._places[name]
            if value.__name__ == place:
                value = getattr(value, name)  # for tools that read the module's dictionary
            elif value.__name__ != f"{place}.{name}":
                return
        super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        """Return the public names."""
        return sorted(self._places)


def lazily(package: str, path: str, elsewhere: str | None = None, load: bool = False) -> None:
    """Let a package import its public names when they are first used, and set its `__all__`.

    Parameters
    ----------
    package, path : `__name__` and `__file__` of the package
        The file has a line `from module import name as name` for every public name.
    elsewhere : another package that users may confuse with this package
        If the other package has a missing name, the AttributeError says so.
    load : True imports all modules with the package, so that `kinds` knows the classes that they define
    """
    places = {}
    with open(path, encoding="utf-8") as file:
        for line in file:
            # Split into words, because importing `ast` would take longer than everything else.
            match line.split():
                case ["from", place, "import", name, "as", again] if name == again:
                    places[name] = place
    module = sys.modules[package]
    vars(module).update(_places=places, _elsewhere=elsewhere, __all__=sorted(places))
    module.__class__ = LazyPackage
    for place in dict.fromkeys(places.values()) if load else ():
        importlib.import_module(place)
