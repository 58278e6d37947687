import json
import math

from console.client.mapping.methods import GET_SYSTEM_STATUS
from console.client.results import PreviewState
from console.presentation.json_form import json_form
from tests.support.gateway_double import healthy_status


def test_names_words_and_nulls() -> None:
    document = json_form(GET_SYSTEM_STATUS.decode(healthy_status().SerializeToString()))
    assert document["health"]["state"] == "ok"
    assert document["odometry"]["vx_mps"] == 0.5
    assert document["effective_command"]["vx_mps"] is None
    assert json.loads(json.dumps(document, allow_nan=False)) == document


def test_secrets_are_left_out() -> None:
    message = healthy_status()
    message.preview.endpoint.passphrase = "correct horse battery"
    document = json_form(GET_SYSTEM_STATUS.decode(message.SerializeToString()))
    assert "passphrase" not in document["preview"]["endpoint"]
    assert "correct horse" not in json.dumps(document)


def test_plain_values() -> None:
    assert json_form(math.nan) is None
    assert json_form(math.inf) is None
    assert json_form((PreviewState.RUNNING, 1.5)) == ["running", 1.5]
