"""The card with the age over the video, by its pixels."""

import time
from dataclasses import replace

import pytest
from PySide6.QtCore import QRectF
from PySide6.QtGui import QColor, QImage, QPainter

from console.client import Offset
from console.presentation.severity_style import SeverityStyle
from console.receiver.delivery import Delivery, DeliveryChoice
from console.viewer.picture_meter import PictureMeter
from console.window.age_card import AgeCard
from console.window.theme import COLOURS
from tests.support.qt import application
from tests.unit.console.receiver.frames import frame

GROUND = QColor("#446677")
WIDTH, HEIGHT = 640, 240


pytestmark = [pytest.mark.gst, pytest.mark.usefixtures("application")]
__all__ = ["application"]


@pytest.fixture
def meter() -> PictureMeter:
    return PictureMeter(lambda: Offset(0.0, 0.0004))


def show(meter: PictureMeter, age_ms: float) -> None:
    """Shows a frame that was captured so long ago."""
    meter.shown(replace(frame(), capture_ns=time.monotonic_ns() - round(age_ms * 1e6)))


def colours(card: AgeCard) -> set[str]:
    """The colours of the image that it is painted on, after its next reading."""
    while not card.refresh():
        time.sleep(0)
    image = QImage(WIDTH, HEIGHT, QImage.Format.Format_RGB32)
    image.fill(GROUND)
    painter = QPainter(image)
    card.paint(painter, QRectF(image.rect()))
    painter.end()
    assert image.pixelColor(0, HEIGHT - 1) == GROUND
    return {image.pixelColor(x, y).name() for x in range(WIDTH) for y in range(0, HEIGHT, 4)}


@pytest.mark.parametrize(
    ("age_ms", "style"),
    [(20, SeverityStyle.GOOD), (200, SeverityStyle.WARNING), (900, SeverityStyle.BAD)],
)
def test_the_stripe_has_the_colour_of_the_age(
    meter: PictureMeter, age_ms: float, style: SeverityStyle
) -> None:
    show(meter, age_ms)
    found = colours(AgeCard(meter))
    assert COLOURS[style].name() in found
    others = {colour.name() for each, colour in COLOURS.items() if each is not style}
    assert not others & found


def test_without_an_age_there_is_no_card(meter: PictureMeter) -> None:
    card = AgeCard(meter)
    assert not any(card.refresh() for _ in range(20))
    show(meter, 20)
    assert len(colours(card)) > 1
    meter.forget()
    assert colours(card) == {GROUND.name()}


def test_round_trip_and_loss_are_shown_without_an_age() -> None:
    """Of a robot that does not report when it captures a frame."""
    delivery = Delivery(kind=DeliveryChoice.DIRECT, rtt_ms=20.0, loss_percent=1.2)
    meter = PictureMeter(lambda: None, lambda: delivery)
    meter.shown(frame())
    found = colours(AgeCard(meter))
    assert len(found) > 1
    assert not found & {colour.name() for colour in COLOURS.values()}, "no judgement of an age"


def test_it_changes_a_few_times_a_second(meter: PictureMeter) -> None:
    """Of ticks of 50 ms, each fifth."""
    card = AgeCard(meter)
    changes = []
    for number in range(20):
        show(meter, 20 + number)
        changes.append(card.refresh())
    assert sum(changes) == 4
