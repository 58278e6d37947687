"""Text from a robot that is printed on a terminal."""

import json

import pytest

from common.printable import escaped, printable, printable_lines
from tests.support.control_characters import CONTROL_CHARACTERS


@pytest.mark.parametrize("character", CONTROL_CHARACTERS, ids=lambda character: f"U+{ord(character):04X}")
def test_a_control_character_becomes_a_space(character: str) -> None:
    assert printable(f"a{character}b") == "a b"


@pytest.mark.parametrize(
    "text",
    [
        "Gr\u00fc\u00dfe",
        "\u65e5\u672c",
        "\u0645\u0631\u062d\u0628\u0627",
        "\U0001f469\u200d\U0001f52c",
        "1\u00a0m",
    ],
)
def test_text_of_any_script_stays(text: str) -> None:
    assert printable(text) == text


def test_a_text_of_several_lines_keeps_them() -> None:
    assert printable_lines("{\n  \x1b[2J\r\n}") == "{\n   [2J \n}"


def test_json_keeps_its_meaning() -> None:
    document = {"a": CONTROL_CHARACTERS + "\u00fc"}
    text = escaped(json.dumps(document, ensure_ascii=False, indent=2))
    assert json.loads(text) == document
    assert set(text) & set(CONTROL_CHARACTERS) == {"\n"}
    assert "\u00fc" in text
