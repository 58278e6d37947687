"""What follows from viewers' reports of the pictures they show, and what does not."""

from dataclasses import replace

import pytest

from gateway.status.pictures import (
    LONGEST_OF_LINK_MS,
    MAX_VIEWERS,
    NO_PICTURES,
    REPORT_COUNTS_S,
    Delivery,
    PictureReport,
    PictureReports,
    Pictures,
)

REPORT = PictureReport(140, 2, 21, 2.5, 300, 4, Delivery.DIRECT)
AT_S = 1000.0


def direct(viewer_count: int, worst_age_ms: int, link_age_ms: int | None) -> Pictures:
    """What so many reports like REPORT come to."""
    return Pictures(viewer_count, worst_age_ms, link_age_ms, direct_count=viewer_count, most_given_up=4)


@pytest.fixture
def reports() -> PictureReports:
    return PictureReports()


def test_without_reports_nothing_is_known(reports: PictureReports) -> None:
    assert reports.counting(AT_S) == NO_PICTURES == Pictures(0, None, None, 0, 0, None)


def test_the_oldest_picture_counts(reports: PictureReports) -> None:
    reports.take("anna", "", replace(REPORT, age_ms=90), AT_S)
    reports.take("ben", "", replace(REPORT, age_ms=200, error_ms=80), AT_S)
    assert reports.counting(AT_S) == direct(2, 200, 120)


def test_a_viewers_newest_report_replaces_its_last_one(reports: PictureReports) -> None:
    reports.take("anna", "left", replace(REPORT, age_ms=900), AT_S)
    reports.take("anna", "left", replace(REPORT, age_ms=90), AT_S + 1)
    assert reports.counting(AT_S + 1) == direct(1, 90, 88)


def test_viewers_of_a_caller_are_distinguished_and_so_are_callers(reports: PictureReports) -> None:
    for caller, viewer_id in (("anna", "left"), ("anna", "right"), ("ben", "left")):
        reports.take(caller, viewer_id, REPORT, AT_S)
    assert reports.counting(AT_S).viewer_count == 3


def test_a_report_counts_for_a_while(reports: PictureReports) -> None:
    reports.take("anna", "", replace(REPORT, age_ms=900), AT_S)
    reports.take("ben", "", REPORT, AT_S + 1)
    assert reports.counting(AT_S + REPORT_COUNTS_S).worst_age_ms == 900
    assert reports.counting(AT_S + REPORT_COUNTS_S + 0.1) == direct(1, 140, 138)
    assert reports.counting(AT_S + REPORT_COUNTS_S + 1.1) == NO_PICTURES


def test_viewers_count_by_how_they_take_the_stream_and_the_worst_loss_is_one_viewers(
    reports: PictureReports,
) -> None:
    takes = (Delivery.DIRECT, Delivery.SRT_LATENCY, Delivery.DIRECT, None)
    for number, delivery in enumerate(takes):
        report = replace(REPORT, delivery=delivery, packets_given_up=10 * number)
        reports.take("anna", str(number), report, AT_S)
    found = reports.counting(AT_S)
    assert (found.viewer_count, found.direct_count, found.srt_latency_count) == (4, 2, 1)
    assert found.most_given_up == 30


def test_an_age_is_not_below_zero_whatever_its_error(reports: PictureReports) -> None:
    reports.take("anna", "", replace(REPORT, age_ms=10, error_ms=50), AT_S)
    assert reports.counting(AT_S).link_age_ms == 0


def test_what_waits_on_the_viewers_computer_is_not_of_the_link(reports: PictureReports) -> None:
    reports.take("anna", "", replace(REPORT, age_ms=900, link_age_ms=30), AT_S)
    assert reports.counting(AT_S) == direct(1, 900, 28)
    reports.take("anna", "", replace(REPORT, age_ms=LONGEST_OF_LINK_MS + 1, link_age_ms=30), AT_S)
    assert reports.counting(AT_S).link_age_ms == 28
    reports.take("anna", "", replace(REPORT, age_ms=900, link_age_ms=LONGEST_OF_LINK_MS + 1), AT_S)
    assert reports.counting(AT_S).link_age_ms is None


def test_an_age_that_no_link_causes_is_shown_and_goes_no_further(reports: PictureReports) -> None:
    reports.take("anna", "", replace(REPORT, age_ms=LONGEST_OF_LINK_MS + 1), AT_S)
    assert reports.counting(AT_S) == direct(1, LONGEST_OF_LINK_MS + 1, None)
    reports.take("ben", "", REPORT, AT_S)
    assert reports.counting(AT_S).link_age_ms == 138


def test_a_flood_of_names_is_bounded_and_displaces_none_for_long(reports: PictureReports) -> None:
    reports.take("anna", "", replace(REPORT, age_ms=900), AT_S)
    for number in range(10 * MAX_VIEWERS):
        reports.take("mallory", str(number), REPORT, AT_S)
    assert reports.counting(AT_S).viewer_count == MAX_VIEWERS
    reports.take("anna", "", replace(REPORT, age_ms=900), AT_S + 0.5)
    assert reports.counting(AT_S + 0.5) == direct(MAX_VIEWERS, 900, 898)
