"""Diagnostics come in pieces: each message is about some components, and the newest of each counts."""

from hypothesis import given
from hypothesis import strategies as st

from gateway.status.values import MAX_COMPONENTS, DiagnosticItem, DiagnosticLevel, Diagnostics


def said(*items: tuple[str, str]) -> Diagnostics:
    return Diagnostics(tuple(DiagnosticItem(name, DiagnosticLevel.OK, text) for name, text in items))


def test_a_message_changes_only_what_it_names() -> None:
    known = said(("drive", "a"), ("arm", "b")).merged(said(("drive", "c")))
    assert {item.component: item.message for item in known.items} == {"drive": "c", "arm": "b"}


def test_a_component_named_twice_has_the_later_word() -> None:
    assert said().merged(said(("drive", "a"), ("drive", "b"))) == said(("drive", "b"))


def test_too_many_components_forget_those_who_are_silent_longest() -> None:
    known = said(*((str(number), "") for number in range(MAX_COMPONENTS)))
    known = known.merged(said(("0", "still here"), ("new", "")))
    names = [item.component for item in known.items]
    assert len(names) == MAX_COMPONENTS
    assert names[-2:] == ["0", "new"]
    assert "1" not in names


@given(
    st.lists(
        st.lists(st.tuples(st.sampled_from("abcdef"), st.text(max_size=2)), max_size=4).map(
            lambda i: said(*i)
        ),
        max_size=10,
    )
)
def test_the_last_word_of_each_is_kept_whatever_comes(messages: list[Diagnostics]) -> None:
    known = said()
    model: dict[str, DiagnosticItem] = {}
    for message in messages:
        known = known.merged(message)
        model |= {item.component: item for item in message.items}
    assert {item.component: item for item in known.items} == model
    assert len(known.items) == len(model)
