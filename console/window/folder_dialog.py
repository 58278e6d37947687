"""Choosing a folder beside a window that goes on to work: its STOP above all."""

import os
from pathlib import Path
from stat import S_ISDIR

from PySide6.QtCore import QDir, Qt
from PySide6.QtWidgets import QDialog, QFileDialog, QGridLayout, QLineEdit, QWidget

from console.window.labels import WrappedLabel, set_text


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
        self.refusal = WrappedLabel()
        """Why the folder was not taken."""
        self.refusal.hide()
        grid = self.layout()
        assert isinstance(grid, QGridLayout), "of Qt's own dialog"  # noqa: S101  # Qt's rule
        grid.addWidget(self.refusal, grid.rowCount(), 0, 1, grid.columnCount())

    def accept(self) -> None:
        """Takes the folder, also one that does not exist: Qt would refuse that in a modal box."""
        name = self._named()
        try:
            is_folder = S_ISDIR(Path(name).stat().st_mode)
        except FileNotFoundError:
            is_folder = True
        except OSError as error:
            self._refuse(f"This folder can't be used: {error.strerror}")
            return
        if is_folder:
            self.fileSelected.emit(name)
            self.done(QDialog.DialogCode.Accepted)
        else:
            self._refuse("This is a file, not a folder")

    def _named(self) -> str:
        """Returns the folder in the field, else the one marked in the list, else the one that is listed.

        While a path is typed, Qt may mark the folder above it in the list.
        """
        # Looked for anew: a list of suggestions that goes takes PySide's object for the field along.
        (field,) = self.findChildren(QLineEdit)
        if typed := field.text():
            # Path.expanduser raises where there is no such person.
            typed = os.path.expanduser(typed)  # noqa: PTH111
            return QDir.cleanPath(self.directory().absoluteFilePath(typed))
        return next(iter(self.selectedFiles()), self.directory().absolutePath())

    def _refuse(self, why: str) -> None:
        set_text(self.refusal, f"{why}. Choose another one, or type the name of one that is to be made")
        self.refusal.show()
