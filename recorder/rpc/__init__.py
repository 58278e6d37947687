"""gRPC interface for the gateway: RecorderService, and the mapping between messages and domain values."""
