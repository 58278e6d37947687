"""JetStream at the hub: its streams and buckets, and waiting for the leaders that the nodes elect."""
