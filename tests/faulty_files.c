// The system's file operations, one of which fails: for LD_PRELOAD.
//
//   FAULTY_FOLDER   operations on what is below it count
//   FAULTY_AT       the number of the one that fails, from 1 on
//   FAULTY_ERROR    its errno
//   FAULTY_HIT      a file that is made when it fails
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

static atomic_long count;

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static int is_below(const char *path) {
    const char *folder = getenv("FAULTY_FOLDER");
    char whole[PATH_MAX];
    if (!folder || !path) return 0;
    if (path[0] != '/') {
        char here[PATH_MAX];
        if (!getcwd(here, sizeof here)) return 0;
        if (snprintf(whole, sizeof whole, "%s/%s", here, path) >= (int)sizeof whole) return 0;
        path = whole;
    }
    size_t length = strlen(folder);
    return !strncmp(path, folder, length) && (path[length] == '/' || !path[length]);
}

static int is_below_file(int file) {
    char link[64], path[PATH_MAX];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length <= 0) return 0;
    path[length] = 0;
    return is_below(path);
}

// Whether this operation is the one that fails; errno is set then.
static int fails(int counts) {
    const char *at = getenv("FAULTY_AT"), *error = getenv("FAULTY_ERROR"), *hit = getenv("FAULTY_HIT");
    if (!counts || !at || !error || atomic_fetch_add(&count, 1) + 1 != atol(at)) return 0;
    if (hit) {
        int file = REAL(open)(hit, O_CREAT | O_WRONLY, 0666);
        if (file >= 0) close(file);
    }
    errno = atoi(error);
    return 1;
}

#define OPEN(name)                                               \
    int name(const char *path, int flags, ...) {                 \
        va_list rest;                                            \
        va_start(rest, flags);                                   \
        mode_t mode = va_arg(rest, mode_t);                      \
        va_end(rest);                                            \
        return fails(is_below(path)) ? -1 : REAL(name)(path, flags, mode); \
    }
OPEN(open)
OPEN(open64)

ssize_t write(int file, const void *bytes, size_t length) {
    return fails(is_below_file(file)) ? -1 : REAL(write)(file, bytes, length);
}
ssize_t writev(int file, const struct iovec *parts, int length) {
    return fails(is_below_file(file)) ? -1 : REAL(writev)(file, parts, length);
}
int fsync(int file) { return fails(is_below_file(file)) ? -1 : REAL(fsync)(file); }
int fdatasync(int file) { return fails(is_below_file(file)) ? -1 : REAL(fdatasync)(file); }
int ftruncate64(int file, off64_t length) { return fails(is_below_file(file)) ? -1 : REAL(ftruncate64)(file, length); }
int rename(const char *from, const char *to) { return fails(is_below(from) || is_below(to)) ? -1 : REAL(rename)(from, to); }
int mkdir(const char *path, mode_t mode) { return fails(is_below(path)) ? -1 : REAL(mkdir)(path, mode); }
int unlink(const char *path) { return fails(is_below(path)) ? -1 : REAL(unlink)(path); }
int rmdir(const char *path) { return fails(is_below(path)) ? -1 : REAL(rmdir)(path); }
