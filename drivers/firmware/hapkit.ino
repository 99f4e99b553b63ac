// Paddle with a DC motor and an encoder, as an axis that accepts a force, for example a Hapkit with a
// Teensy. Copy teleop_board.h and teleop_board.c to this folder. Replace the names in capitals.
//
// A count of the force is 1 mN at the handle, and a count of the position is one of the encoder. The
// motor driver has an input for the direction and an input for the duty cycle. The torque of the
// motor is proportional to the duty cycle while the motor is slow, and the current is not measured.
// So measure FULL_FORCE_MN: the force at the handle with a duty cycle of 1 and the handle at rest.
#include "teleop_board.h"

teleop_board board;

void setup() {
  Serial.begin(921600);  // a board with native USB, as a Teensy, ignores the baud rate
  pinMode(DIRECTION_PIN, OUTPUT);
  pinMode(DUTY_PIN, OUTPUT);
  analogWriteFrequency(DUTY_PIN, 20000);
  analogWrite(DUTY_PIN, 0);
  pinMode(EMERGENCY_STOP_PIN, INPUT_PULLUP);  // closed to ground, so a broken wire also stops
  teleop_identity identity = {};
  identity.firmware_major = 1;
  identity.boot = RANDOM_OR_COUNTED_UP_IN_EEPROM();
  identity.encoders = identity.axes = 1;
  identity.force_axes = 1;  // bit 0: axis 0 accepts a force
  identity.max_sample_rate_hz = 1000;
  teleop_board_init(&board, &identity);
}

void loop() {
  while (Serial.available()) teleop_board_receive(&board, Serial.read(), micros());

  teleop_inputs inputs = {};
  inputs.time_us = micros();
  inputs.position[0] = ENCODER_COUNTS();
  inputs.velocity[0] = ENCODER_COUNTS_PER_SECOND();
  inputs.emergency_stop = digitalRead(EMERGENCY_STOP_PIN) == HIGH;

  uint8_t frame[TELEOP_FRAME_MAX];
  while (size_t length = teleop_board_poll(&board, &inputs, micros(), frame)) {
    if ((size_t)Serial.availableForWrite() >= length) Serial.write(frame, length);
  }

  // The force is 0 unless the axis is enabled: after a stop, and after a time without commands.
  int32_t force = board.force[0];
  int32_t size = force < 0 ? -force : force;
  if (size > FULL_FORCE_MN || force == INT32_MIN) size = FULL_FORCE_MN;
  digitalWrite(DIRECTION_PIN, force < 0 ? LOW : HIGH);
  analogWrite(DUTY_PIN, (int)(255 * (int64_t)size / FULL_FORCE_MN));
}
