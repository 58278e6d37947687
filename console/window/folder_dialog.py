"""Choosing a folder beside a window that goes on to work: its STOP above all."""

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QFileDialog, QWidget


class FolderDialog(QFileDialog):
    """Asks for a folder, which need not exist yet. Never modal, nor is anything that it asks.

    Args:
        parent: the window that it lies over.
        title: what the folder is for.
        folder: the present one.
    """

    def __init__(self, parent: QWidget, title: str, folder: Path) -> None:
        super().__init__(parent, title, str(folder))
        # The keys of the desktop's own dialog go to another program: Space would not be STOP.
        self.setOption(QFileDialog.Option.DontUseNativeDialog)
        self.setOption(QFileDialog.Option.ShowDirsOnly)
        # Without renaming and deleting, about which Qt asks in a modal box.
        self.setOption(QFileDialog.Option.ReadOnly)
        self.setFileMode(QFileDialog.FileMode.Directory)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setModal(False)

    def accept(self) -> None:
        """Takes the folder, also one that does not exist: Qt would refuse that in a modal box."""
        name = next(iter(self.selectedFiles()), "")
        path = Path(name)
        if path.is_dir():
            super().accept()
        elif name and not path.exists():
            self.fileSelected.emit(name)
            self.done(QDialog.DialogCode.Accepted)
