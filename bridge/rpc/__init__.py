"""The bridge as the gateway sees it: omniseer.bridge.v1."""
