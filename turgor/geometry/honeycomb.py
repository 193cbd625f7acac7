"""The pneumatic honeycomb network: columns and rows of flat hexagonal cells with walls of one thickness."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np
from typing_extensions import override

from turgor.common.errors import InputError
from turgor.common.units import NonNegativeLength, PositiveLength
from turgor.geometry import cad
from turgor.geometry.actuator import Actuator, FloatArray, Shape, parameter
from turgor.geometry.drawing import AIR, OUTSIDE, Distance, Mark, Pointer, View, along, rectangle
from turgor.geometry.path import Piece, polygon, rounded_polygon
from turgor.geometry.section import PlaneSection

_PAPER = "Design and Analysis of a Hyperelastic Pneumatic Honeycomb Network Made of Ecoflex 00-35, section 3.1"
_ASSUMED = "assumed"

Corners = list[tuple[float, float]]


class Honeycomb(Actuator):
    """Hexagonal cells in the plane of x and z, closed by end walls along y; middle plane y = 0, bottom z = 0.

    Cells of a column share the walls between them; neighbouring columns meet at the corners of their cells. The rooms
    between four cells are open to the outside.

    A plate may lie on top, of a stiffer material, so that the columns end in one rigid body as in the paper. It reaches
    from the first to the last flat and down to the middle of their walls: there it meets the slanted ones at an angle.

    Regions ``body`` and ``plate``; surfaces ``mount`` (the flats at the bottom), ``tip-face`` (those on top, or the
    plate's top), ``cavity-1``, ``cavity-2``, … (all cells of the first, second, … column along x, which share one
    pressure), ``outer`` and, of the half model, ``symmetry``; markers ``base`` and ``tip`` (middle of the middle
    column at the bottom and on top, y = 0).
    """

    template: ClassVar[str] = "honeycomb"

    columns: int = parameter(3, "number of cells along x", _PAPER, ge=1, le=20)
    rows: int = parameter(3, "number of cells along z", _PAPER, ge=1, le=20)
    web_length: PositiveLength = parameter(
        "30 mm", "flat of a cell along x, between corners of its middle line", f"{_PAPER}: L1"
    )
    cell_width: PositiveLength = parameter(
        "55 mm", "cell along x from corner to corner of its middle line", f"{_PAPER}: Lges"
    )
    cell_height: PositiveLength = parameter("10 mm", "distance between the flats' middles", f"{_PAPER}: H")
    thickness: PositiveLength = parameter("1 mm", "thickness of all walls in the plane", f"{_PAPER}: d")
    rounding: PositiveLength = parameter("0.5 mm", "radius of all corners", f"{_PAPER} ties it to d; half of d assumed")
    depth: PositiveLength = parameter("20 mm", "extent along y, end walls included", _ASSUMED)
    end_wall: PositiveLength = parameter("1 mm", "thickness of the walls that close the cells along y", _ASSUMED)
    plate: NonNegativeLength = parameter(
        "0 mm", "thickness of a plate above the flats on top, region 'plate'; 0: none", _ASSUMED
    )
    model: Literal["full", "half", "plane"] = parameter(
        "full",
        "the whole, the half y ≥ 0 with the surface 'symmetry', or the section in the plane of x and z",
        _ASSUMED,
    )

    @property
    @override
    def per_circle(self) -> int:
        # Roundings of a millimetre along metres of corners: finer arcs would cost twice the elements or more. Those
        # nearly as large as the walls are thick are seen in the volumes: 1 % of a small network's air.
        return 3 if self.rounding <= 0.75 * self.thickness else 6

    @property
    def section(self) -> PlaneSection | None:
        """A slice as thick as the depth, in plane strain; None for the whole and the half."""
        return PlaneSection("plane-strain", self.depth) if self.model == "plane" else None

    @property
    def default_size(self) -> float:
        """One flat element through the walls, twice as long as thick; two in the section, where they cost little."""
        if self.model == "plane":
            return float(0.5 * self.thickness)
        return float(2.0 * min(self.thickness, self.end_wall))

    @property
    def height(self) -> float:
        """Height of the network in mm, without a plate on top."""
        return float(self.rows * self.cell_height + self.thickness)

    @property
    def _shoulder(self) -> float:
        """Extent along x of the slanted part at either end of a cell."""
        return float(0.5 * (self.cell_width - self.web_length))

    def check(self) -> None:
        """Raise InputError if the flats are longer than the cells, or walls or roundings leave no room."""
        if self.web_length >= self.cell_width:
            limit, value = f"less than {self.cell_width:g} mm", f"{self.web_length:g} mm"
            raise InputError("the flat is longer than its cell", key="web_length", value=value, expected=limit)
        if 2 * self.end_wall >= self.depth:
            limit, value = f"less than {self.depth / 2:g} mm", f"{self.end_wall:g} mm"
            raise InputError("the end walls meet: no cavity is left", key="end_wall", value=value, expected=limit)
        for radius, key in ((0.0, "thickness"), (self.rounding, "rounding")):
            try:
                for corners, inset in self._outlines():
                    rounded_polygon(corners, inset, radius)
            except InputError as error:
                raise InputError(error.problem, key=key, value=f"{getattr(self, key):g} mm", expected="less") from None

    def _outlines(self) -> list[tuple[Corners, float]]:
        """Return middle lines and insets of the outside, one cell and one room between four cells."""
        half = 0.5 * self.thickness
        return [(self._outside(), -half), (self._cell(0, 0), half), (self._room(1, 1), half)]

    def _cell(self, column: int, row: int) -> Corners:
        left, bottom = column * self.cell_width, 0.5 * self.thickness + row * self.cell_height
        x = (left, left + self._shoulder, left + self._shoulder + self.web_length, left + self.cell_width)
        z = (bottom, bottom + 0.5 * self.cell_height, bottom + self.cell_height)
        return [(x[0], z[1]), (x[1], z[0]), (x[2], z[0]), (x[3], z[1]), (x[2], z[2]), (x[1], z[2])]

    def _room(self, column: int, row: int) -> Corners:
        """Return the room whose left and right neighbours are columns, lower and upper ones rows."""
        x, z = column * self.cell_width, 0.5 * self.thickness + row * self.cell_height
        across, up = self._shoulder, 0.5 * self.cell_height
        return [(x - across, z), (x, z - up), (x + across, z), (x, z + up)]

    def _outside(self) -> Corners:
        """Return the middle line of the walls around the whole network, anticlockwise from the lower left."""
        columns, rows = range(self.columns), range(self.rows)
        below = [corner for column in columns for corner in self._cell(column, 0)[1:4]]
        right = [corner for row in rows for corner in self._cell(columns[-1], row)[3:5]]
        turned = [self._cell(column, rows[-1]) for column in reversed(columns)]
        above = [corner for cell in turned for corner in (cell[4], cell[5], cell[0])]
        left = [corner for row in reversed(rows) for corner in self._cell(0, row)[:2]]
        # Each side begins where the one before ended, and the last ends where the first began.
        return [*below, *right[1:], *above[1:], *left[1:-1]]

    def views(self) -> list[View]:
        """Show the network in its plane, one cell larger, and the section along the depth."""
        outside, rooms, cells = self._contours()
        areas = [
            ("body", along(outside)),
            *((OUTSIDE, along(room)) for room in rooms),
            *((AIR, along(cell)) for cell in cells),
        ]
        height = self.height + self.plate
        middle = (self.columns // 2 + 0.5) * self.cell_width
        left, end, low, high = self._plate_box()
        plate: Mark = Pointer("plate", (end, height), 45)
        if self.plate:
            areas.append(("plate", rectangle(left, end, low, high)))
            plate = Distance("plate", (end, self.height), (end, height))
        whole = View(
            "the network in the plane of x and z",
            areas,
            [
                Pointer("columns", (left, self.height), 135),
                Pointer("rows", (0.0, 0.5 * (self.thickness + self.cell_height)), 180),
                plate,
            ],
            notes={"tip-face": (middle, 1.06 * height), "mount": (middle, -0.06 * height)},
        )
        return [whole, self._cell_view(areas), self._depth_view()]

    def _cell_view(self, areas: list[tuple[str, FloatArray]]) -> View:
        corners = self._cell(0, 0)
        low, high = corners[1][1], corners[4][1]
        web = 0.5 * (corners[1][0] + corners[2][0])
        arc = next(piece for piece in self._contours()[2][0] if piece.centre is not None)
        marks: list[Mark] = [
            Distance("web_length", (corners[1][0], low), (corners[2][0], low), -2),
            Distance("cell_width", (corners[0][0], low), (corners[3][0], low), -3),
            Distance("cell_height", (corners[3][0], low), (corners[3][0], high), -1),
            Distance("thickness", (web, high - 0.5 * self.thickness), (web, high + 0.5 * self.thickness)),
            Pointer("rounding", arc.start, 0, 2.5),
        ]
        across = self.thickness
        window = (corners[0][0] - across, corners[3][0] + across, low - across, high + across)
        middle_line = np.array([*corners, corners[0]])
        return View("the lower left cell, larger; its middle line", areas, marks, [middle_line], window=window)

    def _depth_view(self) -> View:
        half, inside, height = 0.5 * self.depth, 0.5 * self.depth - self.end_wall, self.height
        areas = [("body", rectangle(-half, half, 0.0, height))]
        if self.plate:
            areas.append(("plate", rectangle(-half, half, *self._plate_box()[2:])))
        for row in range(self.rows):
            low = row * self.cell_height + self.thickness
            areas.append((AIR, rectangle(-inside, inside, low, low + self.cell_height - self.thickness)))
        marks: list[Mark] = [
            Distance("depth", (-half, 0), (half, 0), -1),
            Distance("end_wall", (inside, height), (half, height), 1),
        ]
        return View("section across x through the middle of a column", areas, marks)

    def draw(self) -> Shape:
        """Draw the network in its plane or swept along y, with the cells as holes or closed by end walls."""
        occ = cad.occ()
        middle = (self.columns // 2 + 0.5) * self.cell_width
        ends = np.array([[middle, 0.0, 0.0], [middle, 0.0, self.height + self.plate]])
        flat = self.model == "plane"
        dimension = 2 if flat else 3
        body = [(dimension, self._section() if flat else self._solid())]
        plate = [(dimension, self._plate())] if self.plate else []
        if plate:
            body, _ = occ.cut(body, plate, removeTool=False)
        _, pieces = occ.fragment(body + plate, [(0, occ.addPoint(*end)) for end in ends])
        occ.synchronize()
        solids = [int(tag) for piece in pieces[: len(body + plate)] for _, tag in piece]
        last = len(solids) - len(plate)
        regions = {"body": solids[:last], "plate": solids[last:]}
        places = ends[:, [0, 2]] if flat else ends
        return Shape(
            regions={name: parts for name, parts in regions.items() if parts},
            surfaces=self._surfaces(solids, dimension),
            markers={"base": places[:1], "tip": places[1:]},
            dimension=dimension,
        )

    def _contours(self) -> tuple[list[Piece], list[list[Piece]], list[list[Piece]]]:
        """Return the contours of the outside, of the open rooms and of the cells."""
        half, radius, columns, rows = 0.5 * self.thickness, self.rounding, range(self.columns), range(self.rows)
        rooms = [self._room(column, row) for column in columns[1:] for row in rows[1:]]
        cells = [self._cell(column, row) for column in columns for row in rows]
        return (
            rounded_polygon(self._outside(), -half, radius),
            [rounded_polygon(room, half, radius) for room in rooms],
            [rounded_polygon(cell, half, radius) for cell in cells],
        )

    def _section(self) -> int:
        outside, rooms, cells = self._contours()
        return cad.plane_face(outside, *rooms, *cells)

    def _solid(self) -> int:
        """Sweep the outside with its open rooms along y and cut the cells out of it."""
        occ = cad.occ()
        outside, rooms, cells = self._contours()
        halved = self.model == "half"
        begin, end = (0.0 if halved else -0.5 * self.depth), 0.5 * self.depth
        solid = cad.sweep(cad.plane_face(outside, *rooms), (0, end - begin, 0))
        front, back = (begin if halved else begin + self.end_wall), end - self.end_wall
        air = [(3, cad.sweep(cad.plane_face(cell), (0, back - front, 0))) for cell in cells]
        occ.translate([(3, solid)], 0, begin, 0)
        occ.translate(air, 0, front, 0)
        (body,), _ = occ.cut([(3, solid)], air)
        return int(body[1])

    def _plate_box(self) -> tuple[float, float, float, float]:
        """Return where the plate begins and ends along x and along z."""
        first, last = self._cell(0, 0)[1][0], self._cell(self.columns - 1, 0)[2][0]
        return first, last, self.height - 0.5 * self.thickness, self.height + self.plate

    def _plate(self) -> int:
        left, right, low, high = self._plate_box()
        section = cad.plane_face(polygon([(left, low), (right, low), (right, high), (left, high)]))
        if self.model == "plane":
            return section
        begin = 0.0 if self.model == "half" else -0.5 * self.depth
        cad.occ().translate([(2, section)], 0, begin, 0)
        return cad.sweep(section, (0, 0.5 * self.depth - begin, 0))

    def _surfaces(self, solids: list[int], dimension: int) -> dict[str, list[int]]:
        faces = cad.boundary(solids, dimension)
        symmetry = cad.faces_in_plane(faces, "y", 0.0) if self.model == "half" else []
        outside, *pockets = cad.skins([face for face in faces if face not in symmetry], dimension)
        mount, tip = (cad.faces_in_plane(outside, "z", z, dimension) for z in (0.0, self.height + self.plate))
        outer = [face for face in outside if face not in mount + tip]
        columns: dict[str, list[int]] = {f"cavity-{number + 1}": [] for number in range(self.columns)}
        for pocket in pockets:
            corners = np.array([cad.bounds(dimension - 1, face) for face in pocket])
            place = 0.5 * (corners[:, 0, 0].min() + corners[:, 1, 0].max()) / self.cell_width
            # Cells are centred between two columns' borders; the open rooms of the section, which have no end faces
            # to join them to the outside, are centred on the borders.
            if abs(place - round(place)) > 0.25:
                columns[f"cavity-{int(place) + 1}"] += pocket
            else:
                outer += pocket
        named = {"mount": mount, "tip-face": tip, "outer": outer, **columns, "symmetry": symmetry}
        return {name: tags for name, tags in named.items() if tags}
