"""Makes the preview follow its desired state; supervisor.py lists what follows each failure."""
