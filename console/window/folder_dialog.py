"""Choosing a folder beside a window that goes on to work: its STOP above all."""

from pathlib import Path
from stat import S_ISDIR

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QFileDialog, QGridLayout, QWidget

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
        name = next(iter(self.selectedFiles()), "")
        try:
            is_folder = S_ISDIR(Path(name).stat().st_mode)
        except FileNotFoundError:
            self.fileSelected.emit(name)
            self.done(QDialog.DialogCode.Accepted)
        except OSError as error:
            self._refuse(f"This folder can't be used: {error.strerror}")
        else:
            if is_folder:
                super().accept()
            else:
                self._refuse("This is a file, not a folder")

    def _refuse(self, why: str) -> None:
        set_text(self.refusal, f"{why}. Choose another one, or type the name of one that is to be made")
        self.refusal.show()
