"""The fleet's hub: its streams, its robots, and the receiver of their recordings."""
