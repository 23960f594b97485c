/* The little that a Cortex-M4F needs before main(): vector table, initialised data, FPU. A real
 * controller has its own. */
#include <stdint.h>

extern uint32_t _stack_top, _data_start, _data_end, _data_image, _bss_start, _bss_end;
int main(void);
_Noreturn void reset(void);
extern void initialise_monitor_handles(void);
_Noreturn void _exit(int status);

static void fault(void)
{
    _exit(99);
}

/* With optimisation a copying loop becomes a call of memcpy, which is fine here too. */
_Noreturn void reset(void)
{
    uint32_t *from = &_data_image;
    for (uint32_t *to = &_data_start; to < &_data_end;)
        *to++ = *from++;
    for (uint32_t *to = &_bss_start; to < &_bss_end;)
        *to++ = 0;
    /* CPACR: full access to the FPU. */
    *(volatile uint32_t *)0xE000ED88 |= 0xFu << 20;
    __asm volatile("dsb\n isb");
    initialise_monitor_handles(); /* semihosting: printf, open, read */
    _exit(main());
}

__attribute__((section(".vectors"), used)) static void (*const vectors[16])(void) = {
    (void (*)(void)) & _stack_top, reset, fault, fault, fault, fault, fault,
};
