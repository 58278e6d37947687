"""Python reads this at its start when this directory is on PYTHONPATH: viewer and trials get doubles."""

from tests.support.decoder_doubles.doubles import register_from_environment

register_from_environment()
