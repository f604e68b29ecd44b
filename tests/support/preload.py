"""A library that kills a program at its n-th call of a kind, or makes locks and semaphores fail: from C, preloaded.

The shipped code has no hook for it: what is counted are the calls of the C library by which files take their names,
reach the disk and go.
"""

from __future__ import annotations

import contextlib
import functools
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import pytest
from support.chores import until_empty

ROOT = Path(__file__).resolve().parents[2]

SOURCE = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <semaphore.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

/* PRELOAD_COUNTER is a file that all processes of a run append a byte to, so that the n-th call of them all is known:
   an append is atomic, and the offset behind it is the number. */
static int number(void) {
    const char *path = getenv("PRELOAD_COUNTER");
    if (!path) { static int n; return ++n; }
    int fd = open(path, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
    if (fd < 0) return -1;
    if (syscall(SYS_write, fd, ".", 1) != 1) { close(fd); return -1; }
    int n = (int)lseek(fd, 0, SEEK_CUR);
    close(fd);
    return n;
}

/* Where the file of a rename lies before it, for the log. */
static __thread const char *from = "";

static void count(const char *what, const char *path) {
    int saved = errno;
    /* Python's caches and the like do not count. */
    if (path && (strstr(path, "__pycache__") || strstr(path, "/proc/") || strstr(path, ".nb"))) return;
    const char *only = getenv("PRELOAD_ONLY");
    if (only && !strstr(only, what)) return;
    const char *log = getenv("PRELOAD_LOG");
    if (log) {
        int fd = open(log, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
        if (fd >= 0) {
            char line[1200];
            int length = snprintf(line, sizeof line, "%s\t%.500s\t%.500s\n", what, path ? path : "", from);
            syscall(SYS_write, fd, line, length);
            close(fd);
        }
    }
    const char *at = getenv("PRELOAD_KILL_AT");
    if (at && atoi(at) > 0 && number() == atoi(at))
        kill(getenv("PRELOAD_KILL_GROUP") ? 0 : getpid(), SIGKILL);
    errno = saved;
}

#define REAL(name) __typeof__(&name) real = (__typeof__(&name))dlsym(RTLD_NEXT, #name)

static void count_rename(const char *what, const char *a, const char *b) {
    from = a;
    count(what, b);
    from = "";
}
int rename(const char *a, const char *b) { REAL(rename); count_rename("rename", a, b); return real(a, b); }
int renameat(int x, const char *a, int y, const char *b) {
    REAL(renameat);
    count_rename("rename", a, b);
    return real(x, a, y, b);
}
int renameat2(int x, const char *a, int y, const char *b, unsigned f) {
    REAL(renameat2);
    if (getenv("PRELOAD_NO_EXCHANGE")) { errno = EINVAL; return -1; }
    count_rename("renameat2", a, b);
    return real(x, a, y, b, f);
}
static void count_sync(const char *what, int fd) {
    char link[40], path[500];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(link, path, sizeof path - 1);
    path[length < 0 ? 0 : length] = 0;
    count(what, path);
}
int fsync(int fd) { REAL(fsync); count_sync("fsync", fd); return real(fd); }
int syncfs(int fd) { REAL(syncfs); count_sync("syncfs", fd); return real(fd); }
int unlink(const char *a) { REAL(unlink); count("unlink", a); return real(a); }
int unlinkat(int x, const char *a, int f) { REAL(unlinkat); count("unlink", a); return real(x, a, f); }
int rmdir(const char *a) { REAL(rmdir); count("rmdir", a); return real(a); }
int mkdir(const char *a, mode_t m) { REAL(mkdir); count("mkdir", a); return real(a, m); }
int link(const char *a, const char *b) { REAL(link); count("link", b); return real(a, b); }
/* A file that is half written; what goes to a terminal, a pipe or a socket does not count. */
static void count_write(int fd) {
    struct stat found;
    if (getenv("PRELOAD_WRITES") && fstat(fd, &found) == 0 && S_ISREG(found.st_mode)) count("write", NULL);
}
ssize_t write(int fd, const void *b, size_t n) { REAL(write); count_write(fd); return real(fd, b, n); }
ssize_t pwrite(int fd, const void *b, size_t n, off_t o) { REAL(pwrite); count_write(fd); return real(fd, b, n, o); }
ssize_t pwrite64(int fd, const void *b, size_t n, off64_t o) {
    REAL(pwrite64);
    count_write(fd);
    return real(fd, b, n, o);
}
int flock(int fd, int how) {
    REAL(flock);
    const char *error = getenv("PRELOAD_FLOCK_ERRNO");
    if (error) { errno = atoi(error); return -1; }
    count("flock", NULL);
    return real(fd, how);
}
/* As where /dev/shm is full or read-only. */
sem_t *sem_open(const char *name, int flags, ...) {
    REAL(sem_open);
    if (getenv("PRELOAD_NO_SEMAPHORES")) { errno = EROFS; return SEM_FAILED; }
    va_list more;
    va_start(more, flags);
    mode_t mode = va_arg(more, mode_t);
    unsigned value = va_arg(more, unsigned);
    va_end(more);
    return real(name, flags, mode, value);
}
"""


@functools.cache
def library() -> Path:
    """Compile the library, once a process."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    assert compiler, "a C compiler is needed: install cc"
    folder = tempfile.TemporaryDirectory(prefix="aerialdojo-preload-")
    library._folder = folder  # type: ignore[attr-defined]  # kept as long as the process
    source, target = Path(folder.name) / "preload.c", Path(folder.name) / "preload.so"
    source.write_text(SOURCE, encoding="utf-8")
    subprocess.run([compiler, "-O1", "-shared", "-fPIC", "-w", "-o", target, source, "-ldl"], check=True)
    return target


def preloaded(**variables: str) -> dict[str, str]:
    """Environment of a program with the library, and with variables ``PRELOAD_…`` that say what it does."""
    return os.environ | {"LD_PRELOAD": str(library())} | {f"PRELOAD_{name}": v for name, v in variables.items()}


_SERVER = """
import json, os, sys, traceback
exec(sys.argv[1], {})
for line in iter(sys.stdin.readline, ""):
    arguments, environment, output = json.loads(line)
    child = os.fork()
    if not child:
        os.setsid()
        os.environ.update(environment)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        if output:
            os.dup2(os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
        os.dup2(2, 1)
        program, sys.argv[:] = sys.argv[2], ["aerialdojo-gen", *arguments]
        try:
            exec(program, {})
            code = 0
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else bool(ended.code)
        except BaseException:
            traceback.print_exc()
            code = 70
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    print(child, flush=True)
    sys.stdin.readline()
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


class ForkServer:
    """A process with the library that imports once what a program needs, and runs it in children of its own."""

    def __init__(self, imports: str, program: str, **variables: str) -> None:
        path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
        self._process = subprocess.Popen(
            [sys.executable, "-c", _SERVER, imports, program], cwd=ROOT, text=True, stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, env=preloaded(**variables) | {"PYTHONPATH": path},
        )  # fmt: skip

    def run(
        self, arguments: Sequence[object], env: Mapping[str, str], said: Path | None = None, kill_after: float = -1.0
    ) -> int:
        """Run the program in a session of its own; returns its exit status, negative for a signal."""
        asked = [[*map(str, arguments)], dict(env), said and str(said)]
        print(json.dumps(asked), file=self._process.stdin, flush=True)
        session = int(self._process.stdout.readline())
        if kill_after >= 0:
            # The server reaps it when it is asked to go on: until then its number is nobody else's.
            time.sleep(kill_after)
            with contextlib.suppress(ProcessLookupError):
                os.killpg(session, signal.SIGKILL)
        print(file=self._process.stdin, flush=True)
        code = int(self._process.stdout.readline())
        until_empty(session)
        return code

    def close(self) -> None:
        self._process.stdin.close()
        self._process.wait()


@contextlib.contextmanager
def killed_at(
    program: str, imports: str = "import aerialdojo_gen.store.atomic", **variables: str
) -> Iterator[Callable[[int, Path], int]]:
    """Yield a function of n and a folder: run a program on it, killed at its n-th call; gives its exit status."""
    with contextlib.closing(ForkServer(imports, program, **variables)) as server:
        yield lambda n, folder: server.run([folder], {"PRELOAD_KILL_AT": str(n)})


def unshared(*namespaces: str) -> list[str]:
    """Command that runs another one in namespaces of its own."""
    command = ["unshare", "--user", "--map-root-user", *namespaces]
    if subprocess.run([*command, "true"], capture_output=True, check=False).returncode:
        pytest.skip("this machine lets nobody make namespaces")
    return command
