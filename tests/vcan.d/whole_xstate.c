/* Preloaded into user-mode Linux 6.1, which hands the registers of its processes back to the
 * host's kernel in a buffer of 2,696 bytes. A host whose processor has more extended state than
 * that (AMX: 11,008 bytes) takes only a buffer of the whole size (PTRACE_SETREGSET of
 * NT_X86_XSTATE, else EFAULT). So the bytes are laid over the whole state, whose rest no
 * process in user-mode Linux uses. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <elf.h>
#include <stdarg.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/uio.h>

/* The header of the XSAVE area begins with a bit for each state that is held. */
enum { HEADER = 512 };
/* x87, SSE, AVX, AVX-512 and protection keys: what fits into 2,696 bytes. */
static const unsigned long long FITTING = 0x2e7;

long ptrace(enum __ptrace_request request, ...)
{
    static long (*next)(enum __ptrace_request, ...);
    static char whole[1 << 16] __attribute__((aligned(64)));

    va_list arguments;
    va_start(arguments, request);
    long pid = va_arg(arguments, long);
    void *address = va_arg(arguments, void *);
    void *data = va_arg(arguments, void *);
    va_end(arguments);
    if (!next)
        next = (long (*)(enum __ptrace_request, ...))dlsym(RTLD_NEXT, "ptrace");

    const struct iovec *part = data;
    struct iovec all = {whole, sizeof whole};
    if (request == PTRACE_SETREGSET && address == (void *)NT_X86_XSTATE &&
        next(PTRACE_GETREGSET, pid, address, &all) == 0 && part->iov_len < all.iov_len) {
        unsigned long long held;
        memcpy(whole, part->iov_base, part->iov_len);
        memcpy(&held, whole + HEADER, sizeof held);
        held &= FITTING;
        memcpy(whole + HEADER, &held, sizeof held);
        return next(request, pid, address, &all);
    }
    return next(request, pid, address, data);
}
