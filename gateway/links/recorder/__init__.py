"""The link to the recorder, which owns its state: nothing is reconciled, only watched and passed on."""
