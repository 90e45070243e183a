"""Quantities at the text edge."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from weldsim import quantity, units
from weldsim.errors import ConfigError


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("12 mm", "m", 0.012),
        ("12mm", "m", 0.012),
        (" -1.5e1 cm ", "m", -0.15),
        (".5 in", "m", 0.0127),
        ("250 um", "m", 250e-6),
        ("45 deg", "rad", math.pi / 4),
        ("3 mrad", "rad", 0.003),
        ("8 mm/s", "m/s", 0.008),
        ("48 cm/min", "m/s", 0.008),
        ("1 deg/mm", "rad/m", math.pi / 180 * 1000),
        ("180 deg/s", "rad/s", math.pi),
        ("8 ms", "s", 0.008),
        ("2", "m", 2.0),
        (2, "m", 2.0),
        ("3 px", "px", 3.0),
        ("12 MM", "m", 0.012),
        ("2.5 millimetres", "m", 0.0025),
        ("1 foot", "m", 0.3048),
        ("250 µm", "m", 250e-6),
        ("45 degrees", "rad", math.pi / 4),
        ("90 Deg/Sec", "rad/s", math.pi / 2),
        ("12 ipm", "m/s", 12 * 0.0254 / 60),
        ("3 seconds", "s", 3.0),
        ("1,5 mm", "m", 0.0015),
        ("0,005", "m", 0.005),
    ],
)
def test_text_becomes_si(text: str | int, dimension: str, value: float) -> None:
    assert units.parse(text, dimension) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    "value",
    ["", "mm", "1 2", "1 mm 2", "12 deg", "nan", "inf m", "1e999 m", "0x10", "1_000", True, None, [1], float("nan"), math.inf],
)
def test_what_is_no_length_is_refused(value: object) -> None:
    with pytest.raises(ConfigError, match=r"seam\.width") as caught:
        units.parse(value, "m", where="seam.width")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("dimension", sorted(units.DIMENSIONS))
def test_the_example_that_a_refusal_gives_is_taken(dimension: str) -> None:
    with pytest.raises(ConfigError) as caught:
        units.parse("fish", dimension)
    example = str(caught.value).partition('with a unit, "')[2].partition('"')[0]
    assert units.parse(example, dimension) > 0


@pytest.mark.parametrize("text", ["1,500 mm", "-2,000"])
def test_a_comma_that_may_part_thousands_is_asked_back_and_both_answers_are_taken(text: str) -> None:
    with pytest.raises(ConfigError, match="write which") as caught:
        units.parse(text, "m")
    small, large = (units.parse(part, "m") for part in str(caught.value).split('"')[1:4:2])
    assert large == pytest.approx(1000 * small)


@given(st.floats(-1e6, 1e6), st.sampled_from(sorted(units.DIMENSIONS)))
def test_a_number_with_its_si_unit_is_itself(value: float, dimension: str) -> None:
    assert units.parse(f"{value!r} {dimension}", dimension) == value
    assert units.parse(value, dimension) == value


@given(st.text(max_size=12))
def test_any_text_is_a_number_or_a_config_error(text: str) -> None:
    try:
        number = units.parse(text, "m")
    except ConfigError:
        return
    assert math.isfinite(number)


def test_every_alias_names_a_dimension_that_is_read() -> None:
    aliases = [item for item in vars(quantity).values() if getattr(item, "__metadata__", None)]
    assert len(aliases) >= 7
    assert {alias.__metadata__[0] for alias in aliases} <= units.DIMENSIONS


def test_lengths_for_people() -> None:
    assert units.to_mm(units.parse("7.25 mm", "m")) == pytest.approx(7.25)
    assert units.to_deg(units.parse("30 deg", "rad")) == pytest.approx(30)
    assert units.length_scale("mm") == 1e-3
    with pytest.raises(ConfigError, match="furlong"):
        units.length_scale("furlong")
