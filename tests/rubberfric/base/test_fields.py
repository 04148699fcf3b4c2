"""Descriptions of fields, and the registry of classes."""

from typing import Literal

import jax
import numpy as np
import pytest

import rubberfric as rf
from rubberfric.base import (
    Matrix,
    Number,
    OptionalNumber,
    PhysicalObject,
    Vector,
    child,
    leaf,
    physical,
    static,
)
from rubberfric.base.checks import NONNEGATIVE
from rubberfric.base.objects.fields import Child, Leaf, Static
from rubberfric.base.objects.physical import check_kind, fields_of, forget, kinds, leaves_of, unit_of
from rubberfric.materials.material import Material
from rubberfric.roughness.spectra import Spectrum


@pytest.fixture
def made():
    """Register a class during a test."""
    known = []

    def make(cls):
        known.append(physical(cls))
        return known[-1]

    yield make
    for cls in known:
        forget(cls)


def test_annotations_complete_the_fields(made):
    @made
    class Part(PhysicalObject):
        number: Number = leaf(NONNEGATIVE, unit="Pa", plausible=(1.0, 2.0), column="x")
        perhaps: OptionalNumber = leaf(unit="-", default=None)
        vector: Vector = leaf(unit="s", default=(1.0,))
        matrix: Matrix = leaf(unit="m", default=((1.0,),))
        mode: Literal["a", 3] = static(default="a")
        flag: bool = static(default=False)
        inner: "rf.Slab | None" = child(default=None)
        needed: rf.Slab = child(default=rf.Slab(1.0))

    fields = fields_of(Part)
    number = fields["number"]
    assert isinstance(number, Leaf)
    assert (number.unit, number.plausible, number.column, number.ndim) == ("Pa", (1.0, 2.0), "x", 0)
    numbers = [(field.ndim, field.optional) for field in leaves_of(Part).values()]
    assert numbers == [(0, False), (0, True), (1, False), (2, False)]
    assert (fields["mode"], fields["flag"]) == (Static(("a", 3)), Static((False, True)))
    for name, optional in (("inner", True), ("needed", False)):
        field = fields[name]
        assert isinstance(field, Child)
        assert (field.role, field.optional) == (rf.Slab, optional)
    assert [unit_of(Part, name) for name in ("number", "vector", "mode")] == ["Pa", "s", ""]
    part = Part(3, mode=3)
    assert part.vector.shape == (1,)
    assert part.matrix.shape == (1, 1)
    assert jax.tree.structure(part) != jax.tree.structure(part.replace(flag=True))
    with pytest.raises(ValueError, match=r"^Part\.mode = 'b': must be one of 'a', 3$"):
        Part(3, mode="b")
    of_numpy = Part(3, mode=np.str_("a"), flag=np.bool_(True))
    assert type(of_numpy.mode) is str and of_numpy.flag is True
    with pytest.raises(ValueError, match=r"^Part\.needed = None: must be Slab$"):
        Part(3, needed=None)


@pytest.mark.parametrize("annotation", [float, jax.Array, Number | None, "Vector | Matrix"])
def test_annotations_that_say_too_little(annotation):
    namespace = {"__annotations__": {"x": annotation}, "__module__": __name__, "x": leaf(unit="m")}
    with pytest.raises(TypeError, match=r"^Part\.x: annotated .*: must be Number"):
        physical(type("Part", (PhysicalObject,), namespace))
    assert "Part" not in kinds(PhysicalObject)


def test_two_classes_of_one_name(made):
    with pytest.raises(TypeError, match=r"^Slab: rubberfric\.materials\.slab"):

        @physical
        class Slab(PhysicalObject):
            depth: Number = leaf(unit="m")

    def again():
        class Twice(PhysicalObject):
            depth: Number = leaf(unit="m")

        return made(Twice)

    first, second = again(), again()  # as a cell of a notebook that is run again
    assert kinds(PhysicalObject)["Twice"] is second
    forget(first)
    assert kinds(PhysicalObject)["Twice"] is second
    forget(second)
    assert "Twice" not in kinds(PhysicalObject)


def test_kinds_are_in_the_order_of_their_definition():
    assert list(kinds(Material)) == ["Rigid", "Elastic", "Prony", "PronyShear", "TabulatedModulus"]
    assert list(kinds(rf.SelfAffine)) == ["SelfAffine"]
    assert Material not in kinds(Material).values()


def test_kinds_in_errors():
    with pytest.raises(ValueError, match=r"^x is a Slab: must be Rigid, Elastic, PronyShear or Tabulated"):
        check_kind("x", rf.Slab(1.0), Material, [rf.Prony])
    with pytest.raises(ValueError, match=r"^Body\.spectrum = 1: must be SelfAffine, .* or None$"):
        rf.Body(rf.Rigid(), 1)
    message = r"^Coating\.base = 1: must be Rigid, .* TabulatedModulus \(on a rigid base use Slab\)$"
    with pytest.raises(ValueError, match=message):
        rf.Coating(1e-3, 1)
    check_kind("x", rf.SelfAffine(1, 2, 3, 0.8, 1.0), Spectrum)


@pytest.mark.parametrize(
    ("cls", "kind"),
    [(rf.PronyShear, "prony_shear"), (rf.WLF, "wlf"), (rf.TabulatedModulus, "tabulated"), (rf.Slab, "slab")],
)
def test_names_in_files(cls, kind):
    assert cls.file_kind == kind
