/* A disk that fails: the n-th call that changes a file returns an error; loaded before libc by LD_PRELOAD.
   failing_disk_arm(n, error, for_ever) arms it; failing_disk_calls() tells how many calls there were since. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <sys/types.h>
#include <unistd.h>

static long calls, fail_at = -1;
static int fail_errno, fail_for_ever;

void failing_disk_arm(long at, int error, int for_ever) {
    calls = 0;
    fail_at = at;
    fail_errno = error;
    fail_for_ever = for_ever;
}

long failing_disk_calls(void) { return calls; }

static int fails(void) {
    long call = calls++;
    if (fail_at < 0 || call < fail_at || (call > fail_at && !fail_for_ever)) return 0;
    errno = fail_errno;
    return 1;
}

#define GUARD(result, name, parameters, arguments) \
    result name parameters { \
        static result (*real) parameters; \
        if (!real) real = (result (*) parameters)dlsym(RTLD_NEXT, #name); \
        return fails() ? -1 : real arguments; \
    }

GUARD(ssize_t, pwrite, (int file, const void *data, size_t size, off_t at), (file, data, size, at))
GUARD(ssize_t, pwrite64, (int file, const void *data, size_t size, off64_t at), (file, data, size, at))
GUARD(int, fsync, (int file), (file))
GUARD(int, fdatasync, (int file), (file))
GUARD(int, ftruncate, (int file, off_t size), (file, size))
GUARD(int, ftruncate64, (int file, off64_t size), (file, size))
