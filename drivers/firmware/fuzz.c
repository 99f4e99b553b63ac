/* Test program that sends malformed input to the board, and checks invariants.
 *
 *     cc -std=c99 -g -O1 -fsanitize=address,undefined fuzz.c teleop_board.c -o fuzz
 *     ./fuzz [INPUTS [SEED]]
 *
 * An input is a sequence of random bytes, or a frame of the host. In most frames, bytes are changed
 * or duplicated, or the end is removed. One in eight inputs is an unchanged frame, so that the
 * board reaches all of its states. The program prints the number of accepted frames, and how
 * often each state occurred. It aborts if an invariant is violated.
 */
#include "teleop_board.h"

#include <stdio.h>
#include <stdlib.h>

enum { INPUTS = 1000000, LONGEST = 80 };

static uint32_t seed = 1;
static uint32_t now_us = UINT32_MAX - 5000000u;

static uint32_t any(uint32_t below)
{
    seed ^= seed << 13;
    seed ^= seed >> 17;
    seed ^= seed << 5;
    return seed % below;
}

static void hold(bool invariant, const char *what)
{
    if (!invariant) {
        fprintf(stderr, "broken: %s\n", what);
        abort();
    }
}

static size_t whole_frame(uint8_t *frame, uint16_t sequence)
{
    static const uint8_t payload[6] = {0, 0, 4, 1, 8, 0};
    uint8_t type = (uint8_t)(any(7) ? 1 + any(5) : any(256));
    uint8_t body[16] = {type, (uint8_t)sequence, (uint8_t)(sequence >> 8)};
    size_t length = 3 + (type < 6 ? payload[type] : any(9));
    uint16_t crc = 0xFFFF;

    for (size_t i = 3; i < length; i++) {
        body[i] = (uint8_t)(any(2) ? any(256) : any(4));
    }
    for (size_t i = 0; i < length; i++) {
        crc ^= body[i];
        for (int bit = 0; bit < 8; bit++) {
            crc = (uint16_t)(crc & 1 ? crc >> 1 ^ 0x8408 : crc >> 1);
        }
    }
    crc = (uint16_t)~crc;
    body[length++] = (uint8_t)crc;
    body[length++] = (uint8_t)(crc >> 8);

    size_t code = 0, to = 1;
    for (size_t i = 0; i < length; i++) {
        if (body[i]) {
            frame[to++] = body[i];
        } else {
            frame[code] = (uint8_t)(to - code);
            code = to++;
        }
    }
    frame[code] = (uint8_t)(to - code);
    frame[to++] = 0;
    return to;
}

static size_t mutated(uint8_t *frame, size_t length)
{
    for (uint32_t times = 1 + any(3); times > 0; times--) {
        size_t at = any((uint32_t)length);
        switch (any(4)) {
        case 0:
            frame[at] = (uint8_t)any(256);
            break;
        case 1:
            frame[at] ^= (uint8_t)(1u << any(8));
            break;
        case 2:
            length = at + 1;
            break;
        default:
            for (size_t i = length; i > at; i--) {
                frame[i] = frame[i - 1];
            }
            length++;
        }
    }
    return length;
}

static void check(teleop_board *board, const teleop_inputs *inputs)
{
    uint8_t frame[TELEOP_FRAME_MAX];
    size_t length;
    int frames = 0;

    while ((length = teleop_board_poll(board, inputs, now_us, frame)) > 0) {
        hold(length <= TELEOP_FRAME_MAX && frame[length - 1] == 0, "a frame ends with a zero");
        for (size_t i = 0; i + 1 < length; i++) {
            hold(frame[i] != 0, "no zero within a frame");
        }
        hold(++frames <= 3, "one answer of a kind and one sample at a time");
    }
    for (int i = 0; i < TELEOP_AXES; i++) {
        hold(!board->enabled[i] || board->state == TELEOP_ENABLED, "enabled in that state alone");
        hold(board->enabled[i] || board->velocity[i] == 0, "no velocity unless enabled");
        hold(board->enabled[i] || board->force[i] == 0, "no force unless enabled");
        hold(!board->enabled[i] || !(inputs->emergency_stop || inputs->drive_fault),
             "not enabled against an input");
    }
    hold(board->force[0] == 0 && board->velocity[1] == 0, "each axis has one kind of command");
    hold(board->state <= TELEOP_DRIVE_FAULT, "a known state");
}

int main(int argc, char **argv)
{
    static const teleop_identity identity = {1, 0, 7, 2, 2, 2, 4, 2000, 2};
    uint32_t inputs_left = argc > 1 ? (uint32_t)strtoul(argv[1], NULL, 10) : INPUTS;
    unsigned long states[TELEOP_DRIVE_FAULT + 1] = {0}, taken = 0, moved = 0, pushed = 0;
    uint16_t sequence = 0;
    teleop_inputs inputs = {0};
    teleop_board board;

    seed = argc > 2 ? (uint32_t)strtoul(argv[2], NULL, 10) | 1u : 1u;
    teleop_board_init(&board, &identity);
    for (; inputs_left > 0; inputs_left--) {
        uint8_t bytes[LONGEST + 4];
        size_t length;

        if (any(4) == 0) {
            length = 1 + any(LONGEST);
            for (size_t i = 0; i < length; i++) {
                bytes[i] = (uint8_t)any(256);
            }
        } else {
            length = whole_frame(bytes, sequence);
            if (any(6) == 0) {
                sequence++;
            } else {
                length = mutated(bytes, length);
            }
        }
        uint16_t before = board.last_received;
        for (size_t i = 0; i < length; i++) {
            teleop_board_receive(&board, bytes[i], now_us);
        }
        taken += board.last_received != before;
        now_us += any(8) ? any(500) : any(20000);
        inputs.time_us = now_us;
        inputs.emergency_stop = inputs.emergency_stop ? any(8) != 0 : any(200) == 0;
        inputs.drive_fault = inputs.drive_fault ? any(8) != 0 : any(200) == 0;
        check(&board, &inputs);
        states[board.state]++;
        moved += board.velocity[0] != 0;
        pushed += board.force[1] != 0;
    }
    printf("taken %lu moved %lu pushed %lu idle %lu enabled %lu watchdog %lu stop %lu fault %lu\n",
           taken, moved, pushed, states[0], states[1], states[2], states[3], states[4]);
    return 0;
}
