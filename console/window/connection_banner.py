"""Banner over the picture while the connection is lost: the error, its remedy, and the next attempt."""

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QPushButton, QVBoxLayout

from console.monitor.link import LinkText
from console.window.labels import WrappedLabel, set_text
from console.window.layout import fill
from console.window.lines import TintedLine
from console.window.theme import DimLabel


class ConnectionBanner(TintedLine):
    """The connection's error and its remedy; hidden while connected."""

    retry = Signal()
    """The button "Retry now" was pressed."""
    acknowledged = Signal()
    """The button "Acknowledge" was pressed."""

    def __init__(self) -> None:
        super().__init__()
        self.text, self.next_try = WrappedLabel(), DimLabel()
        self.button = QPushButton("&Retry now")
        self.button.setToolTip("Key R")
        self.button.clicked.connect(self.retry)
        self.acknowledge = QPushButton("Acknowledge")
        self.acknowledge.setAccessibleName("Acknowledge: the robot does not answer")
        self.acknowledge.setToolTip("Mutes the alarm until the robot answers; A: for all")
        self.acknowledge.clicked.connect(self.acknowledged)
        self.grid.addLayout(fill(QVBoxLayout(), self.text, self.next_try), 0, 1)
        # On the left: the other button keeps its place when this one appears.
        self.grid.addWidget(self.acknowledge, 0, 2)
        self.grid.addWidget(self.button, 0, 3)
        self.grid.setColumnStretch(1, 1)
        self.setVisible(False)

    def show_pending(self, pending: bool) -> None:
        """Shows whether the loss waits for its acknowledgement."""
        self.acknowledge.setVisible(pending)

    def show_item(self, item: LinkText) -> None:
        """Shows the latest text."""
        self.setVisible(bool(item.banner))
        if item.banner:
            self.show_style(item.style)
            set_text(self.text, item.banner)
            set_text(self.next_try, item.retry)
