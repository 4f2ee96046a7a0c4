/* The board's chip in a process: an ATmega328P of simavr that moves only when it is told to.
 *
 * Loaded by ctypes. Bytes go in at the speed of the line, the analog input gets its noise and its
 * mains pickup at the instant of each conversion, and the heater pin is looked at after every
 * instruction, so that on-times are exact to a cycle. Equal calls give equal results.
 */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <avr_adc.h>
#include <avr_extint.h>
#include <avr_ioport.h>
#include <avr_uart.h>
#include <sim_avr.h>
#include <sim_elf.h>

#define FREQUENCY 16000000UL
#define BYTE_CYCLES 1389 /* ten bits at 115200 baud */
#define QUEUE 65536U     /* a power of two */

#define DDRD_ADDRESS 0x2A
#define PORTD_ADDRESS 0x2B
#define HEATER_MASK (1U << 3)
#define ZERO_CROSS_BIT 2

struct queue {
    uint8_t bytes[QUEUE];
    uint32_t head, tail;
};

struct board {
    avr_t *avr;
    struct queue in, out;
    uint64_t on_cycles, edges, off_since;
    uint64_t half_wave_cycles;
    uint64_t due; /* where the chip should be; a sleeping one overshoots to its next event */
    int level, crossing_high, feeding;
    double millivolts, noise_mv, pickup_mv, mains_hz;
    uint64_t random;
};

static void silent(avr_t *avr, const int level, const char *format, va_list arguments)
{
    (void)avr, (void)level, (void)format, (void)arguments;
}

static void no_sleep(avr_t *avr, avr_cycle_count_t cycles) { (void)avr, (void)cycles; }

static int push(struct queue *queue, uint8_t byte)
{
    if (queue->head - queue->tail == QUEUE)
        return 0;
    queue->bytes[queue->head++ % QUEUE] = byte;
    return 1;
}

static void sent(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq;
    push(&((struct board *)parameter)->out, (uint8_t)value);
}

static double uniform(struct board *board)
{
    board->random ^= board->random << 13;
    board->random ^= board->random >> 7;
    board->random ^= board->random << 17;
    return (double)(board->random >> 11) / 9007199254740992.0;
}

/* Standard normal to a few permille: the sum of twelve uniforms. */
static double normal(struct board *board)
{
    double sum = -6.0;
    for (int i = 0; i < 12; i++)
        sum += uniform(board);
    return sum;
}

static void convert(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
    (void)irq, (void)value;
    struct board *board = parameter;
    double t_s = (double)board->avr->cycle / FREQUENCY;
    double mv = board->millivolts + board->noise_mv * normal(board) +
                board->pickup_mv * sin(2.0 * M_PI * board->mains_hz * t_s);
    if (mv < 0.0)
        mv = 0.0;
    /* simavr scales by 1023 where the converter scales by 1024; it takes whole millivolts. */
    avr_raise_irq(avr_io_getirq(board->avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_ADC0),
                  (uint32_t)(mv * 1024.0 / 1023.0 + 0.5));
}

static avr_cycle_count_t feed(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
    struct board *board = parameter;
    if (board->in.head == board->in.tail) {
        board->feeding = 0;
        return 0;
    }
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT),
                  board->in.bytes[board->in.tail++ % QUEUE]);
    return when + BYTE_CYCLES;
}

static avr_cycle_count_t cross(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
    struct board *board = parameter;
    uint64_t high = FREQUENCY / 2000; /* pulses of half a millisecond */
    board->crossing_high = !board->crossing_high && board->half_wave_cycles != 0;
    /* Without this every write to the port would show the pull-up at the pin: a false edge. */
    avr_ioport_external_t driven = {.name = 'D',
                                    .mask = board->half_wave_cycles != 0 ? 1U << ZERO_CROSS_BIT : 0,
                                    .value = (unsigned)board->crossing_high << ZERO_CROSS_BIT};
    avr_ioctl(avr, AVR_IOCTL_IOPORT_SET_EXTERNAL('D'), &driven);
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('D'), ZERO_CROSS_BIT),
                  (uint32_t)board->crossing_high);
    if (board->half_wave_cycles == 0)
        return 0;
    return when + (board->crossing_high ? high : board->half_wave_cycles - high);
}

struct board *thermodaq_sim_new(const char *elf, uint64_t seed)
{
    avr_global_logger_set(silent);
    elf_firmware_t firmware;
    memset(&firmware, 0, sizeof firmware);
    if (elf_read_firmware(elf, &firmware) != 0)
        return NULL;
    struct board *board = calloc(1, sizeof *board);
    board->avr = avr_make_mcu_by_name("atmega328p");
    if (board->avr == NULL) {
        free(board);
        return NULL;
    }
    avr_init(board->avr);
    firmware.frequency = FREQUENCY;
    firmware.vcc = firmware.avcc = firmware.aref = 5000;
    avr_load_firmware(board->avr, &firmware);
    board->avr->log = LOG_NONE;
    board->avr->sleep = no_sleep;
    board->random = seed * 0x9E3779B97F4A7C15ULL + 1;
    board->mains_hz = 50.0;
    /* The heater pin is INT1's too; a low one would be polled every cycle, 30 times slower. */
    avr_extint_set_strict_lvl_trig(board->avr, 1, 0);
    uint32_t flags = 0; /* neither echo to the terminal nor real-time naps */
    avr_ioctl(board->avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(
        avr_io_getirq(board->avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), sent, board);
    avr_irq_register_notify(
        avr_io_getirq(board->avr, AVR_IOCTL_ADC_GETIRQ, ADC_IRQ_OUT_TRIGGER), convert, board);
    return board;
}

void thermodaq_sim_free(struct board *board)
{
    avr_terminate(board->avr);
    free(board);
}

/* Go on for `cycles`; 0, or -1 when the chip has crashed. */
int thermodaq_sim_run(struct board *board, uint64_t cycles)
{
    avr_t *avr = board->avr;
    board->due += cycles;
    while (avr->cycle < board->due) {
        uint64_t before = avr->cycle;
        int state = avr_run(avr);
        if (state == cpu_Crashed || state == cpu_Done)
            return -1;
        if (board->level)
            board->on_cycles += avr->cycle - before;
        int level = (avr->data[DDRD_ADDRESS] & avr->data[PORTD_ADDRESS] & HEATER_MASK) != 0;
        board->edges += level && !board->level;
        if (board->level && !level)
            board->off_since = avr->cycle;
        board->level = level;
    }
    return 0;
}

uint32_t thermodaq_sim_send(struct board *board, const uint8_t *bytes, uint32_t length)
{
    uint32_t taken = 0;
    while (taken < length && push(&board->in, bytes[taken]))
        taken++;
    if (taken != 0 && !board->feeding) {
        board->feeding = 1;
        avr_cycle_timer_register(board->avr, BYTE_CYCLES, feed, board);
    }
    return taken;
}

uint32_t thermodaq_sim_receive(struct board *board, uint8_t *bytes, uint32_t size)
{
    uint32_t count = 0;
    while (count < size && board->out.tail != board->out.head)
        bytes[count++] = board->out.bytes[board->out.tail++ % QUEUE];
    return count;
}

void thermodaq_sim_analog(struct board *board, double millivolts, double noise_mv,
                          double pickup_mv, double mains_hz)
{
    board->millivolts = millivolts;
    board->noise_mv = noise_mv;
    board->pickup_mv = pickup_mv;
    board->mains_hz = mains_hz;
}

/* Crossings every `half_wave_cycles`; 0 leaves the input open. */
void thermodaq_sim_crossings(struct board *board, uint64_t half_wave_cycles)
{
    avr_cycle_timer_cancel(board->avr, cross, board);
    board->half_wave_cycles = half_wave_cycles;
    if (half_wave_cycles != 0)
        avr_cycle_timer_register(board->avr, half_wave_cycles, cross, board);
}

void thermodaq_sim_reset(struct board *board)
{
    avr_reset(board->avr);
    if (board->level)
        board->off_since = board->avr->cycle; /* a reset chip lets go of its pins at once */
    board->level = 0;
    board->in.tail = board->in.head;
    board->feeding = 0;
    uint64_t half_wave_cycles = board->half_wave_cycles;
    thermodaq_sim_crossings(board, half_wave_cycles);
}

/* Write a register as an instruction would: how a test breaks the chip. */
void thermodaq_sim_poke(struct board *board, uint16_t address, uint8_t value)
{
    avr_t *avr = board->avr;
    uint16_t io = AVR_DATA_TO_IO(address);
    if (avr->io[io].w.c != NULL)
        avr->io[io].w.c(avr, address, value, avr->io[io].w.param);
    else
        avr->data[address] = value;
}

uint64_t thermodaq_sim_cycle(const struct board *board) { return board->avr->cycle; }
uint64_t thermodaq_sim_on_cycles(const struct board *board) { return board->on_cycles; }
uint64_t thermodaq_sim_edges(const struct board *board) { return board->edges; }
uint64_t thermodaq_sim_off_since(const struct board *board) { return board->off_since; }
int thermodaq_sim_level(const struct board *board) { return board->level; }
uint8_t thermodaq_sim_peek(const struct board *board, uint16_t address)
{
    return board->avr->data[address];
}
