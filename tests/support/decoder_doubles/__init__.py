"""Hardware decoders to pretend, for programs under test."""
