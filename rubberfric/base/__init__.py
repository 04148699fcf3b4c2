"""What knows no physics: objects and their rules, quadrature, units, files that appear whole, progress."""

from rubberfric.base import html
from rubberfric.base.atomic import StrPath, as_path, check_writable, replacing, write_durably
from rubberfric.base.checks import (
    FINITE,
    NONNEGATIVE,
    POSITIVE,
    as_leaf,
    between,
    check_values,
    closest,
    shown,
)
from rubberfric.base.objects.fields import (
    Matrix,
    Number,
    OptionalNumber,
    Static,
    Vector,
    child,
    leaf,
    static,
)
from rubberfric.base.objects.key_paths import KeyPath, parse_key_path
from rubberfric.base.objects.physical import (
    PhysicalObject,
    fields_of,
    forget,
    object_html,
    physical,
    unit_of,
)

__all__ = [
    "FINITE",
    "NONNEGATIVE",
    "POSITIVE",
    "KeyPath",
    "Matrix",
    "Number",
    "OptionalNumber",
    "PhysicalObject",
    "Static",
    "StrPath",
    "Vector",
    "as_leaf",
    "as_path",
    "between",
    "check_values",
    "check_writable",
    "child",
    "closest",
    "fields_of",
    "forget",
    "html",
    "leaf",
    "object_html",
    "parse_key_path",
    "physical",
    "replacing",
    "shown",
    "static",
    "unit_of",
    "write_durably",
]
