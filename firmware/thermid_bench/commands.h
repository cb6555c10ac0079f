// What the host asks for.
#pragma once
#include <stdbool.h>
#include <stdint.h>

struct Settings {
    uint8_t bits;
    uint32_t interval, silence;  // [ms]
    int16_t limit;               // [1/16 degC]
};

extern Settings settings;

const uint8_t WANTS_BITS = 1, WANTS_SEARCH = 2, WANTS_IDENTITY = 4;

bool commands_take();               // takes in what has arrived; whether a command was good
uint32_t commands_heard();          // when the last good one came [ms]
bool commands_wants(uint8_t what);  // whether that is to be done; asking forgets it
