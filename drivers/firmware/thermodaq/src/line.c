#include "line.h"

#include <util/crc16.h>

#include "uart.h"

#define TAIL 5U /* "*CCCC" */

static char reply[80];
static uint8_t reply_length;

/* CRC-16, polynomial 0x1021, start 0xFFFF, no reflection ("CCITT-FALSE", "IBM-3740"). */
static uint16_t checksum(const char *bytes, uint8_t length)
{
    uint16_t crc = 0xFFFF;
    while (length--)
        crc = _crc_xmodem_update(crc, (uint8_t)*bytes++);
    return crc;
}

static int8_t hex_value(char digit)
{
    if (digit >= '0' && digit <= '9')
        return (int8_t)(digit - '0');
    if (digit >= 'A' && digit <= 'F')
        return (int8_t)(digit - 'A' + 10);
    return -1;
}

static char hex_digit(uint8_t value)
{
    value &= 0x0F;
    return (char)(value < 10 ? '0' + value : 'A' + value - 10);
}

/* Decimal arguments, each after one space, 1 to 5 digits, at most 65535. */
static bool parse_arguments(const char *text, const char *end, struct request *into)
{
    into->count = 0;
    while (text < end) {
        uint32_t value = 0;
        uint8_t digits = 0;
        if (*text++ != ' ' || into->count == ARGUMENTS_MAX)
            return false;
        for (; text < end && *text >= '0' && *text <= '9'; text++, digits++) {
            if (digits == 5)
                return false;
            value = value * 10 + (uint8_t)(*text - '0');
        }
        if (digits == 0 || value > UINT16_MAX)
            return false;
        into->arguments[into->count++] = (uint16_t)value;
    }
    return true;
}

enum refusal line_parse(const char *body, uint8_t length, struct request *into)
{
    if (length < 4 + TAIL || body[length - TAIL] != '*')
        return REFUSED_MALFORMED;
    const char *end = body + length - TAIL;
    uint16_t given = 0;
    for (const char *digit = end + 1; digit < body + length; digit++) {
        int8_t value = hex_value(*digit);
        if (value < 0)
            return REFUSED_MALFORMED;
        given = (uint16_t)(given << 4 | (uint8_t)value);
    }
    if (checksum(body, length - TAIL) != given)
        return REFUSED_CHECKSUM;
    if (hex_value(body[0]) < 0 || hex_value(body[1]) < 0 || body[2] != ' ')
        return REFUSED_MALFORMED;
    into->sequence[0] = body[0];
    into->sequence[1] = body[1];
    into->command = body[3];
    /* From here the sender is known, so that the refusal carries the sequence number. */
    return parse_arguments(body + 4, end, into) ? ACCEPTED : REFUSED_ARGUMENTS;
}

static void put(char c)
{
    if (reply_length < sizeof reply - TAIL - 1) /* room for the tail and the line feed */
        reply[reply_length++] = c;
}

void reply_begin(const char *sequence, char command)
{
    reply_length = 0;
    put('<');
    put(sequence[0]);
    put(sequence[1]);
    put(' ');
    put(command);
}

void reply_number(uint32_t value)
{
    char digits[10];
    uint8_t count = 0;
    for (; value > UINT16_MAX; value /= 10) /* 32-bit division is slow: no more than needed */
        digits[count++] = (char)('0' + value % 10);
    uint16_t rest = (uint16_t)value;
    do {
        uint16_t tenth = rest / 10;
        digits[count++] = (char)('0' + (rest - tenth * 10));
        rest = tenth;
    } while (rest != 0);
    put(' ');
    while (count != 0)
        put(digits[--count]);
}

void reply_hex(uint8_t value)
{
    put(' ');
    put(hex_digit(value >> 4));
    put(hex_digit(value));
}

void reply_word(const char *word)
{
    put(' ');
    while (*word != '\0')
        put(*word++);
}

/* Where the line is full the reply is lost, never waited for: the host asks again. */
void reply_send(void)
{
    uint16_t crc = checksum(reply + 1, reply_length - 1);
    reply[reply_length++] = '*';
    for (int8_t shift = 12; shift >= 0; shift -= 4)
        reply[reply_length++] = hex_digit((uint8_t)(crc >> shift));
    reply[reply_length++] = '\n';
    (void)uart_write(reply, reply_length);
}
