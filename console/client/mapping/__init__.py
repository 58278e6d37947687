"""The contract's messages to results and back: the only place of the operator's side that knows protobuf."""
