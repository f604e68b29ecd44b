"""A library that kills a program at its n-th call of a kind, or makes locks and semaphores fail: from C, preloaded.

The shipped code has no hook for it: what is counted are the calls of the C library by which files take their names,
reach the disk and go.
"""

from __future__ import annotations

import contextlib
import functools
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

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


# A child for each line of the input, which says at which call it is killed; the imports are made once.
_FORKING = """
import os, sys
import aerialdojo_gen.store.atomic
for line in sys.stdin:
    number, sys.argv[1] = line.rstrip("\\n").split(" ", 1)
    child = os.fork()
    if not child:
        os.environ["PRELOAD_KILL_AT"] = number
        exec(sys.argv[2], {})
        os._exit(0)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@contextlib.contextmanager
def killed_at(program: str, **variables: str) -> Iterator[Callable[[int, Path], int]]:
    """Yield a function of n and a folder: run a program on it, killed at its n-th call; gives its exit status."""
    with subprocess.Popen(
        [sys.executable, "-c", _FORKING, "", program], env=preloaded(**variables), text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    ) as process:  # fmt: skip
        assert process.stdin is not None
        assert process.stdout is not None
        given, answers = process.stdin, process.stdout

        def run(n: int, folder: Path) -> int:
            print(n, folder, file=given, flush=True)
            return int(answers.readline())

        yield run
        given.close()


def unshared(*namespaces: str) -> list[str]:
    """Command that runs another one in namespaces of its own."""
    command = ["unshare", "--user", "--map-root-user", *namespaces]
    if subprocess.run([*command, "true"], capture_output=True, check=False).returncode:
        pytest.skip("this machine lets nobody make namespaces")
    return command
