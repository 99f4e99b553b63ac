/* The board's side of docs/serial-protocol.md, for any microcontroller.
 *
 * Portable C99 without heap, clock or operating system. In the main loop: hand it each byte that
 * came (teleop_board_receive), then what the inputs read (teleop_board_poll), send the frame
 * that it gives if any, and let the axes do as `enabled` and `velocity` say. example.ino shows it.
 *
 * Call teleop_board_poll at least ten times in the shortest watchdog time. One context only: not
 * from an interrupt and the main loop at once.
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
    TELEOP_PROTOCOL_VERSION = 1,
    TELEOP_FORCES = 2,
    TELEOP_AXES = 2,
    TELEOP_ANALOGUES = 4,
    TELEOP_FRAME_MAX = 64,   /* of a frame to the host, with its delimiter */
    TELEOP_RECEIVE_MAX = 32  /* of an encoded frame from the host */
};

typedef enum {
    TELEOP_IDLE = 0,
    TELEOP_ENABLED = 1,
    TELEOP_WATCHDOG = 2,        /* no command came in time; latched until DISABLE, as are: */
    TELEOP_EMERGENCY_STOP = 3,
    TELEOP_DRIVE_FAULT = 4
} teleop_state;

/* What the board is. */
typedef struct {
    uint8_t firmware_major;
    uint8_t firmware_minor;
    uint32_t boot;      /* different after each start: a count kept in EEPROM, or random */
    uint8_t forces;     /* how many of each are connected, the first ones */
    uint8_t encoders;
    uint8_t axes;
    uint8_t analogues;
    uint16_t max_sample_rate_hz;
} teleop_identity;

/* What the board reads, all at one instant. */
typedef struct {
    uint32_t time_us;  /* of the reading, on the clock that is handed to the functions below */
    int32_t force[TELEOP_FORCES];
    int32_t position[TELEOP_AXES];
    int32_t velocity[TELEOP_AXES];
    int32_t analogue[TELEOP_ANALOGUES];
    bool emergency_stop;  /* the emergency-stop circuit is open */
    bool drive_fault;     /* a drive says so */
} teleop_inputs;

typedef struct {
    /* What the axes have to do; all else is the protocol's own. */
    bool enabled[TELEOP_AXES];     /* false: brake, or take the power off */
    int32_t velocity[TELEOP_AXES]; /* [counts]; 0 unless enabled */
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

/* At start: the axes are idle, and the host is told who is here. */
void teleop_board_init(teleop_board *board, const teleop_identity *identity);

/* Takes one byte from the host, whatever it is. now_us wraps at 2^32. */
void teleop_board_receive(teleop_board *board, uint8_t byte, uint32_t now_us);

/* Acts on the inputs and on the watchdog, and gives the next frame that is due.
 * Returns the frame's length, 0 for none. Call again while it gives one. */
size_t teleop_board_poll(teleop_board *board, const teleop_inputs *inputs, uint32_t now_us,
                         uint8_t frame[TELEOP_FRAME_MAX]);

#ifdef __cplusplus
}
#endif

#endif
