"""Access control: roles, credentials, authentication, lockout and the audit log."""
