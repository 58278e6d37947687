"""The camera tap: hands the frames of ROS image topics to the preview, which has no ROS."""
