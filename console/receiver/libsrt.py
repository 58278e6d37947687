"""The only binding of libsrt: sockets that deliver packets as they arrive.

GStreamer's srtsrc has no switch for that, so this loads, through ctypes, the very library that srtsrc uses.
Names and layouts are those of libsrt's srt.h; the C ABI is the same in all 1.x versions from 1.4.2 on.
"""

import atexit
import ctypes
import errno
import os
import select
import socket
import struct
from functools import cache
from typing import Any, Final

# Before any library that throws C++ exceptions, see there: libsrt reports errors inside itself by exceptions.
from common.gst import Gst
from console.receiver.delivery import LinkStatistics

LONGEST_PAYLOAD: Final = 1456
"""Most bytes of one packet in live mode: SRT_LIVE_MAX_PLSIZE."""
_OLDEST_VERSION: Final = 0x010402
"""1.4.2 is the first version with srt_bind_acquire."""
_NAMES: Final = ("libsrt-gnutls.so.1.5", "libsrt.so.1.5", "libsrt-openssl.so.1.5", "libsrt-gnutls.so.1.4")
"""Names of the library in Debian, Ubuntu and Fedora, for a system without a mapped one to copy from."""

# SRT_SOCKOPT
_RCVSYN, _ISN, _EVENT, _TSBPDMODE, _LATENCY, _PASSPHRASE, _TLPKTDROP = 2, 3, 18, 22, 23, 26, 31
# SRT_SOCKSTATUS
_CONNECTING: Final = 4
_CONNECTED: Final = 5
_EPOLL_IN: Final = 1
_ERROR: Final = -1
REMEDY_TOO_MANY_FILES: Final = "Type: ulimit -n 4096, and start this program again"
_REMEDIES_EXHAUSTED: Final = {
    errno.EMFILE: REMEDY_TOO_MANY_FILES,
    # The limit of all programs together: raising that of this one does not help.
    errno.ENFILE: "End programs with many open files, or raise the limit that this shows: sysctl fs.file-max",
}
_REJ_UNKNOWN: Final = 0
"""SRT_REJ_UNKNOWN: no reason is known."""


class DirectImpossibleError(Exception):
    """This computer permits no direct delivery; the text says why.

    Attributes:
        remedy: what to do, or to type.
    """

    remedy: str


class LibsrtMissingError(DirectImpossibleError):
    """No usable libsrt."""

    remedy = "Type: sudo apt-get install libsrt1.5-gnutls"


class LocalSocketError(DirectImpossibleError):
    """No socket can be had, before anything was sent.

    Args:
        cause: the error of the system, or of libsrt.

    Attributes:
        exhausted: whether there are too many open files, which leaves none for any other delivery either.
    """

    remedy = "Check that this program may open UDP sockets: a policy may forbid it, or IPv6 be switched off"

    def __init__(self, cause: Exception) -> None:
        why = cause.strerror if isinstance(cause, OSError) else None
        super().__init__(f"libsrt gets no socket: {why or cause}")
        number = cause.errno if isinstance(cause, OSError) else None
        self.exhausted = number in _REMEDIES_EXHAUSTED
        if number in _REMEDIES_EXHAUSTED:
            self.remedy = _REMEDIES_EXHAUSTED[number]


class SrtError(Exception):
    """A call of libsrt failed; the text is libsrt's own."""


class _MsgCtrl(ctypes.Structure):
    """SRT_MSGCTRL."""

    _fields_ = (
        ("flags", ctypes.c_int),
        ("msgttl", ctypes.c_int),
        ("inorder", ctypes.c_int),
        ("boundary", ctypes.c_int),
        ("srctime", ctypes.c_int64),
        ("pktseq", ctypes.c_int32),
        ("msgno", ctypes.c_int32),
        ("grpdata", ctypes.c_void_p),
        ("grpdata_size", ctypes.c_size_t),
    )


class _Statistics(ctypes.Structure):
    """The beginning of SRT_TRACEBSTATS up to the last field in use; newer versions only append."""

    _fields_ = (
        ("msTimeStamp", ctypes.c_int64),
        ("pktSentTotal", ctypes.c_int64),
        ("pktRecvTotal", ctypes.c_int64),
        ("pktSndLossTotal", ctypes.c_int),
        ("pktRcvLossTotal", ctypes.c_int),
        ("_counts", ctypes.c_int * 5),
        ("usSndDurationTotal", ctypes.c_int64),
        ("_drops", ctypes.c_int * 3),
        ("_bytes", ctypes.c_uint64 * 7),
        ("_sent_received", ctypes.c_int64 * 2),
        ("_local", ctypes.c_int * 8),
        ("_rates", ctypes.c_double * 2),
        ("usSndDuration", ctypes.c_int64),
        ("pktReorderDistance", ctypes.c_int),
        ("pktRcvAvgBelatedTime", ctypes.c_double),
        ("pktRcvBelated", ctypes.c_int64),
        ("_local_drops", ctypes.c_int * 3),
        ("_local_bytes", ctypes.c_uint64 * 7),
        ("usPktSndPeriod", ctypes.c_double),
        ("_windows", ctypes.c_int * 3),
        ("msRTT", ctypes.c_double),
        # srt_bistats fills the whole structure; this is more than any version's.
        ("_rest", ctypes.c_uint8 * 1024),
    )


@cache
def load() -> Any:
    """Returns the library, started; the same at every call.

    Raises:
        LibsrtMissingError: there is none, or it lacks a function.
    """
    library = _open()
    try:
        version = int(library.srt_getversion())
        for name, arguments in _SIGNATURES.items():
            getattr(library, name).argtypes = arguments
        library.srt_getlasterror_str.restype = ctypes.c_char_p
        library.srt_rejectreason_str.restype = ctypes.c_char_p
    except AttributeError as error:
        raise LibsrtMissingError(f"libsrt is too old: {error}") from error
    if version < _OLDEST_VERSION:
        raise LibsrtMissingError(f"libsrt {_dotted(version)} is older than {_dotted(_OLDEST_VERSION)}")
    # Counted: GStreamer's elements start and clean up for themselves. Ours lasts as long as the process, but
    # no longer: libsrt's destructor takes back one start only, and frees the tables that its threads go on
    # using if there were more.
    if library.srt_startup() == _ERROR:
        raise LibsrtMissingError("libsrt can't be started")
    atexit.register(library.srt_cleanup)
    return library


class SrtSocket:
    """A caller's socket that delivers packets as they arrive, with their numbers; not connected at first.

    Without TSBPD (draft-sharabayko-srt-01 4.5) libsrt wakes no waiting receiver at a packet, only at its own
    acknowledgements, every 10 ms. So `wait` watches the UDP socket itself, of which this keeps a duplicate.
    Not thread-safe; every method but `wait` returns at once.

    Args:
        host: a numeric IPv4 or IPv6 address.
        port: of the listener.
        latency_ms: proposed for the other direction; ours has none.
        passphrase: empty for an unencrypted stream.

    Raises:
        LibsrtMissingError: there is no usable libsrt.
        LocalSocketError: no socket can be had, or libsrt refuses it.
        OSError: the host's interface does not exist.
    """

    def __init__(self, host: str, port: int, latency_ms: int, passphrase: str) -> None:
        self._srt = load()
        family, self._target = _sockaddr(host, port)
        self._socket = _ERROR
        self._poll = select.poll()
        self._payload = ctypes.create_string_buffer(LONGEST_PAYLOAD)
        self._control = _MsgCtrl()
        self._event, self._event_size = ctypes.c_int32(), ctypes.c_int(4)
        try:
            self._udp = socket.socket(family, socket.SOCK_DGRAM)
        except OSError as error:
            raise LocalSocketError(error) from error
        try:
            self._socket = self._check(self._srt.srt_create_socket())
            for option, value in ((_TSBPDMODE, 0), (_TLPKTDROP, 0), (_RCVSYN, 0), (_LATENCY, latency_ms)):
                self._set(option, struct.pack("i", value))
            if passphrase:
                self._set(_PASSPHRASE, passphrase.encode())
            self._udp.bind(("", 0))
            # libsrt closes its descriptor in its own time.
            acquired = os.dup(self._udp.fileno())
            if self._srt.srt_bind_acquire(self._socket, acquired) == _ERROR:
                os.close(acquired)
                raise SrtError(self._last_error())  # noqa: TRY301 - whatever fails here, the socket is closed
            self._poll.register(self._udp, select.POLLIN)
        except (SrtError, OSError) as error:
            self.close()
            raise LocalSocketError(error) from error

    def connect(self) -> None:
        """Begins the handshake.

        Raises:
            SrtError: libsrt refuses.
        """
        self._check(self._srt.srt_connect(self._socket, self._target, len(self._target)))

    @property
    def connecting(self) -> bool:
        """Whether the handshake is under way."""
        return int(self._srt.srt_getsockstate(self._socket)) < _CONNECTED

    @property
    def connected(self) -> bool:
        """Whether the connection is established and not broken."""
        return int(self._srt.srt_getsockstate(self._socket)) == _CONNECTED

    @property
    def failed_unexplained(self) -> bool:
        """Whether the handshake failed without a reason, as when the listener is busy with another one."""
        return int(self._srt.srt_getrejectreason(self._socket)) == _REJ_UNKNOWN

    def reject_reason(self) -> str:
        """Returns why the handshake failed."""
        reason = self._srt.srt_getrejectreason(self._socket)
        return bytes(self._srt.srt_rejectreason_str(reason)).decode(errors="replace")

    def first_number(self) -> int:
        """Returns the number of the connection's first packet: the listener takes over the caller's."""
        number, size = ctypes.c_int32(), ctypes.c_int(4)
        self._check(self._srt.srt_getsockopt(self._socket, 0, _ISN, ctypes.byref(number), ctypes.byref(size)))
        return number.value

    def wait(self, timeout_s: float) -> bool:
        """Waits for a datagram; libsrt's own thread handles it at about the same time.

        Returns:
            Whether one has come.
        """
        return bool(self._poll.poll(timeout_s * 1000))

    def receive(self) -> tuple[int, bytes] | None:
        """Returns the number and the payload of one packet; None when none is there.

        Packets come in any order, each once.

        Raises:
            SrtError: the connection is lost.
        """
        # Asked first: an error return of srt_recvmsg2 costs a C++ exception.
        event = self._event
        got = self._srt.srt_getsockopt(
            self._socket, 0, _EVENT, ctypes.byref(event), ctypes.byref(self._event_size)
        )
        if got != _ERROR and not event.value & _EPOLL_IN and self.connected:
            return None
        size = self._srt.srt_recvmsg2(
            self._socket, self._payload, LONGEST_PAYLOAD, ctypes.byref(self._control)
        )
        if size > 0:
            return self._control.pktseq, self._payload.raw[:size]
        if self.connected:
            return None
        raise SrtError(self._last_error())

    def statistics(self) -> LinkStatistics:
        """Returns the statistics since the connection began.

        Raises:
            SrtError: there is no connection.
        """
        found = _Statistics()
        self._check(self._srt.srt_bistats(self._socket, ctypes.byref(found), 0, 1))
        return LinkStatistics(found.msRTT, found.pktRcvLossTotal, found.pktRecvTotal)

    def close(self) -> None:
        """Disconnects."""
        self._srt.srt_close(self._socket)
        self._udp.close()

    def _set(self, option: int, value: bytes) -> None:
        self._check(self._srt.srt_setsockopt(self._socket, 0, option, value, len(value)))

    def _check(self, result: int) -> int:
        if result == _ERROR:
            raise SrtError(self._last_error())
        return result

    def _last_error(self) -> str:
        return bytes(self._srt.srt_getlasterror_str()).decode(errors="replace")


_SIGNATURES: Final[dict[str, list[Any]]] = {
    "srt_startup": [],
    "srt_cleanup": [],
    "srt_create_socket": [],
    "srt_bind_acquire": [ctypes.c_int, ctypes.c_int],
    "srt_connect": [ctypes.c_int, ctypes.c_char_p, ctypes.c_int],
    "srt_setsockopt": [ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_char_p, ctypes.c_int],
    "srt_getsockopt": [ctypes.c_int, ctypes.c_int, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p],
    "srt_getsockstate": [ctypes.c_int],
    "srt_getrejectreason": [ctypes.c_int],
    "srt_rejectreason_str": [ctypes.c_int],
    "srt_getlasterror_str": [],
    "srt_recvmsg2": [ctypes.c_int, ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p],
    "srt_bistats": [ctypes.c_int, ctypes.c_void_p, ctypes.c_int, ctypes.c_int],
    "srt_close": [ctypes.c_int],
}


def _open() -> Any:
    """Opens the library that GStreamer's SRT plugin has loaded, else one of the usual names."""
    plugin = Gst.ElementFactory.find("srtsrc")
    if plugin:
        plugin.load()
    for name in (*_mapped(), *_NAMES):
        try:
            return ctypes.CDLL(name)
        except OSError:
            continue
    raise LibsrtMissingError("libsrt is not installed")


def _mapped() -> list[str]:
    """Returns the files of libsrt that this process has mapped."""
    try:
        with open("/proc/self/maps", encoding="utf-8", errors="replace") as maps:  # noqa: PTH123
            paths = {line.split(maxsplit=5)[-1].strip() for line in maps if "/libsrt" in line}
    except OSError:
        return []
    return sorted(path for path in paths if "/libsrt-" in path or "/libsrt." in path)


def _sockaddr(host: str, port: int) -> tuple[int, bytes]:
    """Returns the family and the C structure (ip(7), ipv6(7)) of an address."""
    if ":" in host:
        address, _, scope = host.partition("%")
        scope_id = socket.if_nametoindex(scope) if scope else 0
        packed = socket.inet_pton(socket.AF_INET6, address)
        return socket.AF_INET6, struct.pack("=H2sI16sI", socket.AF_INET6, _port(port), 0, packed, scope_id)
    packed = socket.inet_pton(socket.AF_INET, host)
    return socket.AF_INET, struct.pack("=H2s4s8x", socket.AF_INET, _port(port), packed)


def _port(port: int) -> bytes:
    return struct.pack("!H", port)


def _dotted(version: int) -> str:
    return f"{version >> 16}.{version >> 8 & 0xFF}.{version & 0xFF}"
