"""Writes images as one archive that `docker load` reads: the same bytes for the same images.

`docker save` writes several images in no fixed order, and in a format of its release. `scripts/images` runs
this.
"""
