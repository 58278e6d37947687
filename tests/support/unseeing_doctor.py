"""`python -m tests.support.unseeing_doctor doctor ...`: robot-drive's doctor without its look at the graph.

For tests of its pulse, which discovers the graph itself: the look takes three seconds and more before that.
"""

from unittest.mock import patch

from drive.cli import main
from drive.doctor.facts import GraphFacts

if __name__ == "__main__":
    with patch("drive.doctor.graph.look", return_value=GraphFacts()):
        main()
