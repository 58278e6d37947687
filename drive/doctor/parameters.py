"""Asks other nodes for their parameters, by the services that nodes have for them (rcl_interfaces)."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import parameter_value_to_python

_ANSWER_S: Final = 2.0


class Parameters:
    """Reads parameters of nodes, named without the first slash; one that does not answer has none.

    Args:
        node: of rclpy, to ask by.
        executor: spins it meanwhile.
    """

    def __init__(self, node: Any, executor: Any) -> None:
        self._node = node
        self._executor = executor
        self._without = set[str]()
        """Services that were not there: waiting for each once is enough."""

    def names(self, of: str, groups: Sequence[str]) -> list[str]:
        """Returns the names of a node's parameters below some groups."""
        answer = self._ask(f"/{of}/list_parameters", ListParameters, ListParameters.Request(prefixes=groups))
        return list(answer.result.names) if answer else []

    def values(self, of: str, names: Sequence[str]) -> dict[str, Any]:
        """Returns these parameters of a node; none at all where it does not know one of them."""
        answer = self._ask(f"/{of}/get_parameters", GetParameters, GetParameters.Request(names=names))
        values = answer.values if answer and len(answer.values) == len(names) else ()
        return {name: parameter_value_to_python(value) for name, value in zip(names, values, strict=False)}

    def _ask(self, service: str, service_type: Any, request: Any) -> Any:
        """Returns the answer of a service; None without one."""
        if service in self._without:
            return None
        client = self._node.create_client(service_type, service)
        try:
            if not client.wait_for_service(timeout_sec=_ANSWER_S):
                self._without.add(service)
                return None
            future = client.call_async(request)
            self._executor.spin_until_future_complete(future, timeout_sec=_ANSWER_S)
            return future.result() if future.done() else None
        finally:
            self._node.destroy_client(client)


@contextmanager
def parameters_by(node: Any) -> Iterator[Parameters]:
    """Yields what asks by a node, which nothing else may spin meanwhile."""
    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    try:
        yield Parameters(node, executor)
    finally:
        executor.remove_node(node)
        executor.shutdown()
