"""What robots, the hub and the console share: names on the wire, credentials, and the connection to NATS."""
