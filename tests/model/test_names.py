"""Names that are given once each, in work that grows with them and no faster."""

from __future__ import annotations

import pytest

from fsoe_net.model.names import Names, numbered


def test_no_name_is_there_twice() -> None:
    names = Names(["b"])
    assert [names.add(n) for n in ("a", "a", "a_2", "a", "b")] == [
        "a",
        "a_2",
        "a_2_2",
        "a_3",
        "b_2",
    ]
    assert Names(["pos", "0x6064:00"], between="-").add("pos", "0x6064:00") == "0x6064:00-2"
    assert Names(["pos"]).add("pos", "0x6064:00") == "0x6064:00"


def test_those_that_want_one_name_are_numbered_from_the_first_on() -> None:
    assert numbered(["el1904", "ek1100", "el1904"]) == ("el1904_1", "ek1100", "el1904_2")
    assert numbered(["a_1", "a", "a"]) == ("a_1", "a_1_2", "a_2")


class _Name(str):
    """A name that counts how often it is made into another one."""

    made = 0

    def __format__(self, spec: str) -> str:
        type(self).made += 1
        return super().__format__(spec)


@pytest.mark.parametrize("size", [100, 1000])
def test_each_of_many_equal_names_is_found_at_once(size: int) -> None:
    _Name.made = 0
    wanted = [_Name("Drive") for _ in range(size)]
    names = Names()
    assert len({names.add(name) for name in wanted}) == size
    assert _Name.made <= 3 * size
