// Board with one force input, one encoder, one analogue input and one axis. Copy teleop_board.h and
// teleop_board.c to this folder. Replace the names in capitals: pins, converter, encoder and motor.
#include "teleop_board.h"

teleop_board board;

void setup() {
  Serial.begin(921600);  // a board with native USB ignores the baud rate
  pinMode(EMERGENCY_STOP_PIN, INPUT_PULLUP);  // closed to ground, so a broken wire also stops
  pinMode(DRIVE_FAULT_PIN, INPUT_PULLUP);
  teleop_identity identity = {};
  identity.firmware_major = 1;
  identity.boot = RANDOM_OR_COUNTED_UP_IN_EEPROM();
  identity.forces = identity.encoders = identity.axes = identity.analogues = 1;
  identity.max_sample_rate_hz = 1000;
  teleop_board_init(&board, &identity);
}

void loop() {
  while (Serial.available()) teleop_board_receive(&board, Serial.read(), micros());

  teleop_inputs inputs = {};
  inputs.time_us = micros();
  inputs.force[0] = LATEST_OF_THE_CONVERTER();  // its interrupt stores the value; do not wait here
  inputs.position[0] = ENCODER_COUNTS();
  inputs.velocity[0] = ENCODER_COUNTS_PER_SECOND();
  inputs.analogue[0] = LATEST_OF_ANALOGUE_INPUT();
  inputs.emergency_stop = digitalRead(EMERGENCY_STOP_PIN) == HIGH;
  inputs.drive_fault = digitalRead(DRIVE_FAULT_PIN) == LOW;

  uint8_t frame[TELEOP_FRAME_MAX];
  while (size_t length = teleop_board_poll(&board, &inputs, micros(), frame)) {
    if ((size_t)Serial.availableForWrite() >= length) Serial.write(frame, length);
  }

  MOTOR_POWER(board.enabled[0]);
  MOTOR_VELOCITY(board.velocity[0]);
}
