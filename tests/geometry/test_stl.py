"""STL files made by trimesh and numpy: bodies, cavities and caps; and ten broken ones, repaired or refused."""

import logging
import math
import struct

import ipctk
import numpy as np
import pytest
import trimesh

from turgor.common.errors import InputError
from turgor.geometry.imported.crossings import crossings
from turgor.geometry.imported.stl import StlFile
from turgor.geometry.imported.surface import BrokenSurfaceError, read_surface
from turgor.mesh.generate import generate
from turgor.mesh.quality import quality

BOTTOM = {"normal": (0, 0, -1), "nearest": ("0 mm", "0 mm", "-10 mm")}
TOP = {"normal": (0, 0, 1), "nearest": ("0 mm", "0 mm", "10 mm")}


def hollow():
    """A block of 10 × 10 × 20 mm around the origin with a ball of radius 3 mm cut out of its middle."""
    ball = trimesh.creation.icosphere(subdivisions=2, radius=3.0)
    air = ball.volume
    ball.invert()
    return trimesh.util.concatenate([trimesh.creation.box((10, 10, 20)), ball]), air


def saved(mesh, path):
    mesh.export(path)
    return str(path)


@pytest.fixture(scope="module")
def block(tmp_path_factory):
    return saved(hollow()[0], tmp_path_factory.mktemp("stl") / "block.stl")


def test_inner_shells_are_cavities_and_rules_select_faces(block):
    part = StlFile(file=block, unit="mm", mount=BOTTOM, tip_face=TOP)
    mesh = generate(part, 4.0)
    solid, air = hollow()
    assert part.default_size == pytest.approx(2.0 * solid.volume / solid.area)
    assert list(mesh.regions) == ["body"]
    assert set(mesh.surfaces) == {"mount", "tip-face", "outer", "cavity"}
    assert mesh.volume() == pytest.approx(solid.volume, rel=2e-3)
    assert mesh.enclosed_volume("cavity") == pytest.approx(air, rel=0.02)
    assert mesh.surface_area("mount") == pytest.approx(100.0)
    assert mesh.surface_area("outer") == pytest.approx(800.0)
    np.testing.assert_allclose(mesh.points[mesh.marker("tip")][0, 2], 10.0)
    assert quality(mesh).distortion.min() > 0.0


def test_the_mesh_converges_to_the_facets(block):
    _, air = hollow()
    errors = []
    for size in (4.0, 1.5):
        mesh = generate(StlFile(file=block, unit="mm", mount=BOTTOM), size)
        errors.append(abs(mesh.enclosed_volume("cavity") / air - 1.0))
        # What the cavity lacks the body has: the flat sides are exact.
        assert mesh.volume() + mesh.enclosed_volume("cavity") == pytest.approx(2000.0, rel=1e-9)
    assert errors[1] < 0.2 * errors[0]


def test_the_unit_counts(tmp_path, block):
    inches = trimesh.load_mesh(block)
    inches.apply_scale(1.0 / 25.4)
    path = saved(inches, tmp_path / "inches.stl")
    assert read_surface(path, "inch").extent[0] == pytest.approx(hollow()[0].volume, rel=1e-5)
    with pytest.raises(InputError, match="unit"):
        StlFile(file=path, mount=BOTTOM)


def test_solids_of_an_ascii_file_are_bodies_by_their_names(tmp_path):
    blocks = {"Left Jaw": trimesh.creation.box((2, 2, 2)), "Right Jaw": trimesh.creation.box((3, 2, 2))}
    blocks["Right Jaw"].apply_translation((5, 0, 0))
    text = "".join(
        trimesh.exchange.stl.export_stl_ascii(mesh).replace("solid \n", f"solid {name}\n", 1)
        for name, mesh in blocks.items()
    )
    assert text.count("solid Left Jaw") == 1
    (tmp_path / "jaws.stl").write_text(text)
    mesh = generate(StlFile(file=str(tmp_path / "jaws.stl"), unit="mm", mount={"normal": (0, 0, -1)}), 2.0)
    assert sorted(mesh.regions) == ["left-jaw", "right-jaw"]
    assert mesh.volume("left-jaw") == pytest.approx(8.0)
    assert mesh.volume("right-jaw") == pytest.approx(12.0)


def test_a_body_inside_a_cavity_is_a_body_of_its_own(tmp_path):
    inner = trimesh.creation.box((1, 1, 1))
    path = saved(trimesh.util.concatenate([hollow()[0], inner]), tmp_path / "rattle.stl")
    assert [len(body) for body in read_surface(path, "mm").bodies] == [2, 1]
    mesh = generate(StlFile(file=path, unit="mm", mount=BOTTOM), 4.0)
    assert mesh.volume("body-2") == pytest.approx(1.0)
    assert set(mesh.surfaces) == {"mount", "outer", "cavity"}


@pytest.fixture(scope="module")
def cup(tmp_path_factory):
    """A cup along z with an outer radius of 6 mm, a wall of 2 mm and a bottom of 3 mm, 20 mm high: 32 sides."""
    outline = np.array([[0, 0], [6, 0], [6, 20], [4, 20], [4, 3], [0, 3]], dtype=float)
    return saved(trimesh.creation.revolve(outline, sections=32), tmp_path_factory.mktemp("stl") / "cup.stl")


def test_a_cap_closes_an_open_cavity(cup):
    bottom = {"normal": (0, 0, -1)}
    part = StlFile(file=cup, unit="mm", mount=bottom, caps={"inlet": {"nearest": ("0 mm", "0 mm", "20 mm")}})
    mesh = generate(part, 2.0)
    polygon = 0.5 * 32 * 4.0**2 * math.sin(2.0 * math.pi / 32)
    assert mesh.enclosed_volume("cavity") == pytest.approx(17.0 * polygon, rel=2e-3)
    np.testing.assert_allclose(mesh.points[mesh.caps["inlet"], 2], 20.0)
    by_rules = {"normal": (0, 0, 1), "between": (("0 mm", "0 mm", "19 mm"), ("0 mm", "0 mm", "21 mm"))}
    narrow = {"inside": {"point": ("0 mm", "0 mm", "0 mm"), "direction": (0, 0, 1), "radius": "5 mm"}}
    again = generate(part.changed(caps={"inlet": {**by_rules, **narrow}}), 2.0)
    np.testing.assert_array_equal(again.caps["inlet"], mesh.caps["inlet"])


@pytest.mark.parametrize(
    ("rule", "message"),
    [
        ({"normal": (0, 0, 1)}, r"caps\.lid: these rules select \d+ closed rims; expected one"),
        ({"nearest": ("0 mm", "0 mm", "0 mm")}, r"caps\.lid: there is no air behind this rim"),
        ({"within": (("0 mm", "0 mm", "0 mm"), ("1 mm", "1 mm", "1 mm"))}, r"caps\.lid: nothing follows these rules"),
    ],
)
def test_caps_that_close_nothing_are_refused(cup, rule, message):
    with pytest.raises(InputError, match=message):
        generate(StlFile(file=cup, unit="mm", mount={"normal": (0, 0, -1)}, caps={"lid": rule}), 2.0)


def test_every_opening_needs_a_cap(tmp_path):
    path = saved(trimesh.creation.annulus(3, 5, 20, sections=24), tmp_path / "pipe.stl")
    ends = {name: {"nearest": ("0 mm", "0 mm", height)} for name, height in (("in", "-10 mm"), ("out", "10 mm"))}
    with pytest.raises(InputError, match=r"caps\.in: closing this opening encloses no cavity: the air has another way"):
        generate(StlFile(file=path, unit="mm", mount=BOTTOM, caps={"in": ends["in"]}), 2.5)
    mesh = generate(StlFile(file=path, unit="mm", mount=BOTTOM, caps=ends), 2.5)
    polygon = 0.5 * 24 * 3.0**2 * math.sin(2.0 * math.pi / 24)
    assert mesh.enclosed_volume("cavity") == pytest.approx(20.0 * polygon, rel=0.02)


# --- broken files -----------------------------------------------------------------------------------------------


def facets_of(mesh):
    return np.asarray(mesh.triangles, dtype="<f4")


def binary(facets, count=None):
    body = b"".join(struct.pack("<3f", 0, 0, 0) + facet.astype("<f4").tobytes() + b"\0\0" for facet in facets)
    return b"binary".ljust(80, b"\0") + struct.pack("<I", len(facets) if count is None else count) + body


def without(mesh, faces):
    return facets_of(mesh)[np.setdiff1d(np.arange(len(mesh.faces)), faces)]


def flipped(mesh):
    facets = facets_of(mesh).copy()
    facets[::7] = facets[::7, ::-1]
    return facets


def cracked(mesh):
    """Each facet moved by a little on its own, as when every one was rounded by itself."""
    facets = facets_of(mesh).astype(float)
    return facets + np.random.default_rng(1).uniform(-2e-6, 2e-6, facets.shape)


REPAIRED = {
    "small holes": (lambda body: binary(without(body, [3, 40, 90, 170])), "small holes are filled"),
    "flipped facets": (lambda body: binary(flipped(body)), "facets are turned to agree"),
    "duplicate shells": (lambda body: binary(np.vstack([facets_of(body)] * 2)), "facets that are there twice"),
    "facets without area": (
        lambda body: binary(np.vstack([facets_of(body), facets_of(body)[:3, [0, 1, 1]]])),
        "3 facets without area",
    ),
    "cracks": (lambda body: binary(cracked(body)), None),
    "inside out": (lambda body: binary(facets_of(body)[:, ::-1]), None),
    "wrong count": (lambda body: binary(facets_of(body), count=0), "counts 0 facets, the file holds"),
    "binary that says solid": (lambda body: b"solid" + binary(facets_of(body))[5:], None),
}


@pytest.mark.parametrize("fault", REPAIRED)
def test_small_faults_are_repaired_with_a_word(fault, tmp_path, caplog):
    body, air = hollow()
    write, word = REPAIRED[fault]
    (tmp_path / "part.stl").write_bytes(write(body))
    with caplog.at_level(logging.WARNING, "turgor"):
        surface = read_surface(tmp_path / "part.stl", "mm")
    if word:
        assert word in caplog.text
        assert "part.stl" in caplog.text
    else:
        assert caplog.text == ""
    assert surface.extent[0] == pytest.approx(2000.0 - air, rel=1e-3)
    assert surface.bodies == [[0, 1]]
    if fault in ("small holes", "flipped facets"):
        mesh = generate(StlFile(file=str(tmp_path / "part.stl"), unit="mm", mount=BOTTOM), 4.0)
        assert mesh.enclosed_volume("cavity") == pytest.approx(air, rel=0.05)


def test_a_small_hole_of_many_sides_is_filled(tmp_path, caplog):
    ball = trimesh.creation.icosphere(subdivisions=5, radius=3.0)
    around = np.flatnonzero((ball.faces == 100).any(axis=1))
    assert len(around) == 6
    (tmp_path / "ball.stl").write_bytes(binary(without(ball, around)))
    with caplog.at_level(logging.WARNING, "turgor"):
        surface = read_surface(tmp_path / "ball.stl", "mm")
    assert "small holes are filled: 1, facets: 4" in caplog.text
    assert surface.extent[0] == pytest.approx(ball.volume, rel=1e-3)


def crossed():
    other = trimesh.creation.box((4, 4, 4))
    other.apply_translation((5, 0, 0))
    return trimesh.util.concatenate([trimesh.creation.box((10, 10, 20)), other])


def fin():
    """Two boxes that share an edge."""
    other = trimesh.creation.box((10, 10, 20))
    other.apply_translation((10, 10, 0))
    return trimesh.util.concatenate([trimesh.creation.box((10, 10, 20)), other])


def text_of(mesh):
    return trimesh.exchange.stl.export_stl_ascii(mesh)


def shifted(mesh, by):
    return facets_of(mesh).astype(float) + by


REFUSED = {
    "self-intersection": (lambda body: binary(facets_of(crossed())), "passes through itself: .* near .* mm", True),
    "non-manifold edge": (lambda body: binary(facets_of(fin())), "1 edges belong to more than two facets", True),
    "large hole": (lambda body: binary(without(body, np.arange(20, 80))), "a hole .* mm wide near", True),
    "not a mesh": (lambda body: b"Dear Sir or Madam, please find enclosed " * 9, "this is not an STL file", False),
    "empty": (lambda body: b"", "this is not an STL file", False),
    "no facet": (lambda body: binary(facets_of(body)[:0]), "holds no facet", False),
    "truncated": (lambda body: binary(facets_of(body))[:-70], "cut short: it promises .* within facet", False),
    "truncated text": (lambda body: text_of(body)[:-90].encode(), "cut short: 'endsolid' is missing", False),
    "truncated between facets": (lambda body: binary(facets_of(body))[: 84 + 200 * 50], "the surface is open", True),
    "NaN": (lambda body: text_of(body).replace("5.0", "nan", 1).encode(), "a coordinate that is no number", False),
    "no number": (lambda body: text_of(body).replace("vertex 5", "vertex five", 1).encode(), "is no number", False),
    "huge": (lambda body: binary(shifted(body, 1e9)), "coordinates this large", False),
    "tiny": (lambda body: binary(1e-6 * facets_of(body)), "no actuator has this size", False),
    "sheet": (
        lambda body: binary(np.vstack([facets_of(body)[:2], facets_of(body)[:2, ::-1]])),
        "facets enclose nothing",
        False,
    ),
}


@pytest.mark.parametrize("fault", REFUSED)
def test_other_faults_are_refused_in_one_message(fault, tmp_path):
    write, message, drawn = REFUSED[fault]
    path = tmp_path / "part.stl"
    path.write_bytes(write(hollow()[0]))
    with pytest.raises(InputError, match=message) as caught:
        read_surface(path, "mm")
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert isinstance(caught.value, BrokenSurfaceError) == drawn
    if drawn:
        assert 0 < len(caught.value.wrong) < len(caught.value.triangles)


def test_solids_that_share_a_wall_are_refused(tmp_path):
    one, other = trimesh.creation.box((2, 2, 2)), trimesh.creation.box((2, 2, 2))
    other.apply_translation((2, 0, 0))
    (tmp_path / "pair.stl").write_text(text_of(one) + text_of(other))
    with pytest.raises(InputError, match=r"share a wall|more than two facets"):
        read_surface(tmp_path / "pair.stl", "mm")


@pytest.mark.parametrize("seed", range(6))
def test_crossings_are_those_that_the_contact_toolkit_sees(seed):
    rng = np.random.default_rng(seed)
    other = trimesh.creation.icosphere(subdivisions=1, radius=1.0)
    other.apply_translation(rng.normal(size=3) * (0.9 if seed % 2 else 1.6))
    both = trimesh.util.concatenate([trimesh.creation.icosphere(subdivisions=2, radius=1.0), other])
    points, faces = np.array(both.vertices), np.array(both.faces, dtype=np.int32)
    surface = ipctk.CollisionMesh(points, ipctk.edges(faces), faces)
    pairs, places = crossings(points, faces)
    assert (len(pairs) > 0) == ipctk.has_intersections(surface, points)
    for (one, two), place in zip(pairs, places, strict=True):
        for triangle in (one, two):
            corners = points[faces[triangle]]
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            assert abs((place - corners[0]) @ normal) < 1e-12
