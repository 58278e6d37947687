"""Qt takes a text that looks like markup for markup: no text of a robot may reach where it does."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FILES = sorted((ROOT / "console").rglob("*.py"))
TIPS = {"setToolTip", "setStatusTip", "setWhatsThis"}
"""Of widgets, actions and items: Qt.mightBeRichText decides."""
TIP_ROLES = {"ToolTipRole", "StatusTipRole", "WhatsThisRole"}
ALWAYS = {"setHtml", "insertHtml", "showText", "setInformativeText", "setDetailedText"}
"""Take markup, or decide as tips do, and nothing here needs them."""
LABELS = {"QLabel", "QMessageBox", "QErrorMessage"}
"""Decide as tips do unless their text format is set; PlainLabel is what to use."""
OWN_FORMAT = "setTextFormat"


def is_safe(text: ast.expr) -> bool:
    """Whether a text is written in the program, or was made plain there."""
    return isinstance(text, ast.Constant) or (isinstance(text, ast.Call) and name_of(text) == "plain_tip")


def attributes_in(call: ast.Call) -> set[str]:
    return {each.attr for each in ast.walk(call) if isinstance(each, ast.Attribute)}


def name_of(call: ast.Call) -> str:
    return getattr(call.func, "attr", getattr(call.func, "id", ""))


def unsafe(source: str) -> list[int]:
    """The lines of a file that may show a text as markup."""
    calls = [each for each in ast.walk(ast.parse(source)) if isinstance(each, ast.Call)]
    plain = any(name_of(each) == OWN_FORMAT and "PlainText" in attributes_in(each) for each in calls)
    return [
        each.lineno
        for each in calls
        if (name_of(each) in TIPS and not all(map(is_safe, each.args)))
        or (name_of(each) in ALWAYS)
        or (name_of(each) in LABELS and not plain)
        or (TIP_ROLES & attributes_in(each) and name_of(each).startswith("set") and not _has_safe_text(each))
    ]


def _has_safe_text(call: ast.Call) -> bool:
    return any(isinstance(each, ast.Call) and is_safe(each) for each in call.args)


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(ROOT)))
def test_no_text_of_a_robot_is_markup(file: Path) -> None:
    """`set_tool_tip`, `plain_tip` and `PlainLabel` of console/window/labels.py show a text as it is."""
    assert unsafe(file.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "line",
    [
        "action.setToolTip(camera.error)",
        "box.setItemData(0, each.meaning, Qt.ItemDataRole.ToolTipRole)",
        "item.setData(Qt.ItemDataRole.ToolTipRole, text)",
        "widget.setWhatsThis(f'{text}')",
        "label = QLabel(text)",
        "QToolTip.showText(where, text)",
    ],
)
def test_it_finds_new_ones(line: str) -> None:
    assert unsafe(line) == [1]


@pytest.mark.parametrize(
    "line",
    [
        "widget.setToolTip('Key R')",
        "widget.setToolTip(plain_tip(text))",
        "box.setItemData(0, plain_tip(each.meaning), Qt.ItemDataRole.ToolTipRole)",
        "item.setData(Qt.ItemDataRole.UserRole, text)",
        "label.setText(text)",
    ],
)
def test_and_nothing_else(line: str) -> None:
    assert unsafe(line) == []
