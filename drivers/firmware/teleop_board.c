#include "teleop_board.h"

enum { HELLO = 0x01, CONFIGURE, ENABLE, COMMAND, DISABLE };
enum { IDENTITY = 0x81, CONFIGURED, SAMPLE };
enum { HEAD = 3, CHECKSUM = 2, BODY_MAX = TELEOP_FRAME_MAX - 2 };
enum { WATCHDOG_LEAST_MS = 1, WATCHDOG_MOST_MS = 1000 };

/* ---- bytes ---- */

static uint16_t get_u16(const uint8_t *at)
{
    return (uint16_t)(at[0] | (unsigned)at[1] << 8);
}

static int32_t get_i32(const uint8_t *at)
{
    uint32_t bits = (uint32_t)get_u16(at) | (uint32_t)get_u16(at + 2) << 16;
    return bits <= INT32_MAX ? (int32_t)bits : (int32_t)(bits - INT32_MAX - 1u) + INT32_MIN;
}

typedef struct {
    uint8_t bytes[BODY_MAX];
    size_t length;
} message;

static void put_u8(message *to, unsigned value)
{
    to->bytes[to->length++] = (uint8_t)value;
}

static void put_u16(message *to, unsigned value)
{
    put_u8(to, value & 0xFFu);
    put_u8(to, value >> 8 & 0xFFu);
}

static void put_u32(message *to, uint32_t value)
{
    put_u16(to, (unsigned)(value & 0xFFFFu));
    put_u16(to, (unsigned)(value >> 16));
}

static void put_counts(message *to, const int32_t *counts, size_t number)
{
    for (size_t i = 0; i < number; i++) {
        put_u32(to, (uint32_t)counts[i]);
    }
}

/* Returns the CRC-16/IBM-SDLC (X.25), computed for half a byte at a time. */
static uint16_t checksum(const uint8_t *bytes, size_t length)
{
    static const uint16_t step[16] = {
        0x0000, 0x1081, 0x2102, 0x3183, 0x4204, 0x5285, 0x6306, 0x7387,
        0x8408, 0x9489, 0xA50A, 0xB58B, 0xC60C, 0xD68D, 0xE70E, 0xF78F,
    };
    uint16_t crc = 0xFFFF;
    for (size_t i = 0; i < length; i++) {
        crc = (uint16_t)(crc >> 4 ^ step[(crc ^ bytes[i]) & 0xF]);
        crc = (uint16_t)(crc >> 4 ^ step[(crc ^ bytes[i] >> 4) & 0xF]);
    }
    return (uint16_t)~crc;
}

/* ---- framing: COBS. Frames have fewer than 254 bytes, so no code byte is 0xFF. ---- */

/* Decodes a frame in place. Returns the length of the data, 0 if the frame is malformed. */
static size_t cobs_decode(uint8_t *bytes, size_t length)
{
    size_t from = 0, to = 0;
    while (from < length) {
        size_t next = from + bytes[from];
        if (bytes[from] == 0 || next > length) {
            return 0;
        }
        for (from++; from < next; from++) {
            bytes[to++] = bytes[from];
        }
        if (from < length) {
            bytes[to++] = 0;
        }
    }
    return to;
}

static size_t cobs_encode(const message *from, uint8_t frame[TELEOP_FRAME_MAX])
{
    size_t code = 0, to = 1;
    for (size_t i = 0; i < from->length; i++) {
        if (from->bytes[i] == 0) {
            frame[code] = (uint8_t)(to - code);
            code = to++;
        } else {
            frame[to++] = from->bytes[i];
        }
    }
    frame[code] = (uint8_t)(to - code);
    frame[to++] = 0;
    return to;
}

static message begin(teleop_board *board, unsigned type, uint32_t time_us)
{
    message begun = {{0}, 0};
    put_u8(&begun, type);
    put_u16(&begun, board->sequence++);
    put_u32(&begun, time_us);
    return begun;
}

static size_t finish(message *ended, uint8_t frame[TELEOP_FRAME_MAX])
{
    put_u16(ended, checksum(ended->bytes, ended->length));
    return cobs_encode(ended, frame);
}

/* ---- state ---- */

static void halt(teleop_board *board, teleop_state state)
{
    board->state = state;
    for (int i = 0; i < TELEOP_AXES; i++) {
        board->enabled[i] = false;
        board->velocity[i] = board->force[i] = 0;
    }
}

static void watch(teleop_board *board, uint32_t now_us)
{
    if (board->state != TELEOP_ENABLED) {
        return;
    }
    if (board->emergency_stop) {
        halt(board, TELEOP_EMERGENCY_STOP);
    } else if (board->drive_fault) {
        halt(board, TELEOP_DRIVE_FAULT);
    } else if (now_us - board->commanded_us > board->watchdog_ms * (uint32_t)1000) {
        halt(board, TELEOP_WATCHDOG);
    }
}

static void enable(teleop_board *board, unsigned axes, uint32_t now_us)
{
    if (board->state == TELEOP_IDLE) {
        board->state = TELEOP_ENABLED;
        board->commanded_us = now_us;
        watch(board, now_us);
    }
    for (unsigned i = 0; i < TELEOP_AXES && board->state == TELEOP_ENABLED; i++) {
        if (axes >> i & 1u && i < board->identity.axes) {
            board->enabled[i] = true;
        }
    }
}

static void command(teleop_board *board, const uint8_t *values, uint32_t now_us)
{
    if (board->state != TELEOP_ENABLED) {
        return;
    }
    board->commanded_us = now_us;
    for (int i = 0; i < TELEOP_AXES; i++) {
        bool by_force = board->identity.force_axes >> i & 1u;
        int32_t value = board->enabled[i] ? get_i32(values + 4 * i) : 0;
        board->velocity[i] = by_force ? 0 : value;
        board->force[i] = by_force ? value : 0;
    }
}

static uint16_t within(uint16_t value, uint16_t least, uint16_t most)
{
    uint16_t capped = value > most ? most : value;
    return capped < least ? least : capped;
}

static void configure(teleop_board *board, const uint8_t *settings, uint32_t now_us)
{
    halt(board, TELEOP_IDLE);
    board->watchdog_ms = within(get_u16(settings), WATCHDOG_LEAST_MS, WATCHDOG_MOST_MS);
    board->sample_rate_hz = within(get_u16(settings + 2), 1, board->identity.max_sample_rate_hz);
    board->sample_us = now_us;
    board->configured = board->configured_due = true;
}

/* ---- messages ---- */

/* Returns the payload length of a message type; -1 for an unknown type. */
static int payload_length(uint8_t type)
{
    switch (type) {
    case HELLO:
    case DISABLE:
        return 0;
    case ENABLE:
        return 1;
    case CONFIGURE:
        return 4;
    case COMMAND:
        return 4 * TELEOP_AXES;
    default:
        return -1;
    }
}

/* Processes a message; returns whether the board accepts it. */
static bool take(teleop_board *board, const uint8_t *body, size_t length, uint32_t now_us)
{
    uint8_t type = body[0];
    uint16_t sequence = get_u16(body + 1);
    const uint8_t *payload = body + HEAD;
    bool newer = (uint16_t)(sequence - board->last_received - 1) < 0x7FFF;

    if ((int)length - HEAD != payload_length(type)) {
        return false;
    }
    if (type != HELLO && board->in_session && !newer) {
        return false;
    }
    board->last_received = sequence;
    board->in_session = true;
    watch(board, now_us);
    if (type == HELLO) {
        halt(board, TELEOP_IDLE);
        board->configured = false;
        board->rejected = 0;
    }
    if (type == CONFIGURE) {
        configure(board, payload, now_us);
    } else if (!board->configured) {
        board->identity_due = true;
    } else if (type == ENABLE) {
        enable(board, payload[0], now_us);
    } else if (type == COMMAND) {
        command(board, payload, now_us);
    } else {
        halt(board, TELEOP_IDLE);
    }
    return true;
}

void teleop_board_init(teleop_board *board, const teleop_identity *identity)
{
    *board = (teleop_board){0};
    board->identity = *identity;
    board->identity_due = true;
}

void teleop_board_receive(teleop_board *board, uint8_t byte, uint32_t now_us)
{
    if (byte != 0) {
        if (board->length < TELEOP_RECEIVE_MAX) {
            board->received[board->length++] = byte;
        } else {
            board->overlong = true;
        }
        return;
    }
    if (board->length > 0) {
        uint8_t *body = board->received;
        size_t length = board->overlong ? 0 : cobs_decode(body, board->length);
        bool taken = length >= HEAD + CHECKSUM
                     && checksum(body, length - CHECKSUM) == get_u16(body + length - CHECKSUM)
                     && take(board, body, length - CHECKSUM, now_us);
        if (!taken) {
            board->rejected++;
        }
    }
    board->length = 0;
    board->overlong = false;
}

static size_t identity_frame(teleop_board *board, uint32_t now_us, uint8_t frame[])
{
    const teleop_identity *who = &board->identity;
    message answer = begin(board, IDENTITY, now_us);
    put_u8(&answer, who->force_axes ? TELEOP_FORCE_PROTOCOL_VERSION : TELEOP_PROTOCOL_VERSION);
    put_u8(&answer, who->firmware_major);
    put_u8(&answer, who->firmware_minor);
    put_u32(&answer, who->boot);
    put_u8(&answer, who->forces);
    put_u8(&answer, who->encoders);
    put_u8(&answer, who->axes);
    put_u8(&answer, who->analogues);
    if (who->force_axes) {
        put_u8(&answer, who->force_axes);
    }
    return finish(&answer, frame);
}

static size_t configured_frame(teleop_board *board, uint32_t now_us, uint8_t frame[])
{
    message answer = begin(board, CONFIGURED, now_us);
    put_u16(&answer, board->watchdog_ms);
    put_u16(&answer, board->sample_rate_hz);
    return finish(&answer, frame);
}

static size_t sample_frame(teleop_board *board, const teleop_inputs *in, uint8_t frame[])
{
    message sample = begin(board, SAMPLE, in->time_us);
    put_u8(&sample, board->state);
    put_u8(&sample, (unsigned)board->enabled[0] | (unsigned)board->enabled[1] << 1);
    put_u8(&sample, (unsigned)in->emergency_stop | (unsigned)in->drive_fault << 1);
    put_u16(&sample, board->last_received);
    put_u16(&sample, board->rejected);
    put_counts(&sample, in->force, TELEOP_FORCES);
    put_counts(&sample, in->position, TELEOP_AXES);
    put_counts(&sample, in->velocity, TELEOP_AXES);
    put_counts(&sample, in->analogue, TELEOP_ANALOGUES);
    return finish(&sample, frame);
}

size_t teleop_board_poll(teleop_board *board, const teleop_inputs *inputs, uint32_t now_us,
                         uint8_t frame[TELEOP_FRAME_MAX])
{
    board->emergency_stop = inputs->emergency_stop;
    board->drive_fault = inputs->drive_fault;
    watch(board, now_us);
    if (board->identity_due) {
        board->identity_due = false;
        return identity_frame(board, now_us, frame);
    }
    if (board->configured_due) {
        board->configured_due = false;
        return configured_frame(board, now_us, frame);
    }
    if (board->configured && now_us - board->sample_us < UINT32_MAX / 2) {
        uint32_t period_us = 1000000u / board->sample_rate_hz;
        bool behind = now_us - board->sample_us >= period_us;
        board->sample_us = (behind ? now_us : board->sample_us) + period_us;
        return sample_frame(board, inputs, frame);
    }
    return 0;
}
