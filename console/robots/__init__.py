"""Robots known by name: their addresses and credentials."""

from console.credentials import Credentials
from console.robots.choice import NotChosenError, choose
from console.robots.credentials import read_credentials
from console.robots.robots_file import Robot, RobotsFile, read_robots_file, robots_file_path
