"""Where the pictures come from: as the command line says it, and as the configuration does."""

from pathlib import Path

from common.errors import ExitCode, UserError

Source = dict[str, str]


def parse_source(text: str, directory: Path) -> Source:
    """The `source` section of the preview's configuration.

    Args:
        text: test, file:PATH, v4l2:DEVICE or gst:DESCRIPTION.
        directory: what a relative path refers to.

    Raises:
        UserError: none of these, or the file can't be read.
    """
    kind, _, rest = text.partition(":")
    match kind, bool(rest):
        case "test", False:
            return {"kind": "test"}
        case "file", True:
            return {"kind": "file", "path": str(_readable((directory / Path(rest).expanduser()).resolve()))}
        case "v4l2", True:
            return {"kind": "v4l2", "device": rest}
        case "gst", True:
            return {"kind": "gst", "description": rest}
        case _:
            raise UserError(
                f"--source '{text}' is not known",
                "Write test, file:PATH, v4l2:DEVICE or gst:DESCRIPTION",
                exit_code=ExitCode.USAGE,
            )


def _readable(path: Path) -> Path:
    try:
        with path.open("rb"):
            return path
    except OSError as error:
        raise UserError(f"{path} can't be read: {error.strerror}", exit_code=ExitCode.USAGE) from error
