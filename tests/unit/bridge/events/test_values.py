"""The bridge's numbers are those of the schema."""

from bridge.events.values import INFO, DropReason
from omniseer.fleet.v1.event_pb2 import DropReason as WireReason
from omniseer.gateway.v1.fault_pb2 import FAULT_SEVERITY_INFO


def test_reasons_are_those_of_the_schema() -> None:
    assert {each.value for each in DropReason} == set(WireReason.values())
    for each in DropReason:
        name = "UNSPECIFIED" if each is DropReason.UNKNOWN else each.name
        assert WireReason.Name(each.value) == f"DROP_REASON_{name}"  # type: ignore[arg-type]


def test_info_is_that_of_the_schema() -> None:
    assert INFO == FAULT_SEVERITY_INFO
