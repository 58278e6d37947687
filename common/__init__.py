"""What every program of the project shares: configuration files, errors for people, logging, exit codes."""
