/* A calendar clock (CLOCK_REALTIME) of one program that can be stepped, while the machine's goes on.
 *
 * Preloaded (LD_PRELOAD of ld.so(8)), with CALENDAR_CLOCK the path of a file that holds the step: a signed
 * 64-bit number of ns. What reads the clock is answered with the step added. Waits until an instant of the
 * clock end when the stepped clock has reached it, as in the kernel (clock_settime(2), FUTEX_CLOCK_REALTIME): a step
 * backwards prolongs a wait that has begun, a step forwards ends it.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

enum { SECOND = 1000000000, SLICE = 5000000 };

static const volatile int64_t *step;

__attribute__((constructor)) static void map_step(void) {
  const char *path = getenv("CALENDAR_CLOCK");
  int file = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;
  if (file < 0) return;
  void *mapped = mmap(NULL, sizeof *step, PROT_READ, MAP_SHARED, file, 0);
  if (mapped != MAP_FAILED) step = mapped;
  close(file);
}

static void *next(const char *name) { return dlsym(RTLD_NEXT, name); }

static int64_t ns_of(const struct timespec *at) { return (int64_t)at->tv_sec * SECOND + at->tv_nsec; }

static struct timespec timespec_of(int64_t ns) {
  struct timespec at = {ns / SECOND, ns % SECOND};
  return at;
}

static int read_clock(clockid_t clock, struct timespec *now) {
  static int (*real)(clockid_t, struct timespec *);
  if (!real) real = next("clock_gettime");
  return real(clock, now);
}

int clock_gettime(clockid_t clock, struct timespec *now) {
  int result = read_clock(clock, now);
  if (result == 0 && step && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE))
    *now = timespec_of(ns_of(now) + *step);
  return result;
}

int gettimeofday(struct timeval *now, void *zone) {
  struct timespec at;
  (void)zone;
  clock_gettime(CLOCK_REALTIME, &at);
  now->tv_sec = at.tv_sec;
  now->tv_usec = at.tv_nsec / 1000;
  return 0;
}

time_t time(time_t *stored) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  if (stored) *stored = now.tv_sec;
  return now.tv_sec;
}

/* Returns the real instant at which a wait until a stepped instant has to be looked at again. */
static struct timespec slice_until(const struct timespec *until) {
  struct timespec now;
  read_clock(CLOCK_REALTIME, &now);
  int64_t end = ns_of(until) - *step, soon = ns_of(&now) + SLICE;
  return timespec_of(end < soon ? (end > 0 ? end : 0) : soon);
}

static int reached(const struct timespec *until) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  return ns_of(&now) >= ns_of(until);
}

/* Waits in slices with `call`, whose deadline is `slice`, until the stepped clock has reached `until`. */
#define IN_SLICES(call)                                        \
  for (;;) {                                                   \
    struct timespec slice = slice_until(until);                \
    int result = (call);                                       \
    if (result != ETIMEDOUT || reached(until)) return result;  \
  }

/* glibc keeps the clock of a condition variable in bit 1 of __wrefs (nptl/pthread_cond_common.c). */
static int on_calendar_clock(pthread_cond_t *condition) { return (condition->__data.__wrefs & 2) == 0; }

int pthread_cond_timedwait(pthread_cond_t *condition, pthread_mutex_t *mutex, const struct timespec *until) {
  static int (*real)(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);
  if (!real) real = dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2"); /* x86-64: not that of 2.2.5 */
  if (!real) real = next("pthread_cond_timedwait");
  if (!step || !on_calendar_clock(condition)) return real(condition, mutex, until);
  IN_SLICES(real(condition, mutex, &slice))
}

int pthread_cond_clockwait(pthread_cond_t *condition, pthread_mutex_t *mutex, clockid_t clock,
                           const struct timespec *until) {
  static int (*real)(pthread_cond_t *, pthread_mutex_t *, clockid_t, const struct timespec *);
  if (!real) real = next("pthread_cond_clockwait");
  if (!step || clock != CLOCK_REALTIME) return real(condition, mutex, clock, until);
  IN_SLICES(real(condition, mutex, clock, &slice))
}

int pthread_mutex_timedlock(pthread_mutex_t *mutex, const struct timespec *until) {
  static int (*real)(pthread_mutex_t *, const struct timespec *);
  if (!real) real = next("pthread_mutex_timedlock");
  if (!step) return real(mutex, until);
  IN_SLICES(real(mutex, &slice))
}

int sem_timedwait(sem_t *semaphore, const struct timespec *until) {
  static int (*real)(sem_t *, const struct timespec *);
  if (!real) real = next("sem_timedwait");
  if (!step) return real(semaphore, until);
  for (;;) {
    struct timespec slice = slice_until(until);
    int result = real(semaphore, &slice);
    if (result == 0 || errno != ETIMEDOUT || reached(until)) return result;
  }
}
