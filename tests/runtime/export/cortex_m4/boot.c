/* Starts a program on QEMU's mps2-an386, a Cortex-M4, with output through semihosting. */
#include <string.h>

extern unsigned char data_load[], data_start[], bss_start[], bss_end[], stack_top[];
extern unsigned int data_size;
extern void initialise_monitor_handles(void);
extern void _exit(int status);
extern int main(void);

void reset(void)
{
    *(volatile unsigned int *)0xE000ED88 |= 0xFu << 20; /* the floating-point unit */
    memcpy(data_start, data_load, (size_t)&data_size);
    memset(bss_start, 0, (size_t)(bss_end - bss_start));
    initialise_monitor_handles();
    _exit(main());
}

__attribute__((section(".vectors"), used)) static const void *const vectors[] = {stack_top, reset};
