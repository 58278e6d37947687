"""What is known of a call, and what the operator's side needs of the rest of the gateway."""
