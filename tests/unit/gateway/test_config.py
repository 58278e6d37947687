from pathlib import Path

import pytest

from common.errors import ExitCode, UserError
from gateway.config import DEFAULT_SOURCES, GatewaySettings, load_settings

NUMBER = "{kind: number, topic: /a, type: n/msg/O, label: x"
"""A source of this kind, without its field and its end."""
TEXT = "{kind: text, topic: /a, type: n/msg/O, label: x, field: a"
DETECTIONS = "{kind: detections, topic: /a, type: n/msg/O"


def load(tmp_path: Path, text: str) -> GatewaySettings:
    path = tmp_path / "gateway.yaml"
    path.write_text(text)
    return load_settings(path)


def test_the_defaults_are_the_contracts() -> None:
    settings = load_settings(None)
    assert (settings.grpc.host, settings.grpc.port) == ("127.0.0.1", 50051)
    limits = {source.name: source.stale_after_ms for source in settings.sources}
    assert limits == {
        "odometry": 1000,
        "vision": 2000,
        "detections": 500,
        "battery": 5000,
        "diagnostics": 5000,
        "mux_input.keyboard": 500,
        "mux_input.autonomy": 500,
        "mux_input.navigation": 500,
        "effective_command": 500,
    }
    assert settings.platform.stale_after_ms == 3000
    assert {source.kind for source in DEFAULT_SOURCES if source.required} == {"odometry", "vision"}


def test_the_environment_overrides_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GATEWAY__GRPC__PORT", "50099")
    assert load(tmp_path, "grpc: {port: 50077}").grpc.port == 50099


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("grpc: {prot: 1}", "unknown key 'grpc.prot'"),
        ("grpc: {port: 99999}", "key 'grpc.port' is 99999"),
        (
            "sources: [{kind: smell, topic: /x, type: a/msg/B, stale_after_ms: 1}]",
            "key 'sources.0.kind' is 'smell', expected: one of odometry, vision, detections, battery, "
            "diagnostics, mode, position, orientation, effective_command, mux_input",
        ),
        ("sources: [{kind: compute, topic: /x, type: a/msg/B, stale_after_ms: 1}]", "sources.0.kind"),
        ("grpc: {host: 0.0.0.0}", "anyone on that network"),
        ("grpc: {host: some-name}", "anyone on that network"),
        (
            "sources: [{kind: odometry, topic: /a, type: n/msg/O, stale_after_ms: 1},"
            " {kind: odometry, topic: /b, type: n/msg/O, stale_after_ms: 1}]",
            "sources lists 'odometry' 2 times",
        ),
        (
            "sources: [{kind: mux_input, label: keyboard, topic: /a, type: n/msg/O, stale_after_ms: 1},"
            " {kind: mux_input, label: keyboard, topic: /b, type: n/msg/O, stale_after_ms: 1}]",
            "sources lists 'mux_input.keyboard' 2 times",
        ),
        (
            "sources: [{kind: mux_input, topic: /a, type: n/msg/O, stale_after_ms: 1}]",
            "sources of kind mux_input (keyboard, autonomy, navigation) and number, text (any) have a label",
        ),
        (
            "sources: [{kind: mode, label: keyboard, topic: /a, type: n/msg/O, stale_after_ms: 1}]",
            "and number, text (any) have a label",
        ),
        (
            "sources: [{kind: odometry, topic: my odom, type: nav_msgs/msg/Odometry}]",
            "expected: a topic name",
        ),
        (f"sources: [{NUMBER}}}]", "needs 'field'"),
        (
            "sources: [{kind: odometry, topic: /a, type: n/msg/O, tile: true}]",
            "has no key 'tile', which is of kind number or text",
        ),
        (f"sources: [{NUMBER}, field: a..b}}]", "expected: a field of the message"),
        (f"sources: [{NUMBER}, field: _x}}]", "expected: a field of the message"),
        (f"sources: [{NUMBER}, field: 'a[-1]'}}]", "expected: a field of the message"),
        (f"sources: [{NUMBER}, field: '{'a.' * 16}a'}}]", "expected: a field of the message"),
        (f"sources: [{NUMBER}, field: a, label: Motor 1}}]", "key 'label' is there twice"),
        ("sources: [{kind: number, topic: /a, type: n/msg/O, field: a}]", "has a label of its own"),
        (
            "sources: [{kind: number, label: A b, topic: /a, type: n/msg/O, field: a}]",
            "has a label of its own",
        ),
        (f'sources: [{NUMBER}, field: a, unit: "\\e[1m"}}]', "expected: printable text"),
        (f"sources: [{TEXT}, scale: 2}}]", "has no key 'scale'"),
        (f"sources: [{TEXT}, levels: {{jammed: bad}}}}]", "levels.jammed"),
        (
            f"sources: [{TEXT}, max_length: 3, levels: {{jammed: error}}}}]",
            "'jammed' is longer than texts may be: max_length is 3",
        ),
        (f"sources: [{TEXT}, names: {{x: jammed}}}}]", "a whole number"),
        (f"sources: [{NUMBER}, field: a, levels: {{jammed: error}}}}]", "has no key 'levels'"),
        (f"sources: [{NUMBER}, field: a, scale: 0}}]", "scale must not be 0"),
        (f"sources: [{NUMBER}, field: a, scale: .nan}}]", "a finite number"),
        (
            f"sources: [{NUMBER}, field: a, warning_above: {{raise_at: .inf, clear_at: 1}}}}]",
            "a finite number",
        ),
        (
            f"sources: [{NUMBER}, field: a, warning_above: {{raise_at: 9, clear_at: 8}},"
            " error_above: {raise_at: 9, clear_at: 8}}]",
            "error_above.raise_at must be above warning_above.raise_at",
        ),
        (
            f"sources: [{NUMBER}, field: a, error_below: {{raise_at: 5, clear_at: 8}},"
            " error_above: {raise_at: 9, clear_at: 8}}]",
            "no value is good",
        ),
        ("sources: [{kind: odometry, unit: m, topic: /a, type: n/msg/O}]", "has no key 'unit'"),
        (
            f"sources: [{DETECTIONS}, image_width_px: 65536}}]",
            "image_width_px' is 65536, expected: at most 65535",
        ),
        (f"sources: [{DETECTIONS}, image_height_px: 65536}}]", "image_height_px' is 65536"),
        (f"sources: [{', '.join(f'{NUMBER}{n}, field: a}}' for n in range(65))}]", "lists 65 generic values"),
        (f"sources: [{NUMBER}, field: a}}, {NUMBER}, field: b}}]", "sources lists 'number.x' 2 times"),
        ("sources: [{kind: odometry, topic: /a/, type: n/msg/O}]", "expected: a topic name"),
        ("sources: [{kind: odometry, topic: /a//b, type: n/msg/O}]", "expected: a topic name"),
        ("sources: [{kind: odometry, topic: /1a, type: n/msg/O}]", "expected: a topic name"),
        ("sources: [{kind: odometry, topic: /a, type: Odometry}]", "expected: a message type"),
        (
            "discovery: {advertise: true}",
            "line 1: discovery.advertise announces a gateway that no other machine reaches: grpc.host is 127",
        ),
        ("discovery: {addresses: [lab]}", "expected: addresses of this machine, [10.0.0.7] for example"),
        ("grpc:\n  port: 1\n  host: 0.0.0.0", "line 3: grpc.host is 0.0.0.0"),
        ("metrics:\n  port: 1\n  host: 0.0.0.0", "line 3: metrics.host is 0.0.0.0"),
        (
            "sources:\n- {kind: mode, topic: /a, type: n/msg/O}\n- kind: mode\n  topic: /b\n  type: n/msg/O",
            "line 3: sources lists 'mode' 2 times",
        ),
        ("- a list", "holds a list at the top level"),
        ("a: [", "is not YAML"),
    ],
)
def test_a_mistake_is_one_line_that_names_it(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(UserError) as seen:
        load(tmp_path, text)
    assert words in str(seen.value)
    assert "\n" not in str(seen.value)
    assert seen.value.exit_code is ExitCode.USAGE


@pytest.mark.parametrize("host", ["127.0.0.1", "127.3.2.1", "localhost", "::1"])
def test_the_loopback_needs_no_permission(tmp_path: Path, host: str) -> None:
    assert load(tmp_path, f"grpc: {{host: '{host}'}}").grpc.host == host


def test_exposure_can_be_accepted(tmp_path: Path) -> None:
    settings = load(tmp_path, "{grpc: {host: 0.0.0.0}, security: {insecure: true}}")
    assert settings.security.insecure


@pytest.mark.parametrize(
    "text",
    [
        "{grpc: {host: 0.0.0.0}}",
        "{grpc: {host: robot.local}}",
        "{grpc: {host: '::'}}",
        "{grpc: {host: 10.0.0.5}, security: {credentials: /c, tls: {enabled: false}}}",
        "{metrics: {host: 0.0.0.0, port: 9464}}",
        "{metrics: {host: '::', port: 0}, security: {credentials: /c}}",
        "{metrics: {host: 0.0.0.0, port: 9464}, security: {insecure: true}}",
    ],
)
def test_nothing_is_served_in_the_clear_beyond_the_loopback_unless_that_is_accepted(
    tmp_path: Path, text: str
) -> None:
    with pytest.raises(UserError) as seen:
        load(tmp_path, text)
    assert "insecure: true" in str(seen.value)
    assert seen.value.exit_code is ExitCode.USAGE


def test_no_one_drives_without_credentials_unless_that_is_accepted(tmp_path: Path) -> None:
    assert load(tmp_path, "{}").teleop.socket is None, "off by default"
    with pytest.raises(UserError, match="allow_insecure: true") as seen:
        load(tmp_path, "{teleop: {socket: /d}}")
    assert seen.value.exit_code is ExitCode.USAGE
    assert load(tmp_path, "{teleop: {socket: /d, allow_insecure: true}}").teleop.socket == Path("/d")
    assert load(tmp_path, "{teleop: {socket: /d}, security: {credentials: /c}}").teleop.enabled_at_start


@pytest.mark.parametrize(
    "text",
    [
        "{grpc: {host: 0.0.0.0}, security: {credentials: /c}}",
        "{grpc: {host: 0.0.0.0}, security: {credentials: /c, tls: {client_certificates: true}}}",
        "{grpc: {host: 127.0.0.1}, security: {credentials: /c, tls: {enabled: false}}}",
        "{metrics: {host: 0.0.0.0}}",
        "{metrics: {host: 0.0.0.0, port: 9464, insecure: true}}",
    ],
)
def test_what_is_guarded_kept_in_or_accepted_is_good(tmp_path: Path, text: str) -> None:
    assert load(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{tls: {certificate: /a, key: /b}}", "tls alone authenticates no one"),
        ("{tls: {client_certificates: true}}", "tls alone authenticates no one"),
        ("{credentials: /c, tls: {certificate: /a}}", "belong together"),
        ("{credentials: /c, tls: {enabled: false, client_certificates: true}}", "need TLS"),
    ],
)
def test_half_a_guard_is_none(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(UserError) as seen:
        load(tmp_path, f"security: {text}")
    assert words in str(seen.value)


# Who is asked for a credential, what the owner accepts and asks for; then whether the stream of a listener on
# loopback, and of one that other machines reach, is encrypted.
ENCRYPTION = [
    ("{}", False, True),
    ("{security: {insecure: true}}", False, False),
    ("{grpc: {host: 0.0.0.0}, security: {insecure: true}}", False, False),
    ("{security: {credentials: /c}}", True, True),
    ("{security: {credentials: /c, tls: {enabled: false}}}", True, True),
    ("{security: {credentials: /c, insecure: true}}", True, True),
    ("{grpc: {host: 0.0.0.0}, security: {credentials: /c}}", True, True),
    ("{preview: {encrypted: true}}", True, True),
    ("{preview: {encrypted: true}, security: {insecure: true}}", True, True),
    ("{preview: {encrypted: true}, security: {credentials: /c}}", True, True),
    ("{preview: {encrypted: false}}", False, False),
    ("{preview: {encrypted: false}, security: {insecure: true}}", False, False),
    ("{preview: {encrypted: false}, security: {credentials: /c}}", False, False),
]
LOOPBACK = ("127.0.0.1", "127.3.2.1", "::1", "[::1]", "localhost")
# An empty address is that of a service that does not report it.
REACHED = ("0.0.0.0", "::", "10.0.0.5", "fe80::1", "robot.local", "::ffff:10.0.0.5", "")  # noqa: S104  # data


@pytest.mark.parametrize(("text", "on_loopback", "beyond"), ENCRYPTION)
def test_the_video_is_encrypted_where_others_reach_it_unless_that_is_accepted(
    tmp_path: Path, text: str, on_loopback: bool, beyond: bool
) -> None:
    settings = load(tmp_path, text)
    assert {settings.encrypts_preview(address) for address in LOOPBACK} == {on_loopback}
    assert {settings.encrypts_preview(address) for address in REACHED} == {beyond}
