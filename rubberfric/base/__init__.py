"""Modules without physics: fields and checks of objects, quadrature, units, files and progress."""

from rubberfric.base import lazy

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric.base.atomic import TABLE_SUFFIXES as TABLE_SUFFIXES
    from rubberfric.base.atomic import StrPath as StrPath
    from rubberfric.base.atomic import as_path as as_path
    from rubberfric.base.atomic import check_readable as check_readable
    from rubberfric.base.atomic import check_suffix as check_suffix
    from rubberfric.base.atomic import check_writable as check_writable
    from rubberfric.base.atomic import replacing as replacing
    from rubberfric.base.atomic import write_durably as write_durably
    from rubberfric.base.blocks import broadcast_shape as broadcast_shape
    from rubberfric.base.blocks import check_count as check_count
    from rubberfric.base.blocks import recurring_length as recurring_length
    from rubberfric.base.checks import FINITE as FINITE
    from rubberfric.base.checks import NONNEGATIVE as NONNEGATIVE
    from rubberfric.base.checks import POSITIVE as POSITIVE
    from rubberfric.base.checks import ArrayLike as ArrayLike
    from rubberfric.base.checks import NumberLike as NumberLike
    from rubberfric.base.checks import as_array as as_array
    from rubberfric.base.checks import as_leaf as as_leaf
    from rubberfric.base.checks import between as between
    from rubberfric.base.checks import check_unmasked as check_unmasked
    from rubberfric.base.checks import check_values as check_values
    from rubberfric.base.checks import closest as closest
    from rubberfric.base.checks import either as either
    from rubberfric.base.checks import listed as listed
    from rubberfric.base.checks import shape_of as shape_of
    from rubberfric.base.checks import shown as shown
    from rubberfric.base.checks import warn_caller as warn_caller
    from rubberfric.base.compilation import quick_jit as quick_jit
    from rubberfric.base.compilation import quick_options as quick_options
    from rubberfric.base.lazy import lazily as lazily
    from rubberfric.base.objects import html as html
    from rubberfric.base.objects.fields import Leaf as Leaf
    from rubberfric.base.objects.fields import Matrix as Matrix
    from rubberfric.base.objects.fields import Number as Number
    from rubberfric.base.objects.fields import OptionalNumber as OptionalNumber
    from rubberfric.base.objects.fields import Static as Static
    from rubberfric.base.objects.fields import Vector as Vector
    from rubberfric.base.objects.fields import child as child
    from rubberfric.base.objects.fields import leaf as leaf
    from rubberfric.base.objects.fields import static as static
    from rubberfric.base.objects.key_paths import KeyPath as KeyPath
    from rubberfric.base.objects.key_paths import parse_key_path as parse_key_path
    from rubberfric.base.objects.labelled import Labelled as Labelled
    from rubberfric.base.objects.labelled import LabelledArrays as LabelledArrays
    from rubberfric.base.objects.labelled import optional_library as optional_library
    from rubberfric.base.objects.physical import Kind as Kind
    from rubberfric.base.objects.physical import PhysicalObject as PhysicalObject
    from rubberfric.base.objects.physical import fields_of as fields_of
    from rubberfric.base.objects.physical import forget as forget
    from rubberfric.base.objects.physical import object_html as object_html
    from rubberfric.base.objects.physical import parts_of as parts_of
    from rubberfric.base.objects.physical import physical as physical
    from rubberfric.base.objects.physical import rising_of as rising_of
    from rubberfric.base.objects.physical import unit_of as unit_of
    from rubberfric.base.progress import Progress as Progress
    from rubberfric.base.release import VERSION as VERSION
    from rubberfric.base.release import cores as cores

lazy.lazily(__name__, __file__)
