/* Test of the board with libFuzzer. libFuzzer uses code coverage to search for new inputs.
 *
 *     clang -g -O1 -fsanitize=fuzzer,address,undefined libfuzzer.c teleop_board.c -o fuzz
 *     ./fuzz -max_total_time=60
 */
#include "teleop_board.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const teleop_identity identity = {1, 0, 7, 2, 2, 2, 4, 2000};
    teleop_inputs inputs = {0};
    teleop_board board;
    uint8_t frame[TELEOP_FRAME_MAX];

    teleop_board_init(&board, &identity);
    for (size_t i = 0; i < size; i++) {
        teleop_board_receive(&board, data[i], inputs.time_us);
        inputs.time_us += 100;
        while (teleop_board_poll(&board, &inputs, inputs.time_us, frame) > 0) {
        }
    }
    return 0;
}
