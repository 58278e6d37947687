"""Makes what a release consists of, from one commit. `scripts/release` starts it."""
