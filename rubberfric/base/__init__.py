"""What knows no physics: objects and their rules, quadrature, units, files that appear whole, progress."""

from rubberfric.base.process.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric.base.atomic import (
        TABLE_SUFFIXES,
        StrPath,
        as_path,
        check_readable,
        check_suffix,
        check_writable,
        replacing,
        write_durably,
    )
    from rubberfric.base.blocks import recurring_length
    from rubberfric.base.checks import (
        FINITE,
        NONNEGATIVE,
        POSITIVE,
        as_array,
        as_leaf,
        between,
        check_values,
        closest,
        shown,
    )
    from rubberfric.base.objects import html
    from rubberfric.base.objects.fields import (
        Leaf,
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
        Kind,
        PhysicalObject,
        fields_of,
        forget,
        object_html,
        parts_of,
        physical,
        rising_of,
        unit_of,
    )
    from rubberfric.base.process.compiler import quick_jit, quick_options
    from rubberfric.base.process.cores import cores
    from rubberfric.base.process.release import VERSION
    from rubberfric.base.progress import Progress

__all__ = [
    "FINITE",
    "NONNEGATIVE",
    "POSITIVE",
    "TABLE_SUFFIXES",
    "VERSION",
    "KeyPath",
    "Kind",
    "Leaf",
    "Matrix",
    "Number",
    "OptionalNumber",
    "PhysicalObject",
    "Progress",
    "Static",
    "StrPath",
    "Vector",
    "as_array",
    "as_leaf",
    "as_path",
    "between",
    "check_readable",
    "check_suffix",
    "check_values",
    "check_writable",
    "child",
    "closest",
    "cores",
    "fields_of",
    "forget",
    "html",
    "lazily",
    "leaf",
    "object_html",
    "parse_key_path",
    "parts_of",
    "physical",
    "quick_jit",
    "quick_options",
    "recurring_length",
    "replacing",
    "rising_of",
    "shown",
    "static",
    "unit_of",
    "write_durably",
]

lazily(
    __name__,
    {
        "rubberfric.base.atomic": (
            "TABLE_SUFFIXES StrPath as_path check_readable check_suffix check_writable replacing"
            " write_durably"
        ),
        "rubberfric.base.blocks": "recurring_length",
        "rubberfric.base.checks": (
            "FINITE NONNEGATIVE POSITIVE as_array as_leaf between check_values closest shown"
        ),
        "rubberfric.base.objects.fields": "Leaf Matrix Number OptionalNumber Static Vector child leaf static",
        "rubberfric.base.objects.key_paths": "KeyPath parse_key_path",
        "rubberfric.base.objects.physical": (
            "Kind PhysicalObject fields_of forget object_html parts_of physical rising_of unit_of"
        ),
        "rubberfric.base.process.compiler": "quick_jit quick_options",
        "rubberfric.base.process.cores": "cores",
        "rubberfric.base.process.lazy": "lazily",
        "rubberfric.base.process.release": "VERSION",
        "rubberfric.base.progress": "Progress",
    },
    modules=("rubberfric.base.objects.html",),
)
