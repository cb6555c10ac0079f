// Milliseconds since the reset, by timer 2.
#pragma once
#include <stdint.h>

void clock_begin();
uint32_t clock_ms();
