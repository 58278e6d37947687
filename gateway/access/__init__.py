"""Who may do what: roles, credentials, what happens to those who guess, and the record of what was done."""
