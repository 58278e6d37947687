"""Texts of a robot that look like markup, and what Qt would make of them."""

import re
from collections.abc import Iterator

from google.protobuf.message import Message
from PySide6 import QtGui
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QComboBox, QLabel, QListWidget, QWidget

from tests.support.filled import fields_of

MARKUP = "<b>low</b><img src='x'>"
SHOWN = re.compile(r"\blow\b")
"""What is left of it where it was taken for markup."""


def mark_up(message: Message) -> None:
    """Every text that is set, or empty, becomes markup; each list of messages gets one item."""
    for field in fields_of(message):
        below = getattr(message, field.name)
        if field.message_type and field.is_repeated:
            mark_up(below.add())
        elif field.message_type:
            mark_up(below)
        elif field.type == field.TYPE_STRING and field.is_repeated:
            below.append(MARKUP)
        elif field.type == field.TYPE_STRING:
            setattr(message, field.name, MARKUP)


def shown_by_qt(tip: str) -> str:
    """What a person reads in a tool tip, in which Qt looks for markup."""
    document = QtGui.QTextDocument()
    if QtGui.Qt.mightBeRichText(tip):
        document.setHtml(tip)
    else:
        document.setPlainText(tip)
    return document.toPlainText()


def no_widget_takes_markup(window: QWidget) -> None:
    """Neither a label nor a tip of the window or below it reads MARKUP as markup."""
    widgets = [window, *window.findChildren(QWidget)]
    for label in (each for each in widgets if isinstance(each, QLabel)):
        plain = label.textFormat() is Qt.TextFormat.PlainText
        assert plain or not QtGui.Qt.mightBeRichText(label.text()), label.text()
    actions = window.findChildren(QtGui.QAction)
    shown: list[QWidget | QtGui.QAction] = [*widgets, *actions]
    for each in shown:
        for tip in (each.toolTip(), each.statusTip(), each.whatsThis(), *_tips_of_items(each)):
            assert not SHOWN.search(seen := shown_by_qt(tip)) or MARKUP in seen, tip


def _tips_of_items(widget: object) -> Iterator[str]:
    if isinstance(widget, QComboBox | QListWidget):
        model = widget.model()
        for row in range(model.rowCount()):
            yield str(model.index(row, 0).data(Qt.ItemDataRole.ToolTipRole) or "")
