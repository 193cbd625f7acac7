"""Meshes in rows of the templates that are made of blocks: the same bodies and names as those that gmsh cuts."""

import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.geometry.catalogue import actuator
from turgor.mesh.cells import determinants, jacobians
from turgor.mesh.faces import boundary_faces
from turgor.mesh.generate import generate

SHORT = {"length": "60 mm", "fibre_length": "20 mm"}
SHAPES = [
    ("tube", {"model": "axisymmetric"}),
    ("tube", {"model": "quarter"}),
    ("tube", {"model": "half", "inner_radius": "2 mm", "cap": "3 mm", "length": "20 mm"}),
    ("bellows", {"model": "axisymmetric", "convolutions": 2}),
    ("bellows", {"model": "quarter", "convolutions": 1}),
    ("fibre-tube", SHORT),
]


@pytest.fixture(scope="module", params=SHAPES, ids=lambda shape: "-".join([shape[0], *map(str, shape[1].values())]))
def both(request):
    name, parameters = request.param
    shape = actuator(name, **parameters)
    kind = "quadrilaterals" if shape.section else "hexahedra"
    return generate(shape, cells=kind), generate(shape)


def test_the_body_is_the_same(both):
    rows, other = both
    assert rows.cell_type == {2: "quad9", 3: "hex27"}[rows.dimension]
    for region in other.regions:
        assert rows.volume(region) == pytest.approx(other.volume(region), rel=2e-3)
    assert rows.enclosed_volume("cavity") == pytest.approx(other.enclosed_volume("cavity"), rel=2e-3)
    for name in other.surfaces:
        assert rows.surface_area(name) == pytest.approx(other.surface_area(name), rel=2e-3), name
    for name in other.markers:
        ends = [mesh.points[mesh.marker(name)[[0, -1]]] for mesh in both]
        np.testing.assert_allclose(*ends, atol=1e-9)
    assert list(rows.curves) == list(other.curves)


def test_the_names_cover_the_skin_once(both):
    rows, _ = both
    named = np.vstack(list(rows.surfaces.values()))
    assert len(np.unique(np.sort(named, axis=1), axis=0)) == len(named) == len(boundary_faces(rows.cells))
    assert determinants(jacobians(rows.points[rows.cells], rows.cell, rows.cell.nodes)).min() > 0.0


def test_finer_rows_bring_the_volume_closer():
    shape = actuator("bellows", model="axisymmetric", convolutions=1)
    fine = generate(shape, 0.15, cells="quadrilaterals", per_circle=64).volume()
    errors = [abs(generate(shape, 5.0, cells="quadrilaterals", per_circle=n).volume() - fine) for n in (8, 16)]
    assert errors[1] < errors[0] / 8  # an arc of second order is exact to the fourth power of its length


REFUSED = [
    ("pneunet", {}, {"cells": "hexahedra"}, "cells: this shape is not made of blocks; expected tetrahedra"),
    ("tube", {}, {"cells": "quadrilaterals"}, "cells: a shape in space has no such cells"),
    ("tube", {"model": "axisymmetric"}, {"cells": "hexahedra"}, "cells: a plane shape has no such cells"),
    ("tube", {}, {"cells": "hexahedra", "sizes": {"outer": 1.0}}, "sizes: a mesh in rows has one size"),
    ("tube", {}, {"cells": "hexahedra", "size": 0.05}, "size: this element size needs about"),
]


@pytest.mark.parametrize(("name", "parameters", "how", "message"), REFUSED)
def test_what_cannot_be_in_rows_is_refused(name, parameters, how, message):
    with pytest.raises(InputError, match=message):
        generate(actuator(name, **parameters), **how)
