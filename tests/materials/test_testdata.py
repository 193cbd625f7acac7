"""Test files as laboratories have them, and malformed ones."""

from __future__ import annotations

import numpy as np
import pytest

from turgor.common.errors import InputError
from turgor.materials.measurement import MaterialTest, Specimen
from turgor.materials.testdata import read_tests

STRETCH = np.linspace(1.0, 3.0, 21)
STRESS = 0.2 * (STRETCH - STRETCH**-2)


def write(tmp_path, text: str, name: str = "test.csv", encoding: str = "utf-8"):
    file = tmp_path / name
    file.write_bytes(text.encode(encoding))
    return file


def table(header: str, *columns, sep: str = ",", comma: bool = False, above: str = "") -> str:
    rows = [sep.join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True)]
    if comma:
        rows = [row.replace(".", ",") for row in rows]
    return above + "\n".join([header, *rows]) + "\n"


def read_one(file, **known):
    (test,) = read_tests(file, Specimen(**known))
    return test


def check(test, stretch=STRETCH, stress=STRESS, tolerance=1e-7):
    np.testing.assert_allclose(test.stretch, stretch, rtol=tolerance)
    np.testing.assert_allclose(test.stress, stress, rtol=tolerance, atol=1e-9)


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        ("strain,stress (MPa)", (STRETCH - 1, STRESS)),
        ("stretch,stress (kPa)", (STRETCH, 1e3 * STRESS)),
        ("Engineering Strain (%),Engineering Stress [psi]", (100 * (STRETCH - 1), STRESS / 0.0068947572931683625)),
        ("true strain,true stress (MPa)", (np.log(STRETCH), STRESS * STRETCH)),
        ("True Strain,Nominal stress_MPa", (np.log(STRETCH), STRESS)),
        ("strain_percent,stress_kPa", (100 * (STRETCH - 1), 1e3 * STRESS)),
        ("Nominal Strain (mm/mm),Tensile stress (N/mm²)", (STRETCH - 1, STRESS)),
        ("λ,σ (MPa)", (STRETCH, STRESS)),
        ("Zeit (s),Dehnung (%),Spannung (MPa)", (STRETCH, 100 * (STRETCH - 1), STRESS)),
    ],
)
def test_measures_and_units(tmp_path, header, columns):
    check(read_one(write(tmp_path, table(header, *columns))))


@pytest.mark.parametrize("sep", [",", ";", "\t"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
def test_separators_and_encodings(tmp_path, sep, encoding):
    text = table(f"Strain{sep}Stress (MPa)", STRETCH - 1, STRESS, sep=sep, above="Prüfer;Müller\n\n")
    check(read_one(write(tmp_path, text, encoding=encoding)))


@pytest.mark.parametrize("sep", [";", "\t"])
def test_decimal_comma(tmp_path, sep):
    check(read_one(write(tmp_path, table(f"strain{sep}stress (MPa)", STRETCH - 1, STRESS, sep=sep, comma=True))))


def test_one_comma_that_is_decimal_shows_that_all_are(tmp_path):
    lines = [f"1,{i}25;{i},{i}25" for i in range(1, 8)]
    test = read_one(write(tmp_path, "\n".join(["stretch;stress (MPa)", "1,050;0,125", *lines])))
    assert test.stretch[:2] == pytest.approx([1.05, 1.125])
    assert test.stress[:2] == pytest.approx([0.125, 1.125])


@pytest.mark.parametrize("header", ["strain;stress (MPa)", "strain;stress (MPa);;"])
def test_empty_cells_beyond_the_header_are_nothing(tmp_path, header):
    rows = table("", STRETCH - 1, STRESS, sep=";").strip().replace("\n", ";;;\n")
    check(read_one(write(tmp_path, f"{header}\n{rows}\n")))


@pytest.mark.parametrize(
    "other", ["Strain rate", "Stress rate (MPa/s)", "Stress standard deviation (MPa)", "Strain energy", "Stress error"]
)
def test_what_is_about_a_stress_or_strain_is_none(tmp_path, other):
    check(read_one(write(tmp_path, table(f"{other};Strain;Stress (MPa)", 2 * STRESS, STRETCH - 1, STRESS, sep=";"))))


def test_columns_that_are_not_needed_may_be_alike(tmp_path):
    columns = (STRETCH, STRETCH, STRETCH - 1, STRESS, STRESS * STRETCH)
    header = "Extension (mm);Position (mm);Strain;Engineering stress (MPa);True stress (MPa)"
    check(read_one(write(tmp_path, table(header, *columns, sep=";"))))


def test_units_in_a_row_of_their_own(tmp_path):
    text = table("Time,Tensile strain,Tensile stress\n(s),(%),(MPa)", STRETCH, 100 * (STRETCH - 1), STRESS)
    check(read_one(write(tmp_path, text)))


def test_force_and_displacement_with_dimensions_in_the_file(tmp_path):
    above = "Specimen Thickness (mm);3\nSpecimen Width (mm);6\nGauge length (mm);33\n"
    text = table("Extension (mm);Load (N)", 33 * (STRETCH - 1), 18 * STRESS, sep=";", above=above)
    test = read_one(write(tmp_path, text))
    check(test)
    assert test.strain_source == "crosshead"
    assert any("33 mm" in note for note in test.assumed)
    assert any("crosshead" in note for note in test.warnings)


def test_force_and_displacement_with_dimensions_given(tmp_path):
    text = table("displacement (mm),force (N)", 25 * (STRETCH - 1), 12 * STRESS)
    check(read_one(write(tmp_path, text), gauge_length=25.0, area=12.0, strain_source="video"))


@pytest.mark.parametrize("missing", ["gauge length", "cross-section"])
def test_force_and_displacement_without_dimensions(tmp_path, missing):
    text = table("displacement (mm),force (N)", 25 * (STRETCH - 1), 12 * STRESS)
    known = {"area": 12.0} if missing == "gauge length" else {"gauge_length": 25.0}
    with pytest.raises(InputError, match=missing):
        read_one(write(tmp_path, text), **known)


def test_modes_and_specimens_in_columns(tmp_path):
    lines = ["mode,specimen,stretch,stress (MPa)"]
    for mode in ("uniaxial", "pure shear"):
        for specimen in ("A", "B"):
            lines += [f"{mode},{specimen},{x},{s}" for x, s in zip(STRETCH, STRESS, strict=True)]
    tests = read_tests(write(tmp_path, "\n".join(lines)))
    assert [(test.mode, test.name) for test in tests] == [
        ("uniaxial", "A"), ("uniaxial", "B"), ("planar", "A"), ("planar", "B")
    ]  # fmt: skip


def test_simple_shear_and_volumetric(tmp_path):
    gamma = np.linspace(0, 1, 11)
    shear = read_one(write(tmp_path, table("shear strain,shear stress (kPa)", gamma, 100 * gamma)))
    assert shear.mode == "simple-shear"
    np.testing.assert_allclose(shear.stress, 0.1 * gamma, atol=1e-12)
    J = np.linspace(0.95, 1.0, 11)
    volumetric = read_one(write(tmp_path, table("volume ratio,pressure (MPa)", J, 1000 * (1 - J))))
    assert volumetric.mode == "volumetric"
    np.testing.assert_allclose(volumetric.stress, -1000 * (1 - J), atol=1e-6)


def test_true_stress_of_simple_shear_is_the_nominal_one(tmp_path):
    gamma = np.linspace(0.1, 1, 11)
    for header, columns in (
        ("shear strain,true stress (MPa)", (gamma, 0.1 * gamma)),
        ("shear strain,nominal stress (MPa),true stress (MPa)", (gamma, 0.1 * gamma, 0.1 * gamma)),
    ):
        shear = read_one(write(tmp_path, table(header, *columns)))
        np.testing.assert_allclose(shear.stress, 0.1 * gamma, rtol=1e-7)


def test_a_mode_that_contradicts_the_file_is_refused(tmp_path):
    rows = "".join(f"pure shear,0.{i},0.{i}\n" for i in range(1, 8))
    file = write(tmp_path, f"mode,strain,stress (MPa)\n{rows}")
    assert read_one(file, mode="planar").mode == "planar"
    with pytest.raises(InputError, match=r"mode: .*'pure shear' \(found 'uniaxial'\); expected 'planar'"):
        read_one(file, mode="uniaxial")


def test_lateral_strain(tmp_path):
    text = table("strain,lateral strain,stress (MPa)", STRETCH - 1, STRETCH**-0.4 - 1, STRESS)
    np.testing.assert_allclose(read_one(write(tmp_path, text)).lateral, STRETCH**-0.4, rtol=1e-6)


def test_compression(tmp_path):
    x = np.linspace(1.0, 0.5, 15)
    test = read_one(write(tmp_path, table("strain,stress (MPa)", x - 1, 0.2 * (x - x**-2))))
    assert test.stretch[0] == pytest.approx(0.5)
    assert len(test.stretch) == 15
    lines = [f"compression,{a - 1:.9g},{0.2 * (a - a**-2):.9g}" for a in x]
    # noise about zero is no tension
    named = read_one(write(tmp_path, "\n".join(["mode,strain,stress (MPa)", "compression,0.0001,0.00001", *lines])))
    assert named.stretch.min() == pytest.approx(0.5)


def dropped(test) -> dict[str, int]:
    return {part.reason: len(part.rows) for part in test.dropped}


def test_cleaning_is_listed_with_rows(tmp_path):
    strain = np.concatenate([[-0.01, 0.0], STRETCH[1:] - 1, [2.05, 2.1]])
    stress = np.concatenate([[0.001, 0.0], STRESS[1:], [0.1, 0.01]])
    strain, stress = np.insert(strain, 5, strain[4]), np.insert(stress, 5, stress[4])
    stress = stress.astype(object)
    text = table("strain,stress (MPa)", strain, stress.astype(float)).replace("0.5,", "0.5,nan #", 1).split("#")[0]
    test = read_one(write(tmp_path, table("strain,stress (MPa)", strain, stress.astype(float))))
    found = dropped(test)
    assert found["after the break"] == 2
    assert found["repeated row"] == 1
    assert found["slack: no stress, or stress against the deformation"] == 1
    assert text  # the header row is 1, so the first row of numbers is row 2
    assert next(part for part in test.dropped if part.reason.startswith("slack")).rows == (2,)


def test_missing_values_are_dropped_and_listed(tmp_path):
    lines = table("strain,stress (MPa)", STRETCH - 1, STRESS).splitlines()
    lines[4] = "0.3,NaN"
    lines[7] = "0.6,"
    test = read_one(write(tmp_path, "\n".join(lines)))
    (part,) = test.dropped
    assert (part.reason, part.rows) == ("no number", (5, 8))
    assert len(test.stretch) == 19


def test_a_row_without_lateral_strain_counts_by_its_stress(tmp_path):
    lateral = STRETCH**-0.45 - 1.0
    lines = table("strain,stress (MPa),lateral strain", STRETCH - 1, STRESS, lateral).splitlines()
    for line in (4, 7):
        lines[line] = lines[line].rsplit(",", 1)[0] + ","
    test = read_one(write(tmp_path, "\n".join(lines)))
    assert not test.dropped
    assert np.flatnonzero(np.isnan(test.lateral)).tolist() == [3, 6]
    assert any("lateral strain is missing in rows 5, 8" in note for note in test.warnings)
    assert test.has_lateral


def test_unordered_rows_are_sorted(tmp_path):
    order = np.random.default_rng(1).permutation(len(STRETCH))
    test = read_one(write(tmp_path, table("strain,stress (MPa)", (STRETCH - 1)[order], STRESS[order])))
    check(test)
    assert any("sorted" in note for note in test.warnings)


def test_unloading_is_dropped(tmp_path):
    x = np.concatenate([STRETCH, STRETCH[::-1][1:]])
    s = np.concatenate([STRESS, 0.8 * STRESS[::-1][1:]])
    test = read_one(write(tmp_path, table("strain,stress (MPa)", x - 1, s)))
    check(test)
    assert dropped(test) == {"unloading": 20}


def test_an_outlier_is_dropped_and_a_steep_end_is_not(tmp_path):
    stress = STRESS.copy()
    stress[10] *= 2.0
    assert dropped(read_one(write(tmp_path, table("strain,stress (MPa)", STRETCH - 1, stress)))) == {"outlier": 1}
    steep = STRESS + 0.01 * np.expm1(3.0 * (STRETCH - 1))
    assert not read_one(write(tmp_path, table("strain,stress (MPa)", STRETCH - 1, steep))).dropped


def test_database_files(tensile_file):
    test = read_one(tensile_file)
    assert test.mode == "uniaxial"
    assert test.strain_source == "crosshead"
    assert any("20–50 %" in warning for warning in test.warnings)
    assert test.rows_read == len(test.stretch) + sum(len(part.rows) for part in test.dropped)
    assert test.rows_read > 200
    assert np.all(np.diff(test.stretch) >= 0)


def test_stress_of_a_database_file(shared_data):
    test = read_one(shared_data / "tensile" / "Ecoflex 00-30.csv")
    assert float(np.interp(2.0, test.stretch, test.stress)) == pytest.approx(0.0297, abs=1e-4)


def test_treloar(shared_data):
    uniaxial, equibiaxial = read_tests(shared_data / "treloar.csv")
    assert (uniaxial.mode, equibiaxial.mode) == ("uniaxial", "equibiaxial")
    assert uniaxial.stress.max() == pytest.approx(6.315483)
    assert equibiaxial.stretch.max() == pytest.approx(4.45)


def test_gauge_length_and_known_modulus_give_the_same_correction(tmp_path):
    raw = read_one(write(tmp_path, table("strain,stress (MPa)", 1.4 * (STRETCH - 1), STRESS)))
    by_length = raw.with_gauge_length(20.0, 28.0)
    by_modulus = raw.with_known_modulus(float(np.interp(2.0, STRETCH, STRESS)))
    check(by_length, tolerance=1e-6)
    check(by_modulus, tolerance=1e-6)
    assert "28 mm" in by_length.corrections[0]
    assert by_modulus.as_dict()["corrections"]


def test_toe_is_reported_and_removed(tmp_path):
    x = np.linspace(1.0, 2.0, 101)
    stress = 0.2 * (x - x**-2)
    slack = 0.03
    raw = read_one(write(tmp_path, table("strain,stress (MPa)", x * (1 + slack) - 1, stress)))
    assert raw.toe == pytest.approx(slack, abs=0.005)
    assert any("meets zero stress" in warning for warning in raw.warnings)
    straight = raw.with_toe_removed()
    np.testing.assert_allclose(straight.stretch, x[1:], rtol=6e-3)
    assert abs(straight.toe) < 0.002
    assert straight.corrections
    clean = read_one(write(tmp_path, table("strain,stress (MPa)", x - 1, stress)))
    assert not any("meets zero stress" in warning for warning in clean.warnings)


def test_points_at_one_strain_have_no_toe(recwarn):
    strain = np.array([0.1] * 5 + [0.5, 0.9])
    assert MaterialTest("uniaxial", 1.0 + strain, np.arange(1.0, 8.0)).toe == 0.0
    assert not recwarn.list


def test_database_curve_has_a_toe(shared_data):
    assert 0.01 < read_one(shared_data / "tensile" / "Dragon Skin 10 MEDIUM.csv").toe < 0.04


GOOD = table("strain,stress (MPa)", STRETCH - 1, STRESS)

GERMAN = "strain;stress (MPa);stress 2 (MPa)\n" + "".join(f"0,{i};0,0{i};0,{i}\n" for i in range(1, 9))

MALFORMED = {
    "empty": ("", ["empty"]),
    "blank": ("\n \n\n", ["empty"]),
    "header only": ("strain,stress (MPa)\n", ["no rows"]),
    "no header": ("0.1,0.2\n0.2,0.3\n", ["no header"]),
    "no stress column": (table("time (s),strain", STRETCH, STRETCH), ["stress", "strain"]),
    "no strain column": (table("time (s),stress (MPa)", STRETCH, STRESS), ["strain"]),
    "no unit of stress": (table("strain,stress", STRETCH - 1, STRESS), ["stress", "unit is missing", "MPa"]),
    "wrong unit of stress": (table("strain,stress (mm)", STRETCH - 1, STRESS), ["'mm'", "MPa"]),
    "unknown unit": (table("strain,stress (furlongs)", STRETCH - 1, STRESS), ["furlongs"]),
    "wrong unit of strain": (table("strain (MPa),stress (MPa)", STRETCH - 1, STRESS), ["strain", "%"]),
    "percent without unit": (table("strain,stress (MPa)", 100 * (STRETCH - 1), STRESS), ["percent"]),
    "text in a cell": (GOOD.replace("0.5,", "abc,"), ["row 7", "abc", "'strain'"]),
    "two points in a number": (GOOD.replace("0.5,", "0.5.1,"), ["row 7", "0.5.1"]),
    "mixed decimals": ("strain;stress (MPa)\n0.1;0.2\n0,2;0,3\n0.3;0.4\n", ["decimal"]),
    "all NaN": (table("strain,stress (MPa)", STRETCH - 1, STRESS * np.nan), ["0 usable", "no number"]),
    "too few": ("strain,stress (MPa)\n0.1,0.2\n0.2,0.3\n", ["2 usable"]),
    "impossible strain": (table("strain,stress (MPa)", STRETCH - 4, STRESS), ["-100 %", "row 2"]),
    "unknown mode": ("mode,strain,stress (MPa)\n" + "torsion,0.1,0.2\n" * 6, ["torsion", "uniaxial"]),
    "contraction without its sign": (
        table("strain,stress (MPa),lateral strain", STRETCH - 1, STRESS, 1.0 - STRETCH**-0.5),
        ["widens", "row 22", "negative lateral strain"],
    ),
    "impossible lateral stretch": (
        table("strain,stress (MPa),lateral stretch", STRETCH - 1, STRESS, np.where(STRETCH > 2.0, -0.5, STRETCH**-0.5)),
        ["lateral strain of -100 %", "row 13", "above 0"],
    ),
    "contradicting strains": (
        table("strain,true strain,stress (MPa)", STRETCH - 1, STRETCH - 1, STRESS),
        ["contradict", "true strain", "row 22"],
    ),
    "contradicting stresses": (
        table("strain,engineering stress (MPa),true stress (MPa)", STRETCH - 1, STRESS, STRESS),
        ["contradict", "true stress", "row 22"],
    ),
    "decimal commas between commas": (
        table("strain,stress (MPa)", STRETCH - 0.5, STRESS + 0.5, comma=True),
        ["row 2", "4 cells under 2", "as many cells as the header", "';' or a tab"],
    ),
    "a cell beyond the header": (GOOD.replace("\n0.5,", "\n0.5,7,"), ["row 7", "3 cells under 2"]),
    "specimens side by side": (
        table("strain;stress (MPa);strain;stress (MPa)", STRETCH - 1, STRESS, STRETCH - 1, STRESS, sep=";"),
        ["columns 1 and 3", "two columns hold the strain", "'strain' and 'strain'"],
    ),
    "two stresses": (GERMAN, ["columns 2 and 3", "'stress (MPa)' and 'stress 2 (MPa)'"]),
    "one strain in all rows": (table("strain,stress (MPa)", np.full(21, 0.1), STRESS), ["'strain'", "the same", "0.1"]),
    "compression that is a tension": (
        "mode,strain,stress (MPa)\n" + "".join(f"compression,0.{i},0.{i}\n" for i in range(1, 8)),
        ["row 8", "strain of this 'compression' is positive", "negative strains and stresses (or 'uniaxial'"],
    ),
    "compression that is pressed by a tension": (
        "mode,strain,stress (MPa)\n" + "".join(f"compression,-0.{i},0.{i}\n" for i in range(1, 8)),
        ["row 8", "stress of this 'compression' is positive"],
    ),
    "shear in percent without unit": (
        "mode,strain,stress (MPa)\n" + "".join(f"simple shear,{i}0,0.{i}\n" for i in range(1, 8)),
        ["looks like percent", "'strain'"],
    ),
    "thousands or decimals": (
        "strain (%);stress (Pa)\n" + "".join(f"{i}0;{i},883\n" for i in range(1, 8)),
        ["row 2", "'stress (Pa)'", "thousands or decimals", "1883 or 1.883"],
    ),
}


@pytest.mark.parametrize("case", MALFORMED)
def test_malformed_files_give_one_clear_message(tmp_path, case):
    text, words = MALFORMED[case]
    file = write(tmp_path, text)
    with pytest.raises(InputError) as caught:
        read_tests(file)
    message = str(caught.value)
    assert "test.csv" in message
    for word in words:
        assert word in message


def test_not_a_file(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_tests(tmp_path / "absent.csv")
    with pytest.raises(InputError, match="not a file"):
        read_tests(tmp_path)


@pytest.mark.parametrize("content", [b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR", b"PK\x03\x04zip", b"strain\x00stress"])
def test_binary(tmp_path, content):
    file = tmp_path / "image.csv"
    file.write_bytes(content)
    with pytest.raises(InputError, match="not a text file"):
        read_tests(file)


@pytest.mark.parametrize(
    "known", [{"mode": "torsion"}, {"strain_source": "ruler"}, {"area": 0.0}, {"gauge_length": float("nan")}]
)
def test_wrong_options(known):
    with pytest.raises(InputError):
        Specimen(**known)
