"""Second name of the package `fitting`: `rubberfric.fitting.fit` is `fitting.fit`. So are all public names.

The package is imported when a name is first used. ImportError says so if Python finds another package
`fitting` first, for example a folder of the user.
"""

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from types import ModuleType

    from fitting import *  # noqa: F403


def __getattr__(name: str) -> object:
    """Return a public name of `fitting`."""
    # Other names with underscores would make Python take this module for a package.
    if name.startswith("_") and name != "__all__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(_package(), name)


def __dir__() -> list[str]:
    """Return the public names of `fitting`."""
    return dir(_package())


def _package() -> "ModuleType":
    import importlib

    package = importlib.import_module("fitting")
    if "FrictionData" not in getattr(package, "__all__", ()):
        place = getattr(package, "__file__", None) or next(iter(package.__path__))
        raise ImportError(
            f"{place} hides the package fitting of rubberfric: rename it, or put its folder behind "
            "rubberfric in sys.path"
        )
    return package
