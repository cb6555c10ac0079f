// An INA219 at address 40 on I2C (A4, A5) with 0.1 ohm, where there is one.
#pragma once
#include <stdint.h>

void supply_begin();
void supply_say(uint32_t at);
