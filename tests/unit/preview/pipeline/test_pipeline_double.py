"""The double of a pipeline behaves as the real one."""

from preview.pipeline.events import PipelineEvents
from preview.pipeline.plan import Plan
from tests.support.pipeline_contract import PipelineContract
from tests.support.pipeline_double import PipelineDouble


class TestPipelineDouble(PipelineContract):
    def build(self, plan: Plan, events: PipelineEvents) -> PipelineDouble:
        return PipelineDouble(plan, events)
