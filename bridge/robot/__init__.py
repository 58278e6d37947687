"""The robot as its gateway shows it: an ordinary client, which takes messages as they are on the wire."""
