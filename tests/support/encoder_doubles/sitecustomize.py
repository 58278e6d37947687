"""Python reads this at its start when this directory is on PYTHONPATH: the processes under test get doubles.

So neither the service nor its trials know anything of doubles, and both meet the same ones.
"""

from tests.support import camera_doubles
from tests.support.encoder_doubles import doubles

doubles.register_from_environment()
camera_doubles.register_from_environment()
