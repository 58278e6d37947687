"""What a recording contains, by an independent reader: mcap's own, from begin to end of each file."""

from pathlib import Path

from mcap.reader import NonSeekingReader

from bench.rec.talker import number_of


def numbers(folder: Path) -> dict[str, set[int]]:
    """Returns the numbers of the messages in a folder's segments, by topic.

    Raises:
        RuntimeError: a message is there twice.
    """
    found: dict[str, set[int]] = {}
    for path in sorted(folder.glob("data/*.mcap")):
        with path.open("rb") as file:
            reader = NonSeekingReader(file, validate_crcs=True)
            for _, channel, message in reader.iter_messages(log_time_order=False):
                topic = found.setdefault(channel.topic, set())
                number = number_of(message.data)
                if number in topic:
                    raise RuntimeError(f"{channel.topic}: message {number} is in the recording twice")
                topic.add(number)
    return found


def missing(found: dict[str, set[int]], first: dict[str, int], last: dict[str, int]) -> int:
    """Returns how many messages behind the first numbers, up to the last ones, are not there."""
    wanted = {topic: set(range(first[topic] + 1, last[topic] + 1)) for topic in first}
    return sum(len(each - found.get(topic, set())) for topic, each in wanted.items())


def gaps(found: dict[str, set[int]]) -> int:
    """Returns how many messages are missing between the first and the last one of each topic."""
    return sum(max(each) - min(each) + 1 - len(each) for each in found.values() if each)


def newest_ns(folder: Path) -> int:
    """Returns the log time of the newest message in a folder's segments; 0 without any."""
    newest = 0
    for path in folder.glob("data/*.mcap"):
        with path.open("rb") as file:
            reader = NonSeekingReader(file, validate_crcs=True)
            times = (each.log_time for _, _, each in reader.iter_messages(log_time_order=False))
            newest = max(newest, max(times, default=0))
    return newest
