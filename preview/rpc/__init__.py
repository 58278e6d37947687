"""What the gateway speaks to: requests to domain calls, domain values to messages."""
