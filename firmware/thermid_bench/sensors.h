// The DS18B20 sensors of the bus.
#pragma once
#include <stdbool.h>
#include <stdint.h>

const uint8_t MOST_SENSORS = 16, NO_SENSOR = 255;

void sensors_search();                  // finds them, refuses those without a supply of their own, and says so
void sensors_configure(uint8_t bits);   // sets the resolution of all
void sensors_say();                     // one line each
uint8_t sensors_count();
uint16_t sensors_conversion(uint8_t bits);  // [ms]
void sensors_convert();                 // all at once

// Reads all, sends their lines if asked, returns how many are good; `hot` takes the first at or above the limit. Heaters go off at once.
uint8_t sensors_read(uint32_t at, bool send, int16_t limit, uint8_t *hot);
void sensors_event(const char *flash, uint8_t sensor);
