"""What is asked and explained above the panels."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from textual import on
from textual.app import ComposeResult
from textual.binding import BindingType
from textual.containers import Vertical, VerticalScroll
from textual.screen import ModalScreen
from textual.widgets import Input, Static

ARM_WORD = "arm"


class TextDialog(ModalScreen[None]):
    """Some text to be read."""

    BINDINGS: ClassVar[list[BindingType]] = [
        ("escape", "dismiss", "Close"),
        ("q", "dismiss", "Close"),
        ("enter", "dismiss", "Close"),
    ]

    def __init__(self, title: str, text: str) -> None:
        super().__init__()
        self._title, self._text = title, text

    def compose(self) -> ComposeResult:
        """The text, which scrolls."""
        with VerticalScroll(classes="dialog") as box:
            box.border_title = self._title
            box.border_subtitle = "esc closes"
            yield Static(self._text, markup=False)


class QuestionDialog(ModalScreen[str | None]):
    """A question that is answered in a line; the result is what was typed, None if it was left.

    refuse: why an answer will not do, "" if it will.
    """

    BINDINGS: ClassVar[list[BindingType]] = [("escape", "dismiss(None)", "Leave")]

    def __init__(self, title: str, question: str, refuse: Callable[[str], str]) -> None:
        super().__init__()
        self._title, self._question, self._refuse = title, question, refuse

    def compose(self) -> ComposeResult:
        """The question and a line for the answer."""
        with Vertical(classes="dialog") as box:
            box.border_title = self._title
            box.border_subtitle = "enter takes it, esc leaves"
            yield Static(self._question, markup=False)
            yield Input()
            yield Static("", id="refusal", markup=False)

    @on(Input.Submitted)
    def answered(self, event: Input.Submitted) -> None:
        """Leave with the answer, or say why not."""
        problem = self._refuse(event.value)
        if problem:
            self.query_one("#refusal", Static).update(problem)
        else:
            self.dismiss(event.value)


def arm_dialog() -> QuestionDialog:
    """Whether outputs shall really be driven."""
    return QuestionDialog(
        "Arm outputs",
        "From now on outputs can be driven and a machine may move. All are zero until you set them. They go "
        "off with w, with every fault, and however this program ends. This is not a safety device: an "
        f"emergency stop is made of relays.\n\nType `{ARM_WORD}` to go on.",
        lambda typed: "" if typed.strip().lower() == ARM_WORD else f"Only `{ARM_WORD}` arms the outputs.",
    )
