"""Link to the preview service, which makes the video."""
