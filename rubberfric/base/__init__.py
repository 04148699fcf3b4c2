"""What knows no physics: objects and their rules, quadrature, units, files that appear whole, progress."""

from rubberfric.base.checks import FINITE, NONNEGATIVE, POSITIVE, between, check_values, closest, shown
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
    "Vector",
    "between",
    "check_values",
    "child",
    "closest",
    "fields_of",
    "forget",
    "leaf",
    "object_html",
    "parse_key_path",
    "physical",
    "shown",
    "static",
    "unit_of",
]
