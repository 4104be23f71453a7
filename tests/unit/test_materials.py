"""Materials have a possible reflectance and a source, and are found by name."""

import pytest

from reconstruction.errors import InputError
from spisim.scene import Material, find_material, material_table


@pytest.mark.parametrize("name", sorted(material_table()))
def test_every_row_is_possible_and_sourced(name: str) -> None:
    material = material_table()[name]
    assert material.name == name
    assert 0 < material.reflectance < 1
    assert len(material.source) > 10


def test_every_given_range_holds_its_value() -> None:
    ranges = 0
    for material in material_table().values():
        if "median of" in material.source and "(" in material.source:
            low, high = material.source.split("(")[1].split(")")[0].split(" to ")
            assert float(low) <= material.reflectance <= float(high)
            ranges += 1
    assert ranges > 10


def test_water_darkens_at_1550_nm() -> None:
    table = material_table()
    wet = ("skin", "snow", "water", "ice")
    assert max(table[name].reflectance for name in wet) < 0.15
    assert table["snow"].reflectance < table["soil-field"].reflectance < table["brick"].reflectance


def test_a_scene_s_own_materials_come_first() -> None:
    own = Material("concrete", 0.25, "measured")
    assert find_material("concrete", {"concrete": own}) is own
    assert find_material("brick", {"concrete": own}) is material_table()["brick"]


def test_unknown_material_names_the_nearest() -> None:
    with pytest.raises(InputError, match=r"'conrete'.*did you mean 'concrete'"):
        find_material("conrete")
    with pytest.raises(InputError, match="did you mean 'my-paint'"):
        find_material("my-paimt", {"my-paint": Material("my-paint", 0.5, "measured")})
