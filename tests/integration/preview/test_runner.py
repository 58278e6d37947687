"""The real pipeline passes the tests that its double passes."""

import pytest

from preview.pipeline.events import PipelineEvents
from preview.pipeline.plan import Plan
from preview.pipeline.runner import Runner
from tests.support.pipeline_contract import PipelineContract

pytestmark = pytest.mark.gst


class TestRunner(PipelineContract):
    def build(self, plan: Plan, events: PipelineEvents) -> Runner:
        return Runner(plan, events)
