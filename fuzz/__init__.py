"""Coverage-guided fuzzing of everything that reads what somebody else wrote.

`targets` says what is tried and what may come of it; `worker` tries one target in a process of its own;
`__main__` is `scripts/fuzz`.
"""
