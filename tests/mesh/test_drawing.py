import math

import matplotlib.image
import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.geometry.catalogue import actuator, templates
from turgor.geometry.drawing import Distance, Pointer, Turn
from turgor.mesh.drawing import save_drawing
from turgor.mesh.preview import save_preview

# What is said by the choice of the model, not by a measure.
CHOICES = {"model", "symmetric"}

OTHERS = {
    "bellows": {"convolutions": 1, "model": "axisymmetric"},
    "fibre-tube": {"tilt": "0 deg", "fibres": 3, "winding": "both"},
    "honeycomb": {"columns": 1, "rows": 1, "model": "plane", "plate": "2 mm"},
    "membrane": {"segments": 1, "model": "plane"},
    "pneunet": {"chambers": 1, "second_layer": "0 mm"},
    "reinforced-tube": {"rings": 2, "symmetric": True},
    "tube": {"model": "quarter", "wall": "1 mm"},
}
ABSENT = {
    "bellows": {"root_radius"},  # of one fold
    "fibre-tube": {"tilt"},
    "membrane": {"spacing"},
    "pneunet": {"wall", "gap", "tunnel_roof", "tunnel_height", "tunnel_width", "second_layer"},
}


def marks(shape):
    return [mark for view in shape.views() for mark in view.marks]


@pytest.mark.parametrize("name", templates())
def test_every_parameter_is_in_the_drawing(name):
    assert {mark.name for mark in marks(actuator(name))} == set(type(actuator(name)).model_fields) - CHOICES


@pytest.mark.parametrize("name", templates())
def test_what_a_variant_has_not_is_not_drawn(name):
    shape = actuator(name, **OTHERS[name])
    expected = set(type(shape).model_fields) - CHOICES - ABSENT.get(name, set())
    assert {mark.name for mark in marks(shape)} == expected


@pytest.mark.parametrize("changes", [False, True])
@pytest.mark.parametrize("name", templates())
def test_every_measure_is_as_long_as_it_says(name, changes):
    shape = actuator(name, **(OTHERS[name] if changes else {}))
    for mark in marks(shape):
        if isinstance(mark, Distance):
            assert math.dist(mark.start, mark.end) == pytest.approx(getattr(shape, mark.name)), mark.name
        elif isinstance(mark, Turn):
            assert mark.end - mark.start == pytest.approx(getattr(shape, mark.name))


@pytest.mark.parametrize("cross_section", ["square", "triangle", "half-round"])
@pytest.mark.parametrize("chambers", [1, 2, 3, 8])
def test_what_is_measured_is_seen(chambers, cross_section):
    finger = actuator("pneunet", chambers=chambers, cross_section=cross_section)
    for view in finger.views():
        left, right = view.window[:2] if view.window else (-math.inf, math.inf)
        for mark in view.marks:
            ends = [mark.start, mark.end] if isinstance(mark, Distance) else [mark.place]
            assert all(left <= x <= right for x, _ in ends), mark.name


@pytest.mark.parametrize("changes", [{}, *({"columns": n, "plate": "2 mm"} for n in (1, 2, 3)), {"columns": 1}])
def test_no_arrow_runs_through_a_word(changes):
    view = actuator("honeycomb", **changes).views()[0]
    for pointer in (mark for mark in view.marks if isinstance(mark, Pointer)):
        way = np.array([math.cos(math.radians(pointer.angle)), math.sin(math.radians(pointer.angle))])
        for place in view.notes.values():
            along, aside = np.subtract(place, pointer.place) @ np.column_stack([way, [-way[1], way[0]]])
            assert along < 0 or abs(aside) > 5.0, pointer.name


def test_a_preview_shows_the_mesh_of_a_section_too(tmp_path):
    section = actuator("tube", model="axisymmetric", length="40 mm")
    save_drawing(section, tmp_path / "drawing.png")
    save_preview(section, tmp_path / "preview.png")
    heights = [matplotlib.image.imread(tmp_path / f"{name}.png").shape[0] for name in ("drawing", "preview")]
    below = matplotlib.image.imread(tmp_path / "preview.png")[heights[0] :, :, :3]
    assert heights[1] > heights[0] + 700
    assert (below < 0.98).any(axis=-1).mean() > 0.01


def test_a_preview_that_is_too_thin_to_mesh_names_what_can_be_changed(tmp_path):
    with pytest.raises(
        InputError, match=r"^the elements of a preview.*found '0.01 mm'.*expected a thicker part"
    ) as found:
        save_preview(actuator("tube", wall="0.01 mm"), tmp_path / "tube.png")
    assert found.value.key is None


@pytest.mark.parametrize("name", ["bellows", "fibre-tube"])
def test_the_drawing_fills_its_picture(name, tmp_path):
    path = tmp_path / f"{name}.png"
    save_drawing(actuator(name, **OTHERS[name]), path)
    pixels = matplotlib.image.imread(path)[..., :3]
    inked = (pixels < 0.98).any(axis=-1)
    assert 0.03 < inked.mean() < 0.8
    # Nothing runs over the border of the picture.
    assert not np.concatenate([inked[0], inked[-1], inked[:, 0], inked[:, -1]]).any()


def test_a_drawing_is_a_png_of_a_template(tmp_path):
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(InputError, match=r"folder\.png: the picture cannot be written"):
        save_drawing(actuator("tube"), tmp_path / "folder.png")
    with pytest.raises(InputError, match=r"saved as \.png"):
        save_drawing(actuator("tube"), tmp_path / "tube.pdf")


@pytest.mark.parametrize(("tilt", "shown"), [("51 deg", "51°"), ("0.5 rad", "28.6479°"), ("0 deg", "0°")])
def test_angles_are_shown_in_degrees(tilt, shown):
    values = actuator("fibre-tube", tilt=tilt).shown()
    assert (values["tilt"], values["pitch"], values["fibres"]) == (shown, "15", "2")
