/* The board's side of the protocol in docs/serial-protocol.md, for any microcontroller.
 *
 * The code is portable C99. It needs no heap, clock or operating system. In the main loop, pass
 * each received byte to teleop_board_receive. Then pass the inputs to teleop_board_poll, send the
 * frames that it returns, and set the axes according to `enabled` and `velocity` or `force`. See
 * example.ino, and hapkit.ino for an axis that accepts a force.
 *
 * Call teleop_board_poll at least ten times during the shortest watchdog time. Call these functions
 * either from the main loop or from an interrupt, not from both.
 */
#ifndef TELEOP_BOARD_H
#define TELEOP_BOARD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum {
    TELEOP_PROTOCOL_VERSION = 1,       /* of a board whose axes all accept velocities */
    TELEOP_FORCE_PROTOCOL_VERSION = 2, /* of a board with an axis that accepts a force */
    TELEOP_FORCES = 2,
    TELEOP_AXES = 2,
    TELEOP_ANALOGUES = 4,
    TELEOP_FRAME_MAX = 64,   /* largest length of a frame to the host, with its delimiter */
    TELEOP_RECEIVE_MAX = 32  /* largest length of an encoded frame from the host */
};

typedef enum {
    TELEOP_IDLE = 0,
    TELEOP_ENABLED = 1,
    TELEOP_WATCHDOG = 2,        /* no command in time. States 2, 3 and 4 remain until DISABLE */
    TELEOP_EMERGENCY_STOP = 3,
    TELEOP_DRIVE_FAULT = 4
} teleop_state;

/* Identity of the board. */
typedef struct {
    uint8_t firmware_major;
    uint8_t firmware_minor;
    uint32_t boot;      /* different after each start: a counter in EEPROM, or a random number */
    uint8_t forces;     /* numbers of connected inputs and axes, counted from the first of a kind */
    uint8_t encoders;
    uint8_t axes;
    uint8_t analogues;
    uint16_t max_sample_rate_hz;
    uint8_t force_axes; /* bit i: axis i accepts a force, not a velocity */
} teleop_identity;

/* Readings of all inputs of the board at the same time. */
typedef struct {
    uint32_t time_us;  /* time of the readings, on the same clock as now_us below */
    int32_t force[TELEOP_FORCES];
    int32_t position[TELEOP_AXES];
    int32_t velocity[TELEOP_AXES];
    int32_t analogue[TELEOP_ANALOGUES];
    bool emergency_stop;  /* the emergency-stop circuit is open */
    bool drive_fault;     /* a drive reports a fault */
} teleop_inputs;

typedef struct {
    /* Commands for the axes. Do not use the fields after `state`: they are private. */
    bool enabled[TELEOP_AXES];     /* if false: brake, or switch off the power */
    int32_t velocity[TELEOP_AXES]; /* [counts]; 0 if not enabled, and for an axis with a force */
    int32_t force[TELEOP_AXES];    /* [counts]; 0 if not enabled, and for an axis with a velocity */
    teleop_state state;

    teleop_identity identity;
    uint8_t received[TELEOP_RECEIVE_MAX];
    size_t length;
    bool overlong;
    bool configured;
    bool identity_due;
    bool configured_due;
    bool in_session;
    uint16_t last_received;
    uint16_t sequence;
    uint16_t rejected;
    uint16_t watchdog_ms;
    uint16_t sample_rate_hz;
    uint32_t commanded_us;
    uint32_t sample_us;
    bool emergency_stop;
    bool drive_fault;
} teleop_board;

/* Call this function once at the start. The axes are idle, and the identity is sent to the host. */
void teleop_board_init(teleop_board *board, const teleop_identity *identity);

/* Processes one byte from the host, which may have any value. now_us wraps at 2^32. */
void teleop_board_receive(teleop_board *board, uint8_t byte, uint32_t now_us);

/* Checks the inputs and the watchdog, and writes the next frame that must be sent.
 * Returns the length of the frame, 0 for none. Call the function again until it returns 0. */
size_t teleop_board_poll(teleop_board *board, const teleop_inputs *inputs, uint32_t now_us,
                         uint8_t frame[TELEOP_FRAME_MAX]);

#ifdef __cplusplus
}
#endif

#endif
