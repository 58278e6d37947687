"""Conversion between the domain and the contract's messages, which no other package of the gateway knows."""
