"""Button with the robot's name; its menu lists the robots to switch to, and those found while it is open."""

from functools import partial

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QMenu, QToolButton

from console.robots.roster import RobotChoice, Roster
from console.window.handover import ThreadHandover
from console.window.labels import set_text, set_tool_tip

_WIDEST_PX = 180


class RobotSwitcher(QToolButton):
    """Shows which robot the window is for.

    Args:
        roster: lists the robots, anew each time the menu opens.
        target: of the robot that is shown.
    """

    chosen = Signal(object)
    """Another robot was chosen; with the RobotChoice."""

    def __init__(self, roster: Roster, target: str) -> None:
        super().__init__()
        self.setText("robot")
        self._roster = roster
        self._target = target
        self._name = "robot"
        self.robots = QMenu(self)
        self._found = ThreadHandover(self)
        self._found.delivered.connect(self.fill)
        self.robots.aboutToShow.connect(self._open)
        self.robots.aboutToHide.connect(self.end_search)
        self.setMenu(self.robots)
        self.setAutoRaise(True)
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMaximumWidth(_WIDEST_PX)
        font = self.font()
        font.setBold(True)
        font.setPointSizeF(font.pointSizeF() * 1.15)
        self.setFont(font)

    def show_name(self, name: str) -> None:
        """Shows the robot's own name."""
        if name == self._name:
            return
        self._name = name
        room = _WIDEST_PX - 3 * self.fontMetrics().height()
        shown = self.fontMetrics().elidedText(name, Qt.TextElideMode.ElideRight, room)
        set_text(self, _literal(shown))
        set_tool_tip(self, f"{name}: other robots (Ctrl+R)")
        self.setAccessibleName(f"Robot {name}, choose another one")

    def fill(self) -> None:
        """Lists the robots of this moment; what the keys or the mouse point at stays."""
        pointed = self.robots.activeAction()
        text = pointed.text() if pointed else ""
        self.robots.clear()
        choices, search = self._roster.choices(), self._roster.search
        for choice in choices:
            self._add_choice(choice)
        for error in filter(None, (self._roster.error, search.error)):
            self._add_line(str(error))
        if search.is_open and not search.error:
            self._add_line("Searching the network ...")
        elif not choices:
            self._add_line("No other robot. Type: robotctl robots add NAME HOST:PORT")
        for action in self.robots.actions():
            if text and action.text() == text:
                self.robots.setActiveAction(action)

    def end_search(self) -> None:
        """Ends the search for robots, as when the menu is closed."""
        self._roster.search.end()

    def _open(self) -> None:
        self._roster.search.begin(self._found.post)
        self.fill()

    def _add_choice(self, choice: RobotChoice) -> None:
        needs_login = ", needs a login" if choice.login_command else ""
        where = choice.target if choice.known else f"{choice.target}, found on the network{needs_login}"
        action = self.robots.addAction(_literal(f"{choice.name}  ({where})"))
        action.setCheckable(True)
        action.setChecked(choice.target == self._target)
        action.triggered.connect(partial(self._choose, choice))

    def _add_line(self, text: str) -> None:
        self.robots.addAction(_literal(text)).setEnabled(False)

    def _choose(self, choice: RobotChoice, _checked: bool = False) -> None:
        if choice.target != self._target:
            self.chosen.emit(choice)


def _literal(text: str) -> str:
    """Returns a text for a button or a menu, which take & for the mark of a mnemonic."""
    return text.replace("&", "&&")
