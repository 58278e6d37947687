"""Link to the drive program. Beside the files of every link, commands.py passes on what can't wait."""
