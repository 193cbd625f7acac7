import math

import matplotlib.image
import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.geometry.catalogue import actuator, templates
from turgor.geometry.drawing import Distance, Turn
from turgor.mesh.drawing import save_drawing

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
    "pneunet": {"wall", "gap", "tunnel_roof", "tunnel_height", "second_layer"},
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
    with pytest.raises(InputError, match=r"saved as \.png"):
        save_drawing(actuator("tube"), tmp_path / "tube.pdf")


@pytest.mark.parametrize(("tilt", "shown"), [("51 deg", "51°"), ("0.5 rad", "28.6479°"), ("0 deg", "0°")])
def test_angles_are_shown_in_degrees(tilt, shown):
    values = actuator("fibre-tube", tilt=tilt).shown()
    assert (values["tilt"], values["pitch"], values["fibres"]) == (shown, "15", "2")
