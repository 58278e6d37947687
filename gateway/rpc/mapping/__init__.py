"""Between the domain and the contract; nothing else in the gateway knows the contract's messages."""
