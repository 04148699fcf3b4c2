"""Rules of imports: one way, without circles, on public names; and no folder has too many rooms.

All imports are read from the text, those inside functions too. A module's room is the folder or file
below the package: `rubberfric.io.hdf5` is in the room `io`.
"""

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

# Each room imports from those before it; rooms on one floor not from each other.
FLOORS = {
    "rubberfric": (
        *(
            {"base"},
            {"roughness", "materials"},
            {"scene"},
            {"theory"},
            {"io"},
            {"analysis"},
            {"applications"},
            {"plot"},
        ),
        {"commands", "fitting"},
    ),
    "fitting": (
        *({"data", "parameters"}, {"solvers"}, {"uncertainty"}, {"budget"}, {"results"}, {"stages"}, {"fit"}),
        *({"ensemble", "characterise"}, {"commands"}),
    ),
}


# It imports `fitting`, which uses rubberfric, only when a name of it is used.
SECOND_NAME = "rubberfric.fitting"


ROOMS = 14  # of a folder


NO_ROOMS = ("__init__.py", "__main__.py", "__pycache__", "py.typed")


class Import(NamedTuple):
    """One imported name, or a module if `name` is None."""

    path: Path  # of the module that imports
    module: str
    line: int
    target: str  # the module imported from
    name: str | None

    def __str__(self):
        what = self.target if self.name is None else f"{self.name} from {self.target}"
        return f"{self.path}:{self.line} imports {what}"


class House:
    """Return the modules below a folder by name, and their imports of each other."""

    def __init__(self, root: Path):
        self.root = root
        paths = [path for package in FLOORS for path in sorted((root / package).rglob("*.py"))]
        self.modules = {module_name(path.relative_to(root)): path for path in paths}
        self.trees = {module: ast.parse(path.read_text()) for module, path in self.modules.items()}
        modules = [module for module in self.modules if module != SECOND_NAME]
        self.imports = [found for module in modules for found in self.imports_of(module)]

    def imports_of(self, module: str) -> Iterator[Import]:
        path = self.modules[module].relative_to(self.root)
        for node in ast.walk(self.trees[module]):
            if isinstance(node, ast.Import):
                for alias in node.names:
                    if alias.name in self.modules:
                        yield Import(path, module, node.lineno, alias.name, None)
            elif isinstance(node, ast.ImportFrom):
                package = module.split(".")[: -node.level or None] if path.name != "__init__.py" else []
                source = ".".join([*package, node.module or ""]) if node.level else node.module
                for alias in node.names:
                    if f"{source}.{alias.name}" in self.modules:
                        yield Import(path, module, node.lineno, f"{source}.{alias.name}", None)
                    elif source in self.modules:
                        yield Import(path, module, node.lineno, source, alias.name)

    def is_folder(self, module: str) -> bool:
        return self.modules[module].name == "__init__.py"

    def public(self, module: str) -> set[str]:
        """The names in `__all__` of a module, or that a lazy package imports for type checkers."""
        for node in self.trees[module].body:
            if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
                return {alias.name for one in node.body for alias in getattr(one, "names", [])}
            if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
                return set(ast.literal_eval(node.value))
        return set()


def module_name(path: Path) -> str:
    parts = path.with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def room(module: str) -> str:
    return ".".join(module.split(".")[:2])


def floor(module: str) -> int:
    """The floor of a module's room; the top of a package stands above all."""
    package, *inside = module.split(".")
    floors = FLOORS[package]
    return next((i for i, rooms in enumerate(floors) if inside and inside[0] in rooms), len(floors))


def rooms_without_a_floor(house: House) -> list[str]:
    doors = {f"{package}.__main__" for package in FLOORS}  # which begin a process, above all rooms
    found = {room(module) for module in house.modules if "." in module} - doors
    return [f"{name}: has no place in the order" for name in sorted(found) if is_top(name)]


def is_top(module: str) -> bool:
    return floor(module) == len(FLOORS[module.split(".")[0]])


def upward(house: House) -> list[str]:
    """Imports of a room from one that does not stand below it, and of rubberfric from fitting."""
    found = []
    for one in house.imports:
        (package, *_), (other, *_) = one.module.split("."), one.target.split(".")
        if package == other and room(one.module) != room(one.target):
            if floor(one.target) >= floor(one.module):
                found.append(f"{one}: {room(one.target)} does not stand below {room(one.module)}")
        elif (package, other) == ("rubberfric", "fitting"):
            found.append(f"{one}: rubberfric does not know fitting")
    return found


def circles(house: House) -> list[str]:
    """Return sets of modules that import each other in a circle (Tarjan's components)."""
    targets = {module: set() for module in house.modules}
    for one in house.imports:
        targets[one.module].add(one.target)
    index, low, stack, found = {}, {}, [], []

    def visit(module):
        index[module] = low[module] = len(index)
        stack.append(module)
        for target in targets[module]:
            if target not in index:
                visit(target)
            if target in stack:
                low[module] = min(low[module], low[target])
        if low[module] == index[module]:
            position = stack.index(module)
            component = sorted(stack[position:])
            del stack[position:]
            if len(component) > 1 or module in targets[module]:
                found.append(f"circle of {len(component)}: {', '.join(component)}")

    for module in targets:
        if module not in index:
            visit(module)
    return found


def through_the_door(house: House) -> list[str]:
    """Imports of a name by the folder above its module, inside a package: the module says where it is."""
    return [
        f"{one}: from the module that defines it, not from the folder"
        for one in house.imports
        if house.is_folder(one.target) and not house.is_folder(one.module)
        if one.module.split(".")[0] == one.target.split(".")[0]
        if one.name is None or not is_dunder(one.name)
    ]


def is_private(name: str | None) -> bool:
    return name is not None and name.startswith("_") and not is_dunder(name)


def is_dunder(name: str) -> bool:
    return name.startswith("__") and name.endswith("__")


def private(house: House) -> list[str]:
    """Names or modules with a leading underscore that another room uses."""
    found = []
    for one in house.imports:
        names = [one.name, *one.target.split(".")]
        if room(one.module) != room(one.target) and any(map(is_private, names)):
            found.append(f"{one}: is private")
    for module, used in attributes(house):
        if is_private(used.split(".")[-1]):
            found.append(f"{house.modules[module].relative_to(house.root)} uses {used}: is private")
    return found


def across(house: House) -> list[str]:
    """Names of rubberfric that fitting uses although they are not in `__all__` of a package."""
    found = [
        f"{one}: fitting uses names in __all__ of rubberfric or of one of its rooms"
        for one in house.imports
        if (one.module.split(".")[0], one.target.split(".")[0]) == ("fitting", "rubberfric")
        if not is_public(house, one.target, one.name)
    ]
    for module, used in attributes(house):
        if module.split(".")[0] == "fitting" and used.split(".")[0] == "rubberfric":
            target, _, name = used.rpartition(".")
            if house.is_folder(target) and not is_public(house, target, name):
                found.append(
                    f"{house.modules[module].relative_to(house.root)} uses {used}: not in __all__ of {target}"
                )
    return found


def is_public(house: House, target: str, name: str | None) -> bool:
    """Return True if a name of a folder or package is public."""
    if name is None:
        above, _, own = target.rpartition(".")
        return not above or own in house.public(above)
    return house.is_folder(target) and target.count(".") <= 1 and name in house.public(target)


def attributes(house: House) -> Iterator[tuple[str, str]]:
    """Yield uses of `module.name` of imported modules: the module, and the dotted name."""
    for module, tree in house.trees.items():
        known = {}
        for node in ast.walk(tree):
            if isinstance(node, ast.Import):
                known |= {alias.asname or alias.name: alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level:
                known |= {a.asname or a.name: f"{node.module}.{a.name}" for a in node.names}
        known = {name: target for name, target in known.items() if target in house.modules}
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute):
                before, _, last = ast.unparse(node).rpartition(".")
                target = resolved(before, known, house)
                if target and f"{target}.{last}" not in house.modules and room(target) != room(module):
                    yield module, f"{target}.{last}"


def resolved(text: str, known: dict[str, str], house: House) -> str | None:
    """The module that `rf.io` names."""
    first, *inside = text.split(".")
    target = ".".join([known.get(first, "?"), *inside])
    return target if target in house.modules else None


def crowded(folder: Path) -> list[str]:
    """Folders with more rooms than one can see at a glance."""
    found = []
    for place in sorted({folder, *(path.parent for path in folder.rglob("*.py"))}):
        rooms = sorted(path.name for path in place.iterdir() if path.name not in NO_ROOMS)
        if len(rooms) > ROOMS:
            found.append(f"{place}: {len(rooms)} rooms, more than {ROOMS}: {', '.join(rooms)}")
    return found


RULES = (rooms_without_a_floor, upward, circles, through_the_door, private, across)
