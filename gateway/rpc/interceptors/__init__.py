"""What every call of an operator passes; their order is one list, in gateway/rpc/server.py."""
