/* Runs the firmware in simavr: its serial port behind a pseudo-terminal, its coils and its switch watched.
 *
 * simulator stepper.elf: prints "port /dev/pts/N", and when it is ended by SIGTERM or SIGINT
 * "position P illegal I fastest_us F": half steps of a rotor that follows the coils at D8 to D11 (IN1 to IN4),
 * coil patterns that no rotor follows, and the shortest time between two of its steps. The switch at D2 is closed
 * while the rotor is between 160 and 100 half steps before where it began. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>

#define FREQUENCY 16000000UL
#define CLOSES_AT (-160)
#define OPENS_AT (-100)

static volatile sig_atomic_t stopped;
static int terminal;
static int has_room = 1;
static avr_t *avr;
static avr_irq_t *switch_pin;

static int phase;
static long position, illegal;
static avr_cycle_count_t stepped, fastest;

static void stop(int signal) { stopped = signal; }

/* The half step of a coil pattern; -1 for none, -2 for no current. */
static int half_step(unsigned coils) {
    static const unsigned patterns[8] = {0x1, 0x3, 0x2, 0x6, 0x4, 0xC, 0x8, 0x9};
    for (int i = 0; i < 8; i++)
        if (patterns[i] == coils)
            return i;
    return coils ? -1 : -2;
}

/* Connects the switch to ground or not, against the pull-up. */
static void set_switch(void) {
    int level = !(position >= CLOSES_AT && position < OPENS_AT);
    avr_ioport_external_t outside = {.name = 'D', .mask = 1 << 2, .value = level << 2};
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('D'), &outside);
    avr_raise_irq(switch_pin, level);
}

static void coils_changed(avr_irq_t *irq, uint32_t value, void *param) {
    int next = half_step(value & 0x0F);
    if (next == -2 || next == phase)
        return;
    int moved = next < 0 ? 0 : (next - phase) & 7;
    if (moved != 1 && moved != 7) {
        illegal++;
        if (next >= 0)
            phase = next;
        return;
    }
    position += moved == 1 ? 1 : -1;
    phase = next;
    avr_cycle_count_t since = avr->cycle - stepped;
    if (stepped && (!fastest || since < fastest))
        fastest = since;
    stepped = avr->cycle;
    set_switch();
}

static void sent(avr_irq_t *irq, uint32_t value, void *param) {
    uint8_t byte = value;
    /* What nobody fetches is lost, as on a cable. */
    if (write(terminal, &byte, 1) < 0 && errno != EAGAIN)
        stopped = 1;
}

static void room(avr_irq_t *irq, uint32_t value, void *param) { has_room = 1; }
static void no_room(avr_irq_t *irq, uint32_t value, void *param) { has_room = 0; }

static void open_terminal(void) {
    terminal = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK);
    if (terminal < 0 || grantpt(terminal) || unlockpt(terminal)) {
        perror("no pseudo-terminal");
        exit(1);
    }
    /* Held open, so that nobody at the port is no hang-up. */
    int port = open(ptsname(terminal), O_RDWR | O_NOCTTY);
    struct termios raw;
    tcgetattr(port, &raw);
    cfmakeraw(&raw);
    tcsetattr(port, TCSANOW, &raw);
    printf("port %s\n", ptsname(terminal));
    fflush(stdout);
}

int main(int argc, char **argv) {
    elf_firmware_t firmware = {0};
    if (argc != 2 || elf_read_firmware(argv[1], &firmware)) {
        fprintf(stderr, "usage: simulator stepper.elf\n");
        return 2;
    }
    avr = avr_make_mcu_by_name("atmega328p");
    if (!avr)
        return 1;
    avr_init(avr);
    avr_load_firmware(avr, &firmware);
    avr->frequency = FREQUENCY;
    avr->log = LOG_ERROR;
    signal(SIGTERM, stop);
    signal(SIGINT, stop);
    open_terminal();

    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_t *input = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), sent, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XON), room, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XOFF), no_room, NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), IOPORT_IRQ_REG_PORT), coils_changed, NULL);
    switch_pin = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), 2);
    set_switch();

    /* The port is looked at a thousand times a second of the firmware's time. */
    avr_cycle_count_t look = 0;
    while (!stopped) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) {
            fprintf(stderr, "the firmware crashed\n");
            _exit(1);
        }
        if (avr->cycle >= look) {
            look = avr->cycle + FREQUENCY / 1000;
            uint8_t byte;
            while (has_room && read(terminal, &byte, 1) == 1)
                avr_raise_irq(input, byte);
        }
    }
    printf("position %ld illegal %ld fastest_us %.0f\n", position, illegal, fastest / (FREQUENCY / 1e6));
    fflush(stdout);
    _exit(0);
}
