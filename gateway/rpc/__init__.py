"""What operators speak to: the contract, its answers and the server."""
