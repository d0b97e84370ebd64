"""Makes a process look like one under macOS or Windows, as far as a module of Python shows it.

Python imports this file as it starts if its folder is in PYTHONPATH, so that child processes look
alike. The project's files do not find what that system lacks; the standard library, which is
another one there, still does. What has another form there takes that form.
"""

import builtins
import errno
import importlib
import os
import selectors
import signal
import socket
import sys
import types
from pathlib import Path

ROOT = Path(__file__).parents[4]
OURS = tuple(f"{ROOT / package}{os.sep}" for package in ("blocks", "runtime", "spikeblocks"))
BOTH = {
    "os": "sched_getaffinity sched_setaffinity pidfd_open posix_fallocate memfd_create O_DIRECT",
    "socket": "SOCK_CLOEXEC SO_PEERCRED",
    "select": "epoll",
    "signal": "SIGSTKFLT SIGPWR",
}
WINDOWS = {
    "os": "fork forkpty getuid geteuid getgid getegid getgroups uname pread pwrite killpg getpgid "
    "getpgrp setsid getsid setpgid O_NOFOLLOW O_CLOEXEC O_NONBLOCK O_DIRECTORY O_SYNC WNOHANG "
    "set_blocking statvfs fstatvfs chown fchown fchmod mkfifo mknod nice getloadavg sysconf sync "
    "ttyname openpty wait waitid wait3 wait4 posix_spawn getpriority pathconf WIFSIGNALED",
    "socket": "AF_UNIX send_fds recv_fds MSG_DONTWAIT SCM_RIGHTS CMSG_LEN",
    "select": "poll epoll kqueue",
    "signal": "SIGKILL SIGHUP SIGCHLD SIGALRM SIGQUIT SIGSTOP SIGTSTP SIGCONT SIGUSR1 SIGUSR2 "
    "SIGPIPE SIGXCPU alarm setitimer pause pthread_sigmask sigwait siginterrupt pthread_kill",
    "mmap": "MADV_DONTNEED MADV_WILLNEED MAP_PRIVATE PROT_READ",
    "time": "tzset clock_gettime",
    "sys": "getdlopenflags",
}
NO_MODULES = {"fcntl", "resource", "pwd", "grp", "termios", "tty", "pty", "posix", "syslog"}


def is_ours(depth: int) -> bool:
    """Whether the caller of the caller is a file of the project."""
    return sys._getframe(depth + 1).f_code.co_filename.startswith(OURS)


def without(names: set[str]) -> type[types.ModuleType]:
    class Partial(types.ModuleType):
        def __getattribute__(self, name: str) -> object:
            if name in names and is_ours(1):
                raise AttributeError(f"this system has no {name}")
            return super().__getattribute__(name)

    return Partial


def hide(lists: dict[str, str]) -> None:
    for module, names in lists.items():
        importlib.import_module(module).__class__ = without(set(names.split()))


def refuse_modules() -> None:
    find, load = builtins.__import__, importlib.import_module

    def refused(name: str, depth: int) -> None:
        if name in NO_MODULES and is_ours(depth + 1):
            raise ModuleNotFoundError(f"No module named '{name}'", name=name)

    def find_ours(name, *rest, **named):  # type: ignore[no-untyped-def]
        refused(name, 1)
        return find(name, *rest, **named)

    def load_ours(name, package=None):  # type: ignore[no-untyped-def]
        refused(name, 1)
        # subprocess tells Windows by this module; only our files find it.
        return Msvcrt if name == "msvcrt" and is_ours(1) else load(name, package)

    builtins.__import__, importlib.import_module = find_ours, load_ours


class Msvcrt:
    """What the project uses of Windows' msvcrt, made from locks of Unix."""

    LK_NBLCK = 2

    @staticmethod
    def locking(file: int, mode: int, count: int) -> None:
        import fcntl

        try:
            place = os.lseek(file, 0, os.SEEK_CUR)
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, count, place)
        except OSError:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES)) from None


def socketpair(*_: object) -> tuple[socket.socket, socket.socket]:
    with socket.create_server(("127.0.0.1", 0)) as listening:
        near = socket.create_connection(listening.getsockname())
        return near, listening.accept()[0]


def no_link(*_: object, **__: object) -> None:
    raise OSError(errno.EPERM, "A required privilege is not held by the client")


system = os.environ.get("LOOKS_LIKE")
if system in ("macos", "windows"):
    hide(BOTH)
if system == "windows":
    hide({name: f"{names} {BOTH.get(name, '')}" for name, names in WINDOWS.items()})
    refuse_modules()
    selectors.DefaultSelector = selectors.SelectSelector  # type: ignore[misc]
    socket.socketpair = socketpair  # type: ignore[assignment]
    os.symlink = no_link
    signal.valid_signals = lambda: {signal.SIGINT, signal.SIGTERM}  # type: ignore[assignment]
