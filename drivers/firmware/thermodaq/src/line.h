/* Framing: lines with a sequence number and a checksum, taken apart and put together. */
#ifndef THERMODAQ_LINE_H
#define THERMODAQ_LINE_H

#include <stdbool.h>
#include <stdint.h>

#define ARGUMENTS_MAX 5U

enum refusal {
    ACCEPTED = 0,
    REFUSED_TOO_LONG = 1,
    REFUSED_MALFORMED = 2,
    REFUSED_CHECKSUM = 3,
    REFUSED_COMMAND = 4,
    REFUSED_ARGUMENTS = 5,
    REFUSED_RANGE = 6,
    REFUSED_UNCONFIGURED = 7,
    REFUSED_HEATING = 8
};

struct request {
    char sequence[2]; /* as it came, to be sent back */
    char command;
    uint8_t count; /* of arguments */
    uint16_t arguments[ARGUMENTS_MAX];
};

/* Take `body`, what came between '>' and the line feed, apart. */
enum refusal line_parse(const char *body, uint8_t length, struct request *into);

/* A reply is begun, given fields, and sent. */
void reply_begin(const char *sequence, char command);
void reply_number(uint32_t value);
void reply_hex(uint8_t value);
void reply_word(const char *word);
void reply_send(void);

#endif
