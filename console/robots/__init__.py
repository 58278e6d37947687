"""The robots that a person knows by name: where each answers, and what proves who asks."""

from console.client import Credentials
from console.robots.book import Robot, RobotBook, book_path, read_book
from console.robots.choice import choose
from console.robots.credentials import read_credentials

__all__ = ["Credentials", "Robot", "RobotBook", "book_path", "choose", "read_book", "read_credentials"]
