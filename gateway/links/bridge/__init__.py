"""The link to the bridge, which owns its state: nothing is reconciled, only watched and passed on."""
