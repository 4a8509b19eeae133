"""What a terminal would obey is escaped; everything else stays as it is."""

import unicodedata

from hypothesis import given
from hypothesis import strategies as st

from pushplan.util.printable import printable

BIDIRECTIONAL = {"LRE", "RLE", "LRO", "RLO", "PDF", "LRI", "RLI", "FSI", "PDI"}


@given(st.text())
def test_nothing_that_controls_is_left(text: str) -> None:
    for character in printable(text):
        assert unicodedata.category(character) not in ("Cc", "Cs", "Zl", "Zp")
        assert unicodedata.bidirectional(character) not in BIDIRECTIONAL


@given(st.text(st.characters(codec="ascii", categories=("L", "N", "P", "S", "Zs"))))
def test_what_people_write_stays(text: str) -> None:
    assert printable(text) == text


def test_breaks_of_lines_may_be_kept() -> None:
    assert printable("a\n\tb\r", keep="\n\t") == "a\n\tb\\r"
