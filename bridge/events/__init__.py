"""Events of the gateway on their way to the hub: their values, and their form in the fleet's schema."""
