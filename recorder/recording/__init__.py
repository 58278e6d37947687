"""What is recorded, and when: the recorder, the recordings, the ring, and what callers request of them."""
