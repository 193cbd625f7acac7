import inspect
import json

import pytest

from turgor.common.errors import InputError
from turgor.geometry.actuator import Actuator
from turgor.geometry.bellows import Bellows
from turgor.geometry.catalogue import actuator, template, templates
from turgor.geometry.fibre_tube import FibreTube
from turgor.geometry.honeycomb import Honeycomb
from turgor.geometry.membrane import Membrane
from turgor.geometry.pneunet import PneuNet
from turgor.geometry.reinforced_tube import ReinforcedTube
from turgor.geometry.section import PlaneSection
from turgor.geometry.tube import CappedTube

NAMES = list(templates())


def test_the_catalogue_finds_the_templates_of_the_package():
    assert templates()["tube"] is CappedTube
    assert templates()["pneunet"] is PneuNet
    assert sorted(NAMES) == NAMES


def test_an_unknown_template_lists_the_known_ones():
    with pytest.raises(InputError, match=r"no such template \(found 'pnuenet'\); expected one of: .*pneunet.*tube"):
        template("pnuenet")


@pytest.mark.parametrize("name", NAMES)
def test_every_parameter_is_explained(name):
    for parameter in template(name).parameters():
        assert parameter.meaning, parameter.name
        assert parameter.source, parameter.name
        assert parameter.default, parameter.name
    assert inspect.getdoc(template(name)) != inspect.getdoc(Actuator)


@pytest.mark.parametrize("name", NAMES)
def test_defaults_survive_being_written_and_read(name):
    default = actuator(name)
    assert actuator(name, **json.loads(default.model_dump_json())) == default


@pytest.mark.parametrize("name", NAMES)
def test_the_json_schema_shows_defaults_with_units(name):
    for key, entry in template(name).model_json_schema()["properties"].items():
        if entry["type"] == "string" and "enum" not in entry:
            assert str(entry["default"]).endswith((" mm", " deg", " rad", " MPa")), key


@pytest.mark.parametrize("name", NAMES)
def test_every_length_is_refused_without_unit_negative_or_absurd(name):
    lengths = [p.name for p in template(name).parameters() if p.default.endswith(" mm")]
    assert lengths
    for key in lengths:
        for value in (3.0, "3", "-1 mm", "2 kPa", "nan mm", "1e9 mm", "1e-9 mm", None, "three mm"):
            with pytest.raises(InputError, match=f"^{key}: "):
                actuator(name, **{key: value})


@pytest.mark.parametrize("name", NAMES)
def test_the_bounds_of_an_angle_are_those_that_are_enforced(name):
    for parameter in template(name).parameters():
        if parameter.default.endswith(" deg"):
            low, high = (float(end) for end in parameter.bounds.removesuffix(" deg").split(" to "))
            for angle in (low - 0.1, high + 0.1):
                with pytest.raises(InputError, match=f"^{parameter.name}: .*expected {parameter.bounds}$"):
                    actuator(name, **{parameter.name: f"{angle} deg"})
            for angle in (low, high):
                actuator(name, **{parameter.name: f"{angle} deg"})


def test_text_and_units_are_read():
    finger = PneuNet(chambers=8, wall="1.5 mm", gap="0.1 cm")
    assert (finger.chambers, finger.wall, finger.gap) == (8, 1.5, 1.0)


def test_a_changed_copy_leaves_the_first_alone():
    tube = CappedTube(wall="2 mm")
    other = tube.changed(cap="5 mm")
    assert (tube.cap, other.cap, other.wall) == (17.0, 5.0, 2.0)
    with pytest.raises(InputError, match=r"^wall: "):
        tube.changed(wall="0 mm")
    with pytest.raises(Exception, match="frozen"):
        tube.wall = 3.0


def test_an_unknown_parameter_is_named_with_the_known_ones():
    with pytest.raises(InputError, match=r"^wal: 'tube' has no such parameter; expected one of: inner_radius, wall"):
        CappedTube(wal="2 mm")


def test_several_problems_come_in_one_message():
    with pytest.raises(InputError, match=r"^wall: .*also wrong: cap"):
        CappedTube(wall="2 psi", cap=3)


IMPOSSIBLE = {
    "caps meet": (CappedTube, {"cap": "60 mm"}, "cap"),
    "no chamber": (PneuNet, {"chambers": 0}, "chambers"),
    "half a chamber": (PneuNet, {"chambers": 2.5}, "chambers"),
    "no gap": (PneuNet, {"gap": "0 mm"}, "gap"),
    "negative gap": (PneuNet, {"gap": "-1 mm"}, "gap"),
    "negative layer": (PneuNet, {"second_layer": "-1 mm"}, "second_layer"),
    "passage as high as the chamber": (PneuNet, {"tunnel_height": "13 mm"}, "tunnel_height"),
    "passage wider than the chamber": (PneuNet, {"tunnel_width": "10.5 mm"}, "tunnel_width"),
    "gaps filled": (PneuNet, {"tunnel_roof": "13 mm"}, "tunnel_roof"),
    "gaps filled but for rounding": (
        PneuNet,
        {"chamber_height": "3.688 mm", "top_wall": "1 mm", "tunnel_height": "1 mm", "tunnel_roof": "3.688 mm"},
        "tunnel_roof",
    ),
    "half circle over a low chamber": (
        PneuNet,
        {"cross_section": "half-round", "chamber_width": "27 mm"},
        "chamber_width",
    ),
    "top over the ridge": (PneuNet, {"cross_section": "triangle", "top_wall": "6 mm"}, "top_wall"),
    "passage through the slope": (PneuNet, {"cross_section": "triangle", "tunnel_width": "9 mm"}, "tunnel_width"),
    "no such section": (PneuNet, {"cross_section": "round"}, "cross_section"),
    "bend tighter than the wall": (Bellows, {"rounding": "0.6 mm"}, "rounding"),
    "flanks too flat": (Bellows, {"flank_angle": "1 deg"}, "flank_angle"),
    "roots outside the crests": (Bellows, {"root_radius": "14 mm"}, "root_radius"),
    "roots on the axis": (Bellows, {"root_radius": "1 mm"}, "root_radius"),
    "inlet wider than its mount": (Bellows, {"inlet_radius": "5 mm"}, "inlet_radius"),
    "mount wider than the bottom": (Bellows, {"mount_radius": "9 mm"}, "mount_radius"),
    "inlet wider than the chamber": (Membrane, {"inlet_diameter": "2.5 mm"}, "inlet_diameter"),
    "membrane thicker than the zone": (Membrane, {"membrane": "5 mm"}, "membrane"),
    "quarter of many segments": (Membrane, {"model": "quarter"}, "model"),
    "flat longer than the cell": (Honeycomb, {"web_length": "55 mm"}, "web_length"),
    "end walls meet": (Honeycomb, {"end_wall": "10 mm"}, "end_wall"),
    "cell walls meet": (Honeycomb, {"thickness": "9.5 mm"}, "thickness"),
    "rounding larger than the cell": (Honeycomb, {"rounding": "6 mm"}, "rounding"),
    "cavity wider than the tube": (ReinforcedTube, {"inner_diameter": "18 mm"}, "inner_diameter"),
    "no cap left": (ReinforcedTube, {"cavity_length": "115 mm"}, "cavity_length"),
    "band around the tube": (ReinforcedTube, {"band_width": "30 mm"}, "band_width"),
    "rings longer than the tube": (ReinforcedTube, {"rings": 30}, "rings"),
    "fibre caps meet": (FibreTube, {"cap": "170 mm"}, "cap"),
    "fibres longer than the tube": (FibreTube, {"fibre_length": "340 mm"}, "fibre_length"),
    "no fibre fits": (FibreTube, {"tilt": "0 deg", "fibre_length": "0.1 mm", "pitch": "50 mm"}, "fibre_length"),
    "tilt too steep": (FibreTube, {"tilt": "80 deg"}, "tilt"),
    "winding unknown": (FibreTube, {"winding": "up"}, "winding"),
    "no fibre": (FibreTube, {"fibres": 0}, "fibres"),
    "not a yes or no": (PneuNet, {"symmetric": "perhaps"}, "symmetric"),
}


@pytest.mark.parametrize(("kind", "parameters", "key"), IMPOSSIBLE.values(), ids=IMPOSSIBLE)
def test_impossible_shapes_are_refused_by_name(kind, parameters, key):
    with pytest.raises(InputError, match=f"^{key}: "):
        kind(**parameters)


def test_plane_shapes_say_what_they_stand_for():
    assert Bellows(model="axisymmetric").section == PlaneSection("axisymmetric", None)
    assert Honeycomb(model="plane", depth="12 mm").section == PlaneSection("plane-strain", 12.0)
    assert Membrane(model="plane").section == PlaneSection("plane-strain", 20.0)
    assert CappedTube(model="axisymmetric").section == PlaneSection("axisymmetric", None)
    assert Bellows(model="quarter").section is None
    assert all(actuator(name).section is None for name in NAMES)
