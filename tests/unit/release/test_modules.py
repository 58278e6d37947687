"""What a distribution has: its packages, what they import, their stubs and data, and nothing else."""

from pathlib import Path

import pytest
from release_program.distributions import CLIENT, CONSOLE
from release_program.modules import closure
from release_program.packages import files_of

ROOT = Path(__file__).parents[3]


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    for path, text in {
        "tool/__init__.py": "",
        "tool/client.py": "from shared.words import WORD\n",
        "tool/window.py": "import qt\nfrom tool import client\n",
        "tool/py.typed": "",
        "shared/__init__.py": "import shared.deep\n",
        "shared/words.py": "def late():\n    import wire.v1.thing_pb2\n",
        "shared/deep/__init__.py": "",
        "shared/deep/clips/h264.units": "data",
        "shared/unused.py": "",
        "proto/python/wire/__init__.py": "",
        "proto/python/wire/v1/__init__.py": "",
        "proto/python/wire/v1/thing_pb2.py": "from tool import client\n",
        "proto/python/wire/v1/thing_pb2.pyi": "",
    }.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text, encoding="utf-8")
    return tmp_path


def installed(tree: Path, *entries: str) -> set[str]:
    return {str(file.installed) for file in closure(tree, entries)}


def test_a_module_brings_what_it_imports_late_or_early_and_nothing_else(tree: Path) -> None:
    assert installed(tree, "tool.client") == {
        "tool/__init__.py",
        "tool/client.py",
        "tool/py.typed",
        "shared/__init__.py",
        "shared/words.py",
        "shared/deep/__init__.py",
        "shared/deep/clips/h264.units",
        "wire/__init__.py",
        "wire/v1/__init__.py",
        "wire/v1/thing_pb2.py",
        "wire/v1/thing_pb2.pyi",
    }


def test_a_package_brings_everything_below_it(tree: Path) -> None:
    assert installed(tree, "tool") - installed(tree, "tool.client") == {"tool/window.py"}


def test_generated_code_is_found_where_it_is(tree: Path) -> None:
    sources = {str(file.installed): str(file.source) for file in closure(tree, ["tool.client"])}
    assert sources["wire/v1/thing_pb2.py"] == "proto/python/wire/v1/thing_pb2.py"


@pytest.mark.parametrize("entry", ["gone", "tool.gone", "tool.client.late"])
def test_an_entry_that_does_not_exist_is_refused(tree: Path, entry: str) -> None:
    with pytest.raises(LookupError, match=entry):
        closure(tree, [entry])


def test_the_client_has_no_window_no_video_and_no_command_line() -> None:
    files = {str(file.installed) for file in files_of(CLIENT, ROOT)}
    assert {"console/client/blocking.py", "console/py.typed", "common/errors.py"} <= files
    assert {"omniseer/gateway/v1/robot_gateway_pb2.py", "omniseer/gateway/v1/robot_gateway_pb2.pyi"} <= files
    banned = ("common/gst.py", "console/window/", "console/receiver/", "console/cli/", "gateway/", "fleet/")
    assert [file for file in files if file.startswith(banned)] == []


def test_the_console_adds_to_the_client_and_repeats_none_of_its_files() -> None:
    console, client = files_of(CONSOLE, ROOT), files_of(CLIENT, ROOT)
    assert not console & client
    files = {str(file.installed) for file in console}
    assert {"console/cli/app.py", "practice/cli.py", "console/receiver/clips/h264.units"} <= files
    assert [file for file in files if file.startswith(("gateway/", "preview/", "recorder/", "bridge/"))] == []
