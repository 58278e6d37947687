"""The text of nats.conf; that servers take it, the integration tests show."""

import pytest

from hub.accounts import CONNECTIONS
from hub.server_config import Node, Places, server_config, with_accounts

NODES = tuple(Node(f"n{number}", f"hub{number}.example") for number in (1, 2, 3))


def _config(nodes: tuple[Node, ...], *, sync_always: bool = True) -> str:
    return server_config(
        nodes[0],
        nodes,
        operator="OPERATOR",
        system_account="ASYS",
        accounts={"ASYS": "TOKEN"},
        places=Places(),
        max_store="32GB",
        sync_always=sync_always,
    )


def test_one_node_has_no_cluster() -> None:
    text = _config(NODES[:1])
    assert "cluster {" not in text
    assert "sync_interval: always" in text
    assert 'tls { cert_file: "/etc/nats/server.pem"' in text
    assert "ASYS: TOKEN" in text


def test_all_other_accounts_leave_connections_for_the_administration() -> None:
    """Any one node may be the only one that runs."""
    text = _config(NODES)
    most = int(text.partition("max_connections: ")[2].partition("\n")[0])
    assert set(CONNECTIONS) == {"robots", "people", "commanders", "receivers"}
    assert sum(CONNECTIONS.values()) <= most - 256


def test_nodes_of_a_cluster_know_each_other_by_tls() -> None:
    text = _config(NODES)
    assert all(f'"nats-route://hub{number}.example:6222"' in text for number in (1, 2, 3))
    assert "verify: true" in text


def test_an_old_server_gets_no_setting_that_it_does_not_know() -> None:
    assert "sync_interval" not in _config(NODES[:1], sync_always=False)


def test_other_tokens_change_nothing_else() -> None:
    changed = _config(NODES).replace("max_connections: 4096", "max_connections: 100")
    expected = changed.replace("ASYS: TOKEN", "ASYS: NEWER\n  AFLEET: TOKEN")
    assert with_accounts(changed, {"ASYS": "NEWER", "AFLEET": "TOKEN"}) == expected


def test_a_configuration_without_tokens_gets_none() -> None:
    with pytest.raises(ValueError, match="0 blocks resolver_preload"):
        with_accounts("port: 4222\n", {"ASYS": "TOKEN"})
