/* Simulated board on a file descriptor, for example on the master of a pseudo-terminal.
 *
 *     posix_main FD [FORCE_AXES]
 *
 * FORCE_AXES is the bit mask of the axes that accept a force. One count is 1 um, and a force of one
 * count moves an axis with 1 um/s. The positions are integrals of the velocities. The forces are 100 and 200
 * counts. The analogue inputs are 10, 20, 30 and 40 counts. On standard input, the letter e toggles
 * the emergency stop, f toggles the drive fault, and r resets the board. The program ends at the
 * end of standard input.
 */
#define _POSIX_C_SOURCE 200809L
#include "teleop_board.h"

#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <time.h>
#include <unistd.h>

static teleop_identity identity = {1, 0, 0xB0A2D001, 2, 2, 2, 4, 2000, 0};

static uint32_t micros(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)((uint64_t)now.tv_sec * 1000000u + (uint64_t)now.tv_nsec / 1000u);
}

static void start(teleop_board *board, teleop_inputs *inputs)
{
    static uint32_t boots;
    teleop_identity who = identity;
    who.boot += boots++;
    teleop_board_init(board, &who);
    memset(inputs, 0, sizeof *inputs);
    for (int i = 0; i < TELEOP_FORCES; i++) {
        inputs->force[i] = 100 * (i + 1);
    }
    for (int i = 0; i < TELEOP_ANALOGUES; i++) {
        inputs->analogue[i] = 10 * (i + 1);
    }
    inputs->time_us = micros();
}

static void move(const teleop_board *board, teleop_inputs *inputs, uint32_t now_us)
{
    static double travel[TELEOP_AXES];
    double dt = (now_us - inputs->time_us) * 1e-6;
    inputs->time_us = now_us;
    for (int i = 0; i < TELEOP_AXES; i++) {
        inputs->velocity[i] = board->velocity[i] + board->force[i];
        travel[i] += inputs->velocity[i] * dt;
        inputs->position[i] = (int32_t)travel[i];
    }
}

int main(int argc, char **argv)
{
    teleop_board board;
    teleop_inputs inputs;
    int host = argc > 1 ? atoi(argv[1]) : -1;

    identity.force_axes = argc > 2 ? (uint8_t)atoi(argv[2]) : 0;

    if (host < 0 || fcntl(host, F_SETFL, O_NONBLOCK) < 0) {
        return 2;
    }
    start(&board, &inputs);
    for (;;) {
        uint8_t bytes[256], frame[TELEOP_FRAME_MAX];
        struct timeval pause = {0, 200};
        fd_set ready;
        size_t length;

        FD_ZERO(&ready);
        FD_SET(STDIN_FILENO, &ready);
        FD_SET(host, &ready);
        select(host + 1, &ready, NULL, NULL, &pause);
        if (FD_ISSET(STDIN_FILENO, &ready)) {
            char order;
            if (read(STDIN_FILENO, &order, 1) != 1) {
                return 0;
            }
            inputs.emergency_stop ^= order == 'e';
            inputs.drive_fault ^= order == 'f';
            if (order == 'r') {
                start(&board, &inputs);
            }
        }
        if (FD_ISSET(host, &ready)) {
            ssize_t got = read(host, bytes, sizeof bytes);
            for (ssize_t i = 0; i < got; i++) {
                teleop_board_receive(&board, bytes[i], micros());
            }
        }
        move(&board, &inputs, micros());
        while ((length = teleop_board_poll(&board, &inputs, micros(), frame)) > 0) {
            if (write(host, frame, length) < 0) {
                break;
            }
        }
    }
}
