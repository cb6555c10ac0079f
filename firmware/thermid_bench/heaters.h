// Two heaters on D9 and D10, by PWM of timer 1, and what cuts them off.
#pragma once
#include <stdbool.h>
#include <stdint.h>

enum Reason : uint8_t { NONE, HOT, BLIND, SILENT };

void heaters_begin();
bool heaters_on();
Reason heaters_refuse();                        // why they may not be turned on
void heaters_set(uint8_t heater, uint16_t duty);  // 0 or 1; 0.1 %
void heaters_clear();
void heaters_cut(Reason why);                   // at once; what it was is told later, between two cycles
bool heaters_were_cut();
void heaters_tell();
void heaters_say(uint32_t at);
