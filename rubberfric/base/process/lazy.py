"""Packages whose public names are imported when they are first asked for.

So `rubberfric --help` need not wait for JAX, which takes longer to import than many a curve to compute.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from typing import Any


class LazyPackage(ModuleType):
    """A package that knows where its public names are; its rooms are found, too."""

    _places: dict[str, str]  # of names, the modules that they are in
    _modules: dict[str, str]  # of names, the modules that they are
    _elsewhere: dict[str, str]

    def __getattr__(self, name: str) -> Any:
        """Import a name."""
        if name in self._places:
            value = getattr(importlib.import_module(self._places[name]), name)
        elif name in self._elsewhere:
            # An AttributeError would lose its text in "from rubberfric import fit".
            other = self._elsewhere[name]
            raise ImportError(f"{self.__name__} has no {name!r}, {other} has: from {other} import {name}")
        else:
            from importlib.util import find_spec

            place = self._modules.get(name, f"{self.__name__}.{name}")
            if name.startswith("_") or find_spec(place) is None:
                raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")
            value = importlib.import_module(place)
        vars(self)[name] = value
        return value

    def __setattr__(self, name: str, value: object) -> None:
        """As of any module, but `fitting.fit` is the function once the module of that name is imported."""
        if name in self._places and isinstance(value, ModuleType):
            if value.__name__ != self._places[name]:
                return
            value = getattr(value, name)  # for who looks at what a module holds, as pdoc does
        super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        """The public names only."""
        return sorted({*self._places, *self._modules})


def lazily(
    package: str,
    places: Mapping[str, str],
    modules: Sequence[str] = (),
    elsewhere: Mapping[str, str] | None = None,
) -> None:
    """Have a package import its names when they are asked for.

    Parameters
    ----------
    package : its `__name__`
    places : dict of module -> names that are imported from it, with spaces between them
    modules : those that are names themselves, by their last part
    elsewhere : dict of another package -> names that are looked for here, and are there
    """

    def by_name(table: Mapping[str, str]) -> dict[str, str]:
        return {name: place for place, names in table.items() for name in names.split()}

    module = sys.modules[package]
    vars(module).update(
        _places=by_name(places),
        _modules={place.rpartition(".")[2]: place for place in modules},
        _elsewhere=by_name(elsewhere or {}),
    )
    module.__class__ = LazyPackage
