"""gRPC interface for the gateway: PreviewService, and the mapping between messages and domain values."""
