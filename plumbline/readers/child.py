"""Read files in a child process that may not take more memory or time than allowed.

A damaged count in a 338 kB C3D makes the reader ask for 12.6 GB. One child serves many files, so that a file costs
milliseconds; a child that crashed or was stopped is replaced. The child (`python -m plumbline.readers.child`) takes
requests on its standard input and answers on its standard output, each a length (8 bytes) and a pickle.
"""

import atexit
import importlib
import os
import pickle
import signal
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, cast

from plumbline.errors import Refused

MEMORY = 1.2e9  # [bytes]
SECONDS = 60.0  # [s]
_WATCH = 0.02  # [s] between two looks at the child's memory
_SIZE = struct.Struct("<Q")


def guarded(function: str | Callable[[Any], Any], path: Any, memory: float = MEMORY, seconds: float = SECONDS) -> Any:
    """`function(path)`, run in a child process; what it returns or the Refused that it raises.

    function: importable, or its name as "module:function".  memory: of the whole child [bytes].  seconds: for this file [s].
    Raises Refused(too_large, timeout) beyond a limit and Refused(unreadable) where the child crashes or the function fails.
    """
    name = function if isinstance(function, str) else f"{function.__module__}:{function.__qualname__}"
    with _LOCK:
        child = _current()
        answer, stopped = child.ask((name, path, memory), memory, seconds)
        if answer is None:
            _forget()
    what = path.name if isinstance(path, Path) else str(path)
    if answer is None:
        raise _refusal(what, stopped, memory, seconds)
    value, error = answer
    if isinstance(error, Refused):
        raise error
    if error == "memory":
        raise _refusal(what, "too_large", memory, seconds)
    if error:
        raise Refused("unreadable", f"{what}: the reader failed with {error}", "report this with the file: it is a fault")
    return value


def _refusal(what: str, stopped: str, memory: float, seconds: float) -> Refused:
    """The Refused for a child that was stopped by us, or, where `stopped` is empty, by itself."""
    if stopped == "too_large":
        return Refused(stopped, f"{what} takes more than {memory / 1e9:.1f} GB to read", "it is damaged or must be cut")
    if stopped == "timeout":
        return Refused(stopped, f"{what} takes more than {seconds:g} s to read", "it is damaged or must be cut")
    return Refused("unreadable", f"{what} crashes its reader", "the file is damaged; export the recording again")


class _Child:
    """One child process, from the parent's side."""

    def __init__(self) -> None:
        root = str(Path(__file__).resolve().parents[2])
        paths = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
        environment = {**os.environ, "PYTHONPATH": paths, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        command = [sys.executable, "-m", "plumbline.readers.child"]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment)
        self.owner = os.getpid()

    def usable(self) -> bool:
        """Alive and started by this very process (a fork must not share the pipes)."""
        return self.owner == os.getpid() and self.process.poll() is None

    def ask(self, request: Any, memory: float, seconds: float) -> tuple[Any, str]:
        """The answer (value, error), or None and why the child was stopped; the limits are watched meanwhile."""
        done, stopped = threading.Event(), list[str]()
        watch = threading.Thread(target=self._watch, args=(done, stopped, memory, seconds), daemon=True)
        watch.start()
        try:
            _send(cast(IO[bytes], self.process.stdin), request)
            answer = _receive(cast(IO[bytes], self.process.stdout))
        except (OSError, EOFError):
            answer = None
        done.set()
        watch.join()
        if stopped or answer is None:
            self.process.kill()
            self.process.wait()
        return (None, stopped[0]) if stopped else (answer, "")

    def _watch(self, done: threading.Event, stopped: list[str], memory: float, seconds: float) -> None:
        import psutil  # only the parent needs it

        end = time.monotonic() + seconds
        while not done.wait(_WATCH):
            try:
                used = psutil.Process(self.process.pid).memory_info().rss
            except psutil.Error:  # it ended by itself
                return
            late = time.monotonic() > end
            if used > memory or late:
                stopped.append("timeout" if late else "too_large")
                self.process.kill()
                return

    def close(self) -> None:
        """End the child by closing its input."""
        if self.usable():
            cast(IO[bytes], self.process.stdin).close()
            try:
                self.process.wait(timeout=1)
            except subprocess.TimeoutExpired:
                self.process.kill()


_LOCK = threading.Lock()
_children: list[_Child] = []


def _current() -> _Child:
    """The child at work, started where there is none."""
    if not _children or not _children[0].usable():
        _children[:] = [_Child()]
    return _children[0]


def _forget() -> None:
    _children.clear()


@atexit.register
def _close() -> None:
    for child in _children:
        child.close()


def _send(pipe: IO[bytes], value: Any) -> None:
    data = pickle.dumps(value, protocol=5)
    pipe.write(_SIZE.pack(len(data)))
    pipe.write(data)
    pipe.flush()


def _receive(pipe: IO[bytes]) -> Any:
    """The next message.  Raises EOFError at the end of the pipe."""
    size = pipe.read(_SIZE.size)
    if len(size) < _SIZE.size:
        raise EOFError
    return pickle.loads(pipe.read(_SIZE.unpack(size)[0]))


def _limit(memory: float) -> None:
    """Limit the address space of this process, where the system knows such a limit."""
    try:
        import resource

        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        resource.setrlimit(resource.RLIMIT_AS, (int(memory), hard))
    except (ImportError, ValueError, OSError):  # Windows, macOS: the parent watches
        return


def _answer(name: str, path: Any, memory: float) -> tuple[Any, Any]:
    """(value, None), or (None, error): the Refused itself, "memory", or the words of any other error."""
    module, function = name.split(":")
    try:
        call = getattr(importlib.import_module(module), function)
        _limit(memory)
        return call(path), None
    except Refused as refused:
        return None, refused
    except MemoryError:
        return None, "memory"
    except Exception as error:  # the words reach the user in the list of excluded files
        return None, f"{type(error).__name__}: {error}"


def serve() -> None:
    """Answer requests until the input ends; what readers print goes to the error output."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's affair; the child ends with its input
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    while True:
        try:
            request = _receive(requests)
        except EOFError:
            return
        try:
            _send(answers, _answer(*request))
        except MemoryError:  # the answer itself is too large
            _send(answers, (None, "memory"))


if __name__ == "__main__":
    serve()
