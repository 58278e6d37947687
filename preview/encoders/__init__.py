"""Which encoders exist, which of them this machine really has, and which one is used."""
