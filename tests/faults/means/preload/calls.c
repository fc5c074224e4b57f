/* Wrong calls: loaded before libc, it spoils write, writev, fsync and fdatasync of one file.
 *
 * FAULT_PATH     only descriptors with this text in the name of their file
 * FAULT_TRIGGER  spoils only while this file exists; its text says how, and is read at each call:
 *                  errno N     fail with this number
 *                  delay MS    take so long, then work
 *                  hang MS     take so long, then fail with EAGAIN
 *                  zero        write nothing and return 0
 *                  short N     write at most N bytes
 *                followed by `once` to remove the file at the first call
 *                The file FAULT_TRIGGER.calls gets a line for each: seconds of the monotonic clock.
 * FAULT_CALLS    write, or sync for fsync and fdatasync
 * Each may be a list, with colons between: the first path belongs to the first file and call.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>
#include <time.h>

static void note(const char *trigger) {
    char path[520], line[64];
    struct timespec time;
    snprintf(path, sizeof path, "%s.calls", trigger);
    clock_gettime(CLOCK_MONOTONIC, &time);
    int length = snprintf(line, sizeof line, "%ld.%09ld\n", (long)time.tv_sec, time.tv_nsec);
    int file = open(path, O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
    if (file < 0) return;
    syscall(SYS_write, file, line, (size_t)length);
    close(file);
}

struct fault { char kind[16]; long number; int active; };

/* Copies an item of the list in a variable; whether there is one. */
static int item(const char *variable, int number, char *copy, size_t size) {
    const char *list = getenv(variable);
    while (list && number--) list = (list = strchr(list, ':')) ? list + 1 : NULL;
    if (list) snprintf(copy, size, "%.*s", (int)strcspn(list, ":"), list);
    return list != NULL;
}

static struct fault of(int number, int fd, const char *call) {
    struct fault fault = {"", 0, 0};
    char trigger[512], path[512], calls[16];
    char link[64], name[512], text[64] = "", once[8] = "";
    if (item("FAULT_TRIGGER", number, trigger, sizeof trigger) &&
        item("FAULT_PATH", number, path, sizeof path) &&
        item("FAULT_CALLS", number, calls, sizeof calls) && !strcmp(calls, call)) {
        snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
        ssize_t length = readlink(link, name, sizeof name - 1);
        name[length > 0 ? length : 0] = 0;
        int file = strstr(name, path) ? open(trigger, O_RDONLY | O_CLOEXEC) : -1;
        if (file >= 0) {
            length = read(file, text, sizeof text - 1);
            close(file);
            int count = length > 0 ? sscanf(text, "%15s %ld %7s", fault.kind, &fault.number, once) : 0;
            if (count == 1) sscanf(text, "%15s %7s", fault.kind, once);
            fault.active = count > 0;
            if (fault.active) note(trigger);
            if (!strcmp(once, "once")) unlink(trigger);
        }
    }
    return fault;
}

static struct fault now(int fd, const char *call) {
    struct fault fault = {"", 0, 0};
    int kept = errno;
    char path[512];
    for (int number = 0; !fault.active && item("FAULT_PATH", number, path, sizeof path); number++)
        fault = of(number, fd, call);
    errno = kept;
    return fault;
}

static void wait_ms(long ms) {
    struct timespec time = {ms / 1000, ms % 1000 * 1000000};
    nanosleep(&time, NULL);
}

/* Whether the call ends here; then *result holds what it returns. */
static int spoiled(struct fault *fault, ssize_t *result) {
    if (!fault->active) return 0;
    *result = -1;
    if (!strcmp(fault->kind, "errno")) { errno = (int)fault->number; return 1; }
    if (!strcmp(fault->kind, "zero")) { *result = 0; return 1; }
    if (!strcmp(fault->kind, "hang")) { wait_ms(fault->number); errno = EAGAIN; return 1; }
    if (!strcmp(fault->kind, "delay")) wait_ms(fault->number);
    return 0;
}

ssize_t write(int fd, const void *data, size_t size) {
    struct fault fault = now(fd, "write");
    ssize_t result;
    if (spoiled(&fault, &result)) return result;
    if (fault.active && !strcmp(fault.kind, "short") && size > (size_t)fault.number)
        size = (size_t)fault.number;
    return syscall(SYS_write, fd, data, size);
}

ssize_t writev(int fd, const struct iovec *parts, int count) {
    struct fault fault = now(fd, "write");
    ssize_t result;
    if (spoiled(&fault, &result)) return result;
    return syscall(SYS_writev, fd, parts, count);
}

static int sync_call(long number, int fd) {
    struct fault fault = now(fd, "sync");
    ssize_t result;
    if (spoiled(&fault, &result)) return (int)result;
    return (int)syscall(number, fd);
}

int fsync(int fd) { return sync_call(SYS_fsync, fd); }
int fdatasync(int fd) { return sync_call(SYS_fdatasync, fd); }
