"""Code shared by all programs: configuration files, user-facing errors, logging, exit codes, gRPC servers."""
